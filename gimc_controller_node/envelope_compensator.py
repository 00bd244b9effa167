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
from ac_common.compiled import ready
from ac_common.faults import ISOLABLE_KINDS
from ac_common.products import columns_of, multiply
from ac_common.units import KPA
from ac_plant_node.saturation import saturation_curve, temperature_on
from gimc_controller_node.compiled import Array, jit
from gimc_controller_node.controller import ControllerDesign, coordinate
from gimc_controller_node.protection import NO_HIGHEST_HEAD_PA

Vector = NDArray[np.float64]
Signal = Sequence[float] | Vector

AT_LIMIT = "at a limit of the compressor: a part of its fault stays"
HARMFUL = "control errors have grown since: K0 alone until no fault is isolated"

TYPICAL = (2.5e5, 20.0)
"""Evaporator pressure [Pa] and superheat [K] with which a design is tried for one tick."""

LEAST_PRESSURE_PA = 1e4

ERROR_UNIT = (5.0 * KPA, 2.5)
"""Units of the watched control errors of p_e [Pa] and SH [K]."""

# Layout of what an `EnvelopeCompensator` remembers, and of what it is made of; behind it stand [state, inputs], the
# state of the next tick, and the matrices of q and state.
_USED, _AVERAGE, _ALLOWED, WITHDRAWN, _RECOVERING = 0, 2, 3, 4, 5  # of f_N and f_p, after the fades; then the watch
COMMAND, _PRESSURE = 6, 8  # as it was last sent, as it last read
LIMITED, Q, _LOWEST, _HIGHEST, _FADES_IN, _FADES_OUT, _AVERAGES = 9, 10, 12, 14, 16, 18, 19
_HEALTHY, _HARMFUL, _REST, _CURVATURE, _CAPPED, _RECOVERS, _VECTORS = 20, 21, 22, 23, 24, 25, 26


@jit
def _superheat_fault(curve: Array, reading_pa: float, f_p: float) -> float:
    """Return what f_p [Pa] adds to a superheat [K] derived from a pressure that reads `reading_pa` [Pa]."""
    actual = max(reading_pa - f_p, LEAST_PRESSURE_PA)
    more: float = temperature_on(curve, actual) - temperature_on(curve, max(reading_pa, LEAST_PRESSURE_PA))
    return more


@jit
def _shift(m: Array, f_n: float) -> float:
    """Return what takes f_N off the coordinate of the speed."""
    if f_n == 0.0:
        return 0.0
    sent, turning = m[COMMAND], max(m[COMMAND] + f_n, 0.0)
    return coordinate(sent - m[_REST], m[_CURVATURE]) - coordinate(turning - m[_REST], m[_CURVATURE])


@jit
def _watch(m: Array, is_active: bool, is_unsure: bool, error: float) -> None:
    """Withdraw what seems to do harm, until no fault is isolated: one whose name is unsure meanwhile still is."""
    m[_AVERAGE] += m[_AVERAGES] * (error - m[_AVERAGE])
    if not (is_active or is_unsure):
        m[_ALLOWED], m[WITHDRAWN] = max(m[_AVERAGE], m[_HEALTHY]) + m[_HARMFUL], 0.0
    elif is_active and m[_AVERAGE] > m[_ALLOWED]:
        m[WITHDRAWN] = 1.0


