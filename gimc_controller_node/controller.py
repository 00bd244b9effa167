"""K0 at run time: `u = V~^-1 (U~ (r - y) + q)`, one step a tick.

U~ and V~ - I share their state matrix, so both run as one filter with the state `xi` (reading `u` back, as the GIMC
structure does, instead of inverting V~):

    u_k      = sat(C_k xi_k + D_k (r_k - y_k) + q_k)
    xi_{k+1} = Phi xi_k + Gamma_e (r_k - y_k) + Gamma_u u_k

What is read back is the command after its limits, in size and in rate: the states then stay consistent with what the
plant really gets, which is the anti-windup of this form.

When a limit holds one command back, the other one does what is missing as far as it can: of all commands within the
limits, the one is sent whose outputs are nearest to what was wanted, some seconds ahead (`ControllerDesign.priority`).
The references r have passed the governor (`gimc_controller_node.reference_governor`).
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ac_common.cache import Arrays
from gimc_controller_node.reference_governor import ReferenceGovernor

Vector = NDArray[np.float64]

Q_FADE_S = 0.5
"""Time constant with which q fades out when it stops arriving, and with which it is met again when it is back."""


@dataclass(frozen=True)
class ControllerDesign:
    """Sampled U~ and V~ of one operating point, in deviations from it.

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

    @classmethod
    def from_arrays(cls, arrays: Arrays) -> "ControllerDesign":
        """Design from the arrays that the cache stores; those of older bags may lack what came later."""
        free = {"command_rate": np.full(2, np.inf), "lead": np.full(2, np.inf)}
        known = {**free, "lag_s": np.ones(2), "priority": np.eye(2), **arrays}
        matrices = {name: np.ascontiguousarray(known[name]) for name in cls.__dataclass_fields__}
        return cls(**{**matrices, "sample_time_s": float(arrays["sample_time_s"])})  # type: ignore[arg-type]

    def try_out(self) -> None:
        """Work for one tick: matrices that do not fit show here, not when the loop runs."""
        measured = np.array([2.5e5, 20.0])
        Controller(self).step(measured, measured, np.zeros(2))


