"""Accommodation over the whole envelope: q from the estimates of the faults, by K0's own coprime factors.

The residuals of the whole envelope's detector are the estimates f_N and f_p themselves. With `w` the shift of the
command's coordinates that takes f_N back, and e_p the place of p_e among the readings,

    q = V~ e_N w + U~ d,  d = [f_p, what f_p does to a superheat derived from the pressure]

makes K0 act as if it had read `y - d` and its speed had come out as commanded: `u = K0 (r - y + d) + e_N w`, whatever
the estimates do. U~ and V~ have one state matrix, so this is one filter:

    q = C s + D d + e_N w,  s+ = Phi s + Gamma_e d - Gamma_u e_N w

Both inputs are zero while no fault is isolated: K0 is alone. U~ and V~ are stable, so estimates that stay bounded give
a bounded q. The speed that the compressor has is `N + f_N`, N the command of the tick before; that is the speed which
K0 wants, so in the coordinate nu of the speed `w = nu(N) - nu(N + f_N)`.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ac_common.arrays import same_shape
from ac_common.faults import ISOLABLE_KINDS
from ac_common.units import KPA
from ac_plant_node.saturation import saturation_temperature
from gimc_controller_node.controller import ControllerDesign

Vector = NDArray[np.float64]
Signal = Sequence[float] | Vector

AT_LIMIT = "at a limit of the compressor: a part of its fault stays"
HARMFUL = "control errors have grown since: K0 alone until no fault is isolated"

TYPICAL = (2.5e5, 20.0)
"""Evaporator pressure [Pa] and superheat [K] with which a design is tried for one tick."""

LEAST_PRESSURE_PA = 1e4

ERROR_UNIT = (5.0 * KPA, 2.5)
"""Units of the watched control errors of p_e [Pa] and SH [K]."""


@dataclass(frozen=True)
class EnvelopeCompensatorDesign(ControllerDesign):
    """K0, and how what is isolated comes in and goes out.

    Attributes
    ----------
    fade_in_s, fade_out_s : float
        Time constants. `fade_in_s` is that of f_N; f_p comes in at once, because the reading has jumped by it: what
        K0 reads is then smoother than with a fade.
    watch_s : float
        Time constant with which the control errors are averaged: the sum of both in `ERROR_UNIT`.
    healthy : float
        The largest average that healthy drives have.
    harmful : float
        By how much the average may exceed that, or what it was when the fault was isolated if that is more.
    derived : float
        Whether the superheat is derived from the measured pressure: 1 or 0.
    """

    fade_in_s: float = 0.3
    fade_out_s: float = 5.0
    watch_s: float = 30.0
    healthy: float = 3.0
    harmful: float = 1.0
    derived: float = 0.0

    def try_out(self) -> None:
        """Work for one tick: matrices that do not fit show here, not when the loop runs."""
        one, other = ISOLABLE_KINDS
        EnvelopeCompensator(self).step((1.0, 1e3), one, other, TYPICAL, TYPICAL)


class EnvelopeCompensator:
    """States of both factors, the fades, the watch, and the step.

    Parameters
    ----------
    design : EnvelopeCompensatorDesign
    accommodate : bool
        False leaves K0 alone. May be changed between two steps.
    """

    def __init__(self, design: EnvelopeCompensatorDesign, accommodate: bool = True) -> None:
        self.design = design
        self.accommodate = accommodate
        k0 = design
        n = len(k0.phi)
        self._in = np.zeros(n + 3)
        self._state, self._inputs = self._in[:n], self._in[n:]
        self._output = np.ascontiguousarray(np.hstack([k0.c, k0.d, [[1.0], [0.0]]]))
        self._update = np.ascontiguousarray(np.hstack([k0.phi, k0.gamma[:, :2], -k0.gamma[:, 2:3]]))
        self._lowest: list[float] = k0.command_min.tolist()
        self._highest: list[float] = k0.command_max.tolist()
        self._used = [0.0, 0.0]  # of f_N and f_p, after the fades
        self._command: list[float] = k0.command_rest.tolist()  # as it was last sent
        self._pressure = TYPICAL[0]  # as it last read
        step = k0.sample_time_s
        fade_in, self._fades_out, self._averages = (
            -math.expm1(-step / time) for time in (design.fade_in_s, design.fade_out_s, design.watch_s)
        )
        self._fades_in = (fade_in, 1.0)
        self._average, self._allowed = 0.0, design.healthy + design.harmful
        self._withdrawn = False
        self._is_limited = False

    @property
    def does(self) -> str:
        """What of a fault is not accommodated, and why; empty when all is, or nothing is isolated."""
        if not self.accommodate:
            return ""
        return HARMFUL if self._withdrawn else AT_LIMIT if self._is_limited else ""

    def state(self) -> dict[str, Any]:
        """Return what a compensator that takes this one's place has to know, fit for JSON; between two ticks."""
        watch = [self._average, self._allowed, float(self._withdrawn)]
        seen = [*self._command, self._pressure]
        return {"_state": self._state.tolist(), "_used": list(self._used), "_watch": watch, "_seen": seen}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take the place of the compensator whose `state` this is.

        Raises
        ------
        ValueError
            When it is none of a compensator of this design.
        """
        try:
            own = same_shape(state["_state"], self._state)
            f_n, f_p = (float(value) for value in state["_used"])
            average, allowed, withdrawn = (float(value) for value in state["_watch"])
            speed, opening, pressure = (float(value) for value in state["_seen"])
        except (KeyError, TypeError, ValueError) as problem:
            msg = f"not the state of such a compensator: {type(problem).__name__} {problem}"
            raise ValueError(msg) from None
        self._state[:] = own
        self._used[:] = f_n, f_p
        self._average, self._allowed, self._withdrawn = average, allowed, bool(withdrawn)
        self._command, self._pressure = [speed, opening], pressure

    def commanded(self, command: Signal) -> None:
        """Take note of the command [rad/s, 0..1] that was sent in this tick."""
        self._command = [float(command[0]), float(command[1])]

    def warm_restart(
        self,
        estimates: Signal,
        isolated: str | None,
        also_isolated: str | None,
        reference: Signal | None,
        missed_ticks: int,
    ) -> None:
        """Go over missed ticks as if all had been as it is now, but for the watch, which has not seen them.

        Call it before `step`, with that tick's estimates, isolation and references.
        """
        for _ in range(missed_ticks):
            self.step(estimates, isolated, also_isolated, reference)

    def step(
        self,
        estimates: Signal,
        isolated: str | None,
        also_isolated: str | None = None,
        reference: Signal | None = None,
        measured: Signal | None = None,
    ) -> Vector:
        """Return the signal q of this tick.

        Parameters
        ----------
        estimates : sequence of float, length 2
            f_N [rad/s] and f_p [Pa].
        isolated, also_isolated : str or None
            The isolated faults; for one that is "unknown" there is no q.
        reference, measured : sequence of float, length 2 or more, optional
            Of p_e [Pa] and SH [K]; None: missing, and nothing is watched in this tick.

        Returns
        -------
        ndarray, shape (2,)
            q in the command's coordinates [rad/s, 0..1].
        """
        active = [kind in (isolated, also_isolated) for kind in ISOLABLE_KINDS]
        acts, used = self.accommodate and not self._withdrawn, self._used
        for i, estimate in enumerate(estimates):
            goal, rate = (estimate, self._fades_in[i]) if active[i] and acts else (0.0, self._fades_out)
            used[i] += rate * (goal - used[i])
        f_n, f_p = used
        if measured is not None:
            self._pressure = float(measured[0])
        in_superheat = _superheat_fault(self._pressure, f_p) if self.design.derived > 0.5 else 0.0
        inputs = self._inputs
        inputs[0], inputs[1], inputs[2] = f_p, in_superheat, self._shift(self._command[0], f_n)
        q: Vector = self._output @ self._in
        self._state[:] = self._update @ self._in
        speed_stops, valve_stops = (
            not low < now < high for low, now, high in zip(self._lowest, self._command, self._highest, strict=True)
        )
        self._is_limited = acts and active[0] and speed_stops
        at_limit = speed_stops or valve_stops  # there errors grow with any control
        if reference is not None and measured is not None and not at_limit:
            errors = (reference[0] - measured[0] + f_p, reference[1] - measured[1] + in_superheat)
            self._watch(any(active), abs(errors[0]) / ERROR_UNIT[0] + abs(errors[1]) / ERROR_UNIT[1])
        return q

    def _shift(self, speed: float, f_n: float) -> float:
        """Return what takes f_N off the coordinate of the speed."""
        if f_n == 0.0:
            return 0.0
        k0 = self.design
        sent, turning = np.array([speed, 0.0]), np.array([max(speed + f_n, 0.0), 0.0])
        return float((k0.coordinates(sent) - k0.coordinates(turning))[0])

    def _watch(self, is_active: bool, error: float) -> None:
        """Withdraw what seems to do harm, until the fault is no longer isolated."""
        self._average += self._averages * (error - self._average)
        if not is_active:
            self._allowed, self._withdrawn = max(self._average, self.design.healthy) + self.design.harmful, False
        elif self._average > self._allowed:
            self._withdrawn = True


def _superheat_fault(reading_pa: float, f_p: float) -> float:
    """Return what f_p [Pa] adds to a superheat [K] derived from a pressure that reads `reading_pa` [Pa]."""
    actual = max(reading_pa - f_p, LEAST_PRESSURE_PA)
    return saturation_temperature(actual) - saturation_temperature(max(reading_pa, LEAST_PRESSURE_PA))