@jit
def accommodation(
    m: Array, curve: Array, n: int, f_n: float, f_p: float, has_f_n: int, has_f_p: int, is_unsure: int, may_act: int,
    is_read: int, pressure: float, superheat: float, head: float, is_wanted: int, wanted_pressure: float,
    wanted_superheat: float,
) -> None:  # fmt: skip
    """One tick: see `EnvelopeCompensator.step`; `curve` is empty when the superheat is not derived."""
    acts, used = may_act != 0 and m[WITHDRAWN] == 0.0, m[_USED : _USED + 2]
    for i in range(2):
        goal, rate = 0.0, m[_FADES_OUT]
        if acts and (has_f_n if i == 0 else has_f_p) != 0:
            goal, rate = f_n if i == 0 else f_p, m[_FADES_IN + i]
        used[i] += rate * (goal - used[i])
    if is_read != 0:
        m[_PRESSURE] = pressure
    in_superheat = _superheat_fault(curve, m[_PRESSURE], used[1]) if curve.size > 0 else 0.0
    end, sizes = _VECTORS + n + 3, (2 * (n + 3), n * (n + 3))
    known, after, first = m[_VECTORS:end], m[end : end + n], end + n
    known[n], known[n + 1], known[n + 2] = used[1], in_superheat, _shift(m, used[0])
    multiply(m[first : first + sizes[0]], known, m[Q : Q + 2])
    multiply(m[first + sizes[0] : first + sizes[0] + sizes[1]], known, after)
    for i in range(n):
        known[i] = after[i]
    speed_stops = not m[_LOWEST] < m[COMMAND] < m[_HIGHEST]
    valve_stops = not m[_LOWEST + 1] < m[COMMAND + 1] < m[_HIGHEST + 1]
    m[LIMITED] = 1.0 if acts and has_f_n != 0 and speed_stops else 0.0
    m[_RECOVERING] = 1.0 if head > m[_CAPPED] else m[_RECOVERING] - m[_RECOVERS]
    at_limit = speed_stops or valve_stops or m[_RECOVERING] > 0.0  # there errors grow with any control
    if is_wanted != 0 and is_read != 0 and not at_limit:
        errors = wanted_pressure - pressure + used[1], wanted_superheat - superheat + in_superheat
        error = abs(errors[0]) / ERROR_UNIT[0] + abs(errors[1]) / ERROR_UNIT[1]
        _watch(m, has_f_n + has_f_p != 0, is_unsure != 0, error)


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
    capped_head_pa : float
        Condenser pressure above which the protection may hold the compressor's speed down, whatever K0 wants.
    recover_s : float
        For so long after it errors may be large, because the protection lets the speed come back slowly.
    """

    fade_in_s: float = 0.3
    fade_out_s: float = 5.0
    watch_s: float = 30.0
    healthy: float = 3.0
    harmful: float = 1.0
    derived: float = 0.0
    capped_head_pa: float = NO_HIGHEST_HEAD_PA
    recover_s: float = 60.0

    def try_out(self) -> None:
        """Work for one tick: matrices that do not fit show here, not when the loop runs."""
        one, other = ISOLABLE_KINDS
        EnvelopeCompensator(self).step((1.0, 1e3), one, other, TYPICAL, TYPICAL)


_STATE = ("_state", "_used", "_watch", "_seen")


class EnvelopeCompensator:
    """States of both factors, the fades, the watch, and the step.

    Parameters
    ----------
    design : EnvelopeCompensatorDesign
    accommodate : bool
        False leaves K0 alone. May be changed between two steps.

    Attributes
    ----------
    memory, curve : ndarray
    n_states : int
        What it remembers and is made of, for compiled code: the first arguments of `accommodation`.
    """

    def __init__(self, design: EnvelopeCompensatorDesign, accommodate: bool = True) -> None:
        self.design = design
        self.accommodate = accommodate
        self._accommodate = ready(accommodation)
        n = self.n_states = len(design.phi)
        output = columns_of(np.hstack([design.c, design.d, [[1.0], [0.0]]]))
        update = columns_of(np.hstack([design.phi, design.gamma[:, :2], -design.gamma[:, 2:3]]))
        m = self.memory = np.concatenate([np.zeros(_VECTORS + 2 * n + 3), output, update])
        fade_in, m[_FADES_OUT], m[_AVERAGES] = (
            -math.expm1(-design.sample_time_s / time) for time in (design.fade_in_s, design.fade_out_s, design.watch_s)
        )
        m[_FADES_IN : _FADES_IN + 2] = fade_in, 1.0
        m[_LOWEST : _LOWEST + 2], m[_HIGHEST : _HIGHEST + 2] = design.command_min, design.command_max
        m[_HEALTHY], m[_HARMFUL], m[_ALLOWED] = design.healthy, design.harmful, design.healthy + design.harmful
        m[_REST], m[_CURVATURE], m[_CAPPED] = design.command_rest[0], design.curvature[0], design.capped_head_pa
        m[_RECOVERS] = design.sample_time_s / design.recover_s
        m[COMMAND : COMMAND + 2], m[_PRESSURE] = design.command_rest, TYPICAL[0]
        self.curve = saturation_curve() if design.derived > 0.5 else np.empty(0)
        self._q, self._state, self._command = m[Q : Q + 2], m[_VECTORS : _VECTORS + n], m[COMMAND:_PRESSURE]
        self._used, self._watch, self._seen = m[_USED:_AVERAGE], m[_AVERAGE:COMMAND], m[COMMAND : _PRESSURE + 1]

    @property
    def does(self) -> str:
        """What of a fault is not accommodated, and why; empty when all is, or nothing is isolated."""
        if not self.accommodate:
            return ""
        m = self.memory
        return HARMFUL if m[WITHDRAWN] else AT_LIMIT if m[LIMITED] else ""

    def state(self) -> dict[str, Any]:
        """Return what a compensator that takes this one's place has to know, fit for JSON; between two ticks."""
        return {name: getattr(self, name).tolist() for name in _STATE}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take the place of the compensator whose `state` this is.

        Raises
        ------
        ValueError
            When it is none of a compensator of this design.
        """
        try:
            own = {name: same_shape(state[name], getattr(self, name)) for name in _STATE}
        except (KeyError, TypeError, ValueError) as problem:
            msg = f"not the state of such a compensator: {type(problem).__name__} {problem}"
            raise ValueError(msg) from None
        for name, values in own.items():
            getattr(self, name)[:] = values

    def commanded(self, command: Signal) -> None:
        """Take note of the command [rad/s, 0..1] that was sent in this tick."""
        self._command[:] = command

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
        is_unsure: bool = False,
    ) -> Vector:
        """Return the signal q of this tick.

        Parameters
        ----------
        estimates : sequence of float, length 2
            f_N [rad/s] and f_p [Pa].
        isolated, also_isolated : str or None
            The isolated faults whose names are sure; for one that is "unknown" there is no q.
        reference, measured : sequence of float, optional
            Of p_e [Pa] and SH [K]; measured of p_c [Pa], too, where it is read, as the last of more than two. None:
            missing, and nothing is watched in this tick.
        is_unsure : bool, optional
            Whether a fault is isolated whose name is not sure.

        Returns
        -------
        ndarray, shape (2,)
            q in the command's coordinates [rad/s, 0..1].
        """
        f_n, f_p = estimates
        has_f_n, has_f_p = (int(kind in (isolated, also_isolated)) for kind in ISOLABLE_KINDS)
        is_read, (p_e, sh) = (0, (0.0, 0.0)) if measured is None else (1, measured[:2])
        p_c = measured[-1] if measured is not None and len(measured) > 2 else 0.0
        is_wanted, (pressure, superheat) = (0, (0.0, 0.0)) if reference is None else (1, reference[:2])
        self._accommodate(
            self.memory, self.curve, self.n_states, float(f_n), float(f_p), has_f_n, has_f_p, int(is_unsure),
            int(self.accommodate), is_read, float(p_e), float(sh), float(p_c), is_wanted, float(pressure),
            float(superheat),
        )  # fmt: skip
        return self._q.copy()