class Controller:
    """The controller's state and its step.

    A new controller stands at the operating point: its first command may leave `command_rest` by one tick's worth of
    rate. One that is to take over from something else calls `resume` first.

    Parameters
    ----------
    design : ControllerDesign

    Attributes
    ----------
    at_limit : tuple of bool
        Whether the last command of compressor and valve was held back by a limit, in size or in rate, or makes up for
        the other one, which was.
    """

    def __init__(self, design: ControllerDesign) -> None:
        self.design = design
        n = len(design.phi)
        self._n = n
        self._in = np.zeros(n + 4)  # state, r - y, command
        self._state, self._error, self._deviation = self._in[:n], self._in[n : n + 2], self._in[n + 2 :]
        self._seen = self._in[: n + 2]
        self._output = np.ascontiguousarray(np.hstack([design.c, design.d]))
        self._update = np.ascontiguousarray(np.hstack([design.phi, design.gamma]))
        self._wanted, self._next = np.zeros(2), np.zeros(n)
        self._q, self._q_offset = [0.0, 0.0], [0.0, 0.0]
        self._q_silent = self._q_met = False
        self._q_keeps = math.exp(-design.sample_time_s / Q_FADE_S)
        self._last: list[float] = design.command_rest.tolist()
        self._rest: list[float] = design.command_rest.tolist()
        self._low: list[float] = design.command_min.tolist()
        self._high: list[float] = design.command_max.tolist()
        self._stride: list[float] = (design.command_rate * design.sample_time_s).tolist()
        self._governors = [
            ReferenceGovernor(lead, lag_s, design.sample_time_s)
            for lead, lag_s in zip(design.lead.tolist(), design.lag_s.tolist(), strict=True)
        ]
        (self._cost_speed, self._cost_both), (_, self._cost_valve) = design.priority.tolist()
        self._caps = (math.inf, math.inf)
        self.at_limit = (False, False)

    def step(self, reference: Vector, measured: Vector, q: Vector | None) -> Vector:
        """Command of this tick.

        Parameters
        ----------
        reference : ndarray, shape (2,)
            Evaporator pressure [Pa] and superheat [K] wanted.
        measured : ndarray, shape (2,) or longer
            The same two, as measured; what follows is not used.
        q : ndarray, shape (2,), or None
            The compensator's signal [rad/s, 0..1]. None: there is none this tick; the last one fades out with the time
            constant `Q_FADE_S`, which leaves K0. When there is one again, the difference to what is left of the old
            one fades in the same way. No switching moves the command by more than a tick's part of that.

        Returns
        -------
        ndarray, shape (2,)
            Compressor speed [rad/s] and valve opening [0..1], within their limits, and within their rates of the
            command before. This is what the plant must get, and what the observer must be told.
        """
        wanted_pressure, wanted_superheat = reference.tolist()
        pressure, superheat, *_ = measured.tolist()
        for_pressure, for_superheat = self._governors
        self._error[0] = for_pressure.step(wanted_pressure) - pressure
        self._error[1] = for_superheat.step(wanted_superheat) - superheat
        np.dot(self._output, self._seen, out=self._wanted)
        speed, valve = self._wanted.tolist()
        q_speed, q_valve = self._faded(q)
        speed, valve = speed + q_speed, valve + q_valve
        rest, last, low, high, stride = self._rest, self._last, self._low, self._high, self._stride
        speed, valve = speed + rest[0], valve + rest[1]
        slowest, narrowest = max(low[0], last[0] - stride[0]), max(low[1], last[1] - stride[1])
        fastest, widest = min(high[0], last[0] + stride[0]), min(high[1], last[1] + stride[1])
        if slowest <= speed <= fastest and narrowest <= valve <= widest:
            sent_speed, sent_valve = speed, valve
        else:
            sent_speed, sent_valve = self._nearest(speed, valve, (slowest, fastest), (narrowest, widest))
        # What a cap takes away the other command must not make up for: the cap is there to change the outputs.
        sent_speed = max(min(sent_speed, self._caps[0]), slowest)
        sent_valve = max(min(sent_valve, self._caps[1]), narrowest)
        self.at_limit = (sent_speed != speed, sent_valve != valve)
        last[0], last[1] = sent_speed, sent_valve
        self._deviation[0], self._deviation[1] = sent_speed - rest[0], sent_valve - rest[1]
        np.dot(self._update, self._in, out=self._next)
        self._state[:] = self._next
        return np.array([sent_speed, sent_valve])

    def cap(self, speed_rad_s: float, opening: float) -> None:
        """Keep the commands below these caps from now on; inf takes a cap away.

        A cap below the last command is met at the command's greatest rate.
        """
        self._caps = (speed_rad_s, opening)

    def resume(self, command: Vector, measured: Vector, reference: Vector) -> None:
        """Take over from whatever moves the actuators now, without a jump.

        Call it once, before the first `step`, with what that step will see. With the same reference, measurement and
        no q the first command then is `command` (within its limits), and K0 goes on from there: the state is the one
        in which the loop would rest with these actuators, so the integrators, not a proportional part, take up the
        error that is there. A q that arrives in the first tick is met with its fade.

        Parameters
        ----------
        command : ndarray, shape (2,)
            What the actuators do now: compressor speed [rad/s], valve opening [0..1].
        measured : ndarray, shape (2,) or longer
            Evaporator pressure [Pa] and superheat [K] now.
        reference : ndarray, shape (2,)
            The same two, as wanted.

        Raises
        ------
        ValueError
            When a number is not finite.
        """
        design = self.design
        sent = np.minimum(np.maximum(command, design.command_min), design.command_max)
        for governor, output in zip(self._governors, measured[:2].tolist(), strict=True):
            governor.start(output)
        governed = [g.governed(wanted) for g, wanted in zip(self._governors, reference.tolist(), strict=True)]
        error = np.array(governed) - measured[:2]
        if not (np.isfinite(sent).all() and np.isfinite(error).all()):
            raise ValueError(f"cannot resume from command {command}, measured {measured}, reference {reference}")
        at_rest = np.linalg.solve(np.eye(self._n) - design.phi, design.gamma[:, 2:])  # xi under a unit command held
        missing = sent - design.command_rest - design.d @ error
        self._state[:] = at_rest @ np.linalg.lstsq(design.c @ at_rest, missing, rcond=None)[0]
        self._last[:] = sent.tolist()
        self._q[:] = self._q_offset[:] = [0.0, 0.0]
        self._q_silent = True

    def _nearest(
        self, speed: float, valve: float, speeds: tuple[float, float], valves: tuple[float, float]
    ) -> tuple[float, float]:
        """Command within the limits that is nearest to the one wanted, which is beyond them: it is on an edge."""
        own, both, other = self._cost_speed, self._cost_both, self._cost_valve
        edges = [(edge, _within(valve - both / other * (edge - speed), valves)) for edge in speeds]
        edges += [(_within(speed - both / own * (edge - valve), speeds), edge) for edge in valves]
        least, best = math.inf, (math.nan, math.nan)
        for there in edges:
            x, y = there[0] - speed, there[1] - valve
            cost = own * x * x + 2.0 * both * x * y + other * y * y
            if cost < least:
                least, best = cost, there
        return best

    def _faded(self, q: Vector | None) -> list[float]:
        """What is used of q: q itself, but for the fades around a silence."""
        used, offset, keeps = self._q, self._q_offset, self._q_keeps
        if q is None:
            used[0], used[1] = keeps * used[0], keeps * used[1]
            self._q_silent = True
            return used
        speed, valve = q.tolist()
        if self._q_silent:  # the first one after a silence
            self._q_silent, self._q_met = False, True
            offset[0], offset[1] = used[0] - speed, used[1] - valve
        if self._q_met:
            offset[0], offset[1] = keeps * offset[0], keeps * offset[1]
            speed, valve = speed + offset[0], valve + offset[1]
            self._q_met = max(abs(offset[0]), abs(offset[1])) > 1e-12
        used[0], used[1] = speed, valve
        return used


def _within(value: float, limits: tuple[float, float]) -> float:
    return min(max(value, limits[0]), limits[1])
