"""Controllers: what every one can be asked (`Controller`), and K0 at run time, `u = V~^-1 (U~ (r - y) + q)`.

U~ and V~ - I share their state matrix, so both run as one filter with the state `xi` (reading `u` back, as the GIMC
structure does, instead of inverting V~):

    w_k      = C_k xi_k + D_k (r_k - y_k) + q_k
    u_k      = sat(w_k)                                        (`LimitedController`)
    xi_{k+1} = Phi xi_k + Gamma_e (r_k - y_k) + Gamma_u u_k

What is read back is the command after its limits, in size and in rate: the states then stay consistent with what the
plant really gets, which is the anti-windup of this form.

The command's coordinates are deviations from rest, `v = [N - N_0, alpha - alpha_0]`; in a design for the whole envelope
they are logarithmic, `ln(1 + c v) / c`: the plant's gains from them to the outputs vary far less over the envelope than
those from speed and opening. U~, V~ and q are then what they are in the paper, in these coordinates.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from ac_common.arrays import Arrays
from ac_common.products import columns_of, multiply
from gimc_controller_node.compiled import Array, jit

Vector = NDArray[np.float64]
#: Compressor speed [rad/s] and valve opening [0..1], shape (2,).
Command = NDArray[np.float64]


LARGEST_EXPONENT = 50.0
"""Of a command over its value at rest: any beyond is out of all limits, and would overflow."""

NO_APPROACH_K = -1e3
"""An approach that no superheat comes near."""

LEAST_SHARE = -1.0 + 1e-9
"""Least that a logarithm is taken of, less one: a command that is wanted far below its limits has one, too."""


@jit
def coordinate(above: float, c: float) -> float:
    """Return the coordinate of a command that is so far above rest, with curvature c."""
    return math.log1p(max(c * above, LEAST_SHARE)) / c if c != 0.0 else above


@jit
def above_rest(coordinate: float, c: float) -> float:
    """Return how far above rest the command of a coordinate is, with curvature c."""
    return math.expm1(min(c * coordinate, LARGEST_EXPONENT)) / c if c != 0.0 else coordinate


@dataclass(frozen=True)
class ControllerDesign:
    """Sampled U~ and V~ of one operating point, in deviations from it, or of the whole envelope.

    Attributes
    ----------
    phi : ndarray, shape (n, n)
        State matrix of U~ and V~.
    gamma : ndarray, shape (n, 4)
        Input matrix: columns of `r - y` [Pa, K], then of `u` [rad/s, 0..1] (with the sign of V~'s read-back included).
    c : ndarray, shape (2, n)
    d : ndarray, shape (2, 2)
        Direct feedthrough of U~.
    command_rest : ndarray, shape (2,)
        Command at the operating point [rad/s, 0..1].
    command_min, command_max : ndarray, shape (2,)
        Limits of the command [rad/s, 0..1].
    command_rate : ndarray, shape (2,)
        Limits of its rate of change, up and down [rad/s^2, 1/s].
    sample_time_s : float
    priority : ndarray, shape (2, 2)
        Positive definite P: at a limit the command u is sent for which `(u - wanted)' P (u - wanted)` is least. Designs
        without it cut each command by itself.
    lead : ndarray, shape (2,)
        How far the references of p_e [Pa] and SH [K] may run ahead of the loop; designs without it do not care.
    lag_s : ndarray, shape (2,)
        Time constants with which the loop is taken to follow them [s].
    curvature : ndarray, shape (2,)
        c of the logarithmic coordinates [s/rad, 1], below `1 / command_rest`; zero: speed and opening themselves.
    approach_k : float
        By how much the refrigerant at the evaporator's outlet has to stay colder than the air at its inlet [K]: a
        superheat beyond is not asked for; `NO_APPROACH_K`: any is.
    """

    phi: Vector
    gamma: Vector
    c: Vector
    d: Vector
    command_rest: Vector
    command_min: Vector
    command_max: Vector
    command_rate: Vector
    sample_time_s: float
    priority: Vector = field(default_factory=lambda: np.eye(2))
    lead: Vector = field(default_factory=lambda: np.full(2, np.inf))
    lag_s: Vector = field(default_factory=lambda: np.ones(2))
    curvature: Vector = field(default_factory=lambda: np.zeros(2))
    approach_k: float = NO_APPROACH_K

    @classmethod
    def from_arrays(cls, arrays: Arrays) -> Self:
        """Return the design from the arrays that the cache stores; those of older bags may lack what came later."""
        free = {"command_rate": np.full(2, np.inf), "lead": np.full(2, np.inf), "curvature": np.zeros(2)}
        known = {**free, "lag_s": np.ones(2), "priority": np.eye(2), **arrays}
        own = [one for one in fields(cls) if one.name in known]
        numbers = {one.name: float(known[one.name]) for one in own if one.type is float}
        matrices = {one.name: np.ascontiguousarray(known[one.name]) for one in own if one.name not in numbers}
        return cls(**{**matrices, **numbers})  # type: ignore[arg-type]

    def coordinates(self, command: Command) -> Vector:
        """Return the coordinates [rad/s, 0..1] of a command within the limits [rad/s, 0..1], shape (2,)."""
        above: Vector = command - self.command_rest
        return _each(coordinate, above, self.curvature) if self.is_curved else above

    def command_at(self, coordinates: Vector) -> Command:
        """Return the command [rad/s, 0..1] at these coordinates [rad/s, 0..1], shape (2,)."""
        above = _each(above_rest, coordinates, self.curvature) if self.is_curved else coordinates
        command: Command = above + self.command_rest
        return command

    @cached_property
    def is_curved(self) -> bool:
        """Whether the coordinates are other than the commands themselves; looked up several times a tick."""
        return bool(self.curvature.any())

    def try_out(self) -> None:
        """Work for one tick: matrices that do not fit show here, not when the loop runs."""
        measured = np.array([2.5e5, 20.0])
        controller = GimcController(self)
        controller.sent(controller.step(measured, measured, np.zeros(2)))


class Controller(Protocol):
    """What gives the command of a tick. A class of yours derives from it and is built from a `ControllerDesign`.

    Around each controller stand a reference governor, the limits of the commands in size and in rate, the protection,
    and what is done when measurements are missing (`LimitedController`, `FallbackController`).
    """

    def step(self, reference: Vector, measurement: Vector, q: Vector) -> Command:
        """Return the command that is wanted in this tick.

        Parameters
        ----------
        reference : ndarray, shape (2,)
            Evaporator pressure [Pa] and superheat [K] wanted, as the reference governor passes them on.
        measurement : ndarray, shape (2,)
            The same two, as measured.
        q : ndarray, shape (2,)
            The compensator's signal in the command's coordinates [rad/s, 0..1]; zero when there is none.
        """

    def sent(self, command: Command) -> None:
        """Take note of the command that is sent in this tick, after its limits; what integrates must not wind up."""

    def warm_restart(self, command: Command, measurement: Vector, reference: Vector) -> None:
        """Go on from `command`, which the actuators have now, without a jump; the next `step` sees the same signals."""


# Layout of what K0 is made of: the command at rest and the curvatures, then what it wants; behind that stand its
# vectors [xi, r - y, u] and xi of the next tick, and the matrices of both.
_REST, _CURVATURE, WANTED, _VECTORS = 0, 2, 4, 6


@jit
def k0_step(m: Array, n: int, pressure_error: float, superheat_error: float, q_speed: float, q_valve: float) -> None:
    """Find the command that K0 wants, `m[4:6]`, on its memory; n: length of its state."""
    seen, first = m[_VECTORS : _VECTORS + n + 2], _VECTORS + 2 * n + 4
    seen[n], seen[n + 1] = pressure_error, superheat_error
    wanted = m[WANTED : WANTED + 2]
    multiply(m[first : first + 2 * (n + 2)], seen, wanted)
    wanted[0] = above_rest(wanted[0] + q_speed, m[_CURVATURE]) + m[_REST]
    wanted[1] = above_rest(wanted[1] + q_valve, m[_CURVATURE + 1]) + m[_REST + 1]


@jit
def k0_sent(m: Array, n: int, speed: float, valve: float) -> None:
    """As `GimcController.sent`, on its memory."""
    end, first = _VECTORS + n + 4, _VECTORS + 2 * n + 4 + 2 * (n + 2)
    known, after = m[_VECTORS:end], m[end : end + n]
    known[n + 2] = coordinate(speed - m[_REST], m[_CURVATURE])
    known[n + 3] = coordinate(valve - m[_REST + 1], m[_CURVATURE + 1])
    multiply(m[first : first + n * (n + 4)], known, after)
    for i in range(n):
        known[i] = after[i]


class GimcController(Controller):
    """K0 in coprime factors: its state and its step.

    A new one stands at the operating point.

    Parameters
    ----------
    design : ControllerDesign

    Attributes
    ----------
    n_states : int
    memory : ndarray
        What it remembers and is made of, for compiled code.
    """

    def __init__(self, design: ControllerDesign) -> None:
        self.design = design
        n = self.n_states = len(design.phi)
        output = columns_of(np.hstack([design.c, design.d]))
        update = columns_of(np.hstack([design.phi, design.gamma]))
        constants = [design.command_rest, design.curvature, np.zeros(2 + 2 * n + 4)]
        self.memory = np.concatenate([*constants, output, update])
        self._wanted, self._state = self.memory[WANTED:_VECTORS], self.memory[_VECTORS : _VECTORS + n]

    def step(self, reference: Vector, measurement: Vector, q: Vector) -> Command:
        """Return the command that is wanted: `w = C xi + D (r - y) + q`, from the operating point on."""
        k0_step(self.memory, self.n_states, *(reference - measurement).tolist(), *q.tolist())
        return self._wanted.copy()

    def sent(self, command: Command) -> None:
        """Step the state over this tick with the command that the plant gets."""
        k0_sent(self.memory, self.n_states, float(command[0]), float(command[1]))

    def warm_restart(self, command: Command, measurement: Vector, reference: Vector) -> None:
        """Take the state in which the loop would rest with `command`.

        So the integrators, not a proportional part, take up the error that is there.
        """
        design = self.design
        at_rest = np.linalg.solve(
            np.eye(self.n_states) - design.phi, design.gamma[:, 2:]
        )  # xi under a unit command held
        missing = design.coordinates(command) - design.d @ (reference - measurement)
        self._state[:] = at_rest @ np.linalg.lstsq(design.c @ at_rest, missing, rcond=None)[0]


def _each(of: Callable[[float, float], float], values: Vector, curvature: Vector) -> Vector:
    return np.array([of(value, c) for value, c in zip(values.tolist(), curvature.tolist(), strict=True)])
