"""Fault detection at run time: innovation, residual, and the decision which fault is there.

The observer and the isolation filter are linear and run in deviations from the operating point:

    f_e = N~ u - M~ y   (M~ = (A+LC, L, C, I), N~ = (A+LC, B+LD, C, D); u with the measured air inlet temperature)
    r   = H f_e         (low-passed estimates of f_N and f_p)

The decision is a small state machine on `|r_i| / threshold_i`: a fault is isolated when its residual leads, and the
other one, too, when its residual is then more than the first fault could make it.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ac_common.arrays import Arrays, same_shape
from ac_common.topics import FAULTS

Vector = NDArray[np.float64]

NOT = math.inf
"""Time since when something holds that does not hold: later than every time."""


@dataclass(frozen=True)
class Supervision:
    """When a residual becomes a detection, and a detection an isolation.

    Attributes
    ----------
    confirm_s : float
        A residual must stay above its threshold this long before the fault counts as detected.
    isolate_s : float
        The leading residual must then lead this long before its fault counts as isolated.
    lead : float
        A residual leads when its ratio to its threshold is this many times the other's.
    undecided_s : float
        When none has led this long after the detection, both faults count as there, if
    cross_talk : tuple of float
        each residual's ratio is above this part of the other's: [f_p in r_N, f_N in r_p], more than one fault by itself
        can bring into the other's residual. So it is for the second fault once the first is isolated, and
    also_isolate_s : float
        this long.
    clear_ratio : float
        A fault is over when its residual has been below this part of its threshold
    clear_s : float
        for this long.
    """

    confirm_s: float = 0.5
    isolate_s: float = 0.5
    lead: float = 1.5
    undecided_s: float = 5.0
    cross_talk: tuple[float, float] = (0.4, 0.1)
    also_isolate_s: float = 0.5
    clear_ratio: float = 0.5
    clear_s: float = 20.0


@dataclass(frozen=True)
class FdiDesign:
    """Sampled observer and isolation filter of one operating point.

    Attributes
    ----------
    a, b, c : ndarray, shapes (n, n), (n, 6), (3, n)
        Observer: inputs [compressor speed, valve, air inlet temperature, p_e, SH, T_w] in deviations; `f_e = C xi - y`.
        A row of zeros in c: this sensor is not used, and its f_e is zero.
    h_a, h_b, h_c, h_d : ndarray, shapes (m, m), (m, 3), (2, m), (2, 3)
        Isolation filter from f_e to [f_N rad/s, f_p Pa].
    input_rest : ndarray, shape (3,)
        Compressor speed [rad/s], valve opening [0..1] and air inlet temperature [degC] at the operating point.
    output_rest : ndarray, shape (3,)
        Evaporator pressure [Pa], superheat [K], wall temperature [degC] there.
    thresholds : ndarray, shape (2,)
        Detection thresholds of the residuals [rad/s, Pa].
    sample_time_s : float
    """

    a: Vector
    b: Vector
    c: Vector
    h_a: Vector
    h_b: Vector
    h_c: Vector
    h_d: Vector
    input_rest: Vector
    output_rest: Vector
    thresholds: Vector
    sample_time_s: float
    supervision: Supervision = field(default_factory=Supervision)

    @classmethod
    def from_arrays(cls, arrays: Arrays) -> "FdiDesign":
        """Design from the arrays that the cache stores."""
        names = ("a", "b", "c", "h_a", "h_b", "h_c", "h_d", "input_rest", "output_rest", "thresholds")
        matrices = {name: np.ascontiguousarray(arrays[name]) for name in names}
        return cls(sample_time_s=float(arrays["sample_time_s"]), supervision=Supervision(), **matrices)

    def try_out(self) -> None:
        """Work for one tick: matrices that do not fit show here, not when the loop runs."""
        measured = np.array([2.5e5, 20.0, 15.0])
        detector = FaultDetector(self)
        detector.observe(0.0, measured, 30.0)
        detector.commanded(np.array([100.0, 0.4]))
        detector.observe(self.sample_time_s, measured, 30.0)


class Detection(NamedTuple):
    """What the detector says at one tick.

    Attributes
    ----------
    innovation : ndarray, shape (3,)
        f_e [Pa, K, K].
    residual : ndarray, shape (2,)
        Estimates of f_N [rad/s] and f_p [Pa].
    thresholds : ndarray, shape (2,)
        The residuals' detection thresholds, same units.
    detected : bool
    isolated : str or None
        "compressor_speed" or "evaporator_pressure"; of two, the one that was isolated last.
    size : float
        Estimate of the isolated fault [rad/s or Pa]; nan when none is isolated.
    onset_s : float
        When the residual first left its threshold [s]; nan when nothing is detected.
    isolated_s : float
        When the fault was isolated [s]; nan when none is.
    also_isolated : str or None
        The fault that was isolated before, when it is still there.
    """

    innovation: Vector
    residual: Vector
    thresholds: Vector
    detected: bool
    isolated: str | None
    size: float
    onset_s: float
    isolated_s: float
    also_isolated: str | None = None


class _Isolated(NamedTuple):
    """A fault that is isolated: its index in `FAULTS`, since when it is there, when it was isolated."""

    fault: int
    onset_s: float
    isolated_s: float


_DECISION = ("_above_since", "_leads_since", "_own_since", "_below_since", "_onset_s", "_detected_s", "_under_way")
_INPUT_SIZES = np.array([4.0, 0.01, 1.0, 1000.0, 1.0, 0.5])
"""By how much the observer's inputs may be off in a run under way: rad/s, 0..1, K, Pa, K, K."""


class FaultDetector:
    """State of the observer, the isolation filter and the decision.

    Observer and filter are two matrix products a tick on one vector `[xi, u, T_ea, y, eta]`:

        [f_e; r; eta+] = M [xi, u, T_ea, y, eta]     (`observe`)
        xi+            = N [xi, u, T_ea, y]          (`commanded`)
    """

    def __init__(self, design: FdiDesign) -> None:
        self.design = design
        n, m = len(design.a), len(design.h_a)
        self._in = np.zeros(n + 6 + m)
        self._observer, self._known, self._filter = self._in[:n], self._in[: n + 6], self._in[n + 6 :]
        self._command, self._deviation = self._in[n : n + 2], self._in[n + 3 : n + 6]
        self._air = n + 2
        self._used = np.diag(design.c.any(axis=1).astype(np.float64))  # of the sensors
        to_innovation = np.hstack([design.c, np.zeros((3, 3)), -self._used])  # of [xi, u, T_ea, y]
        through = np.vstack([np.eye(3), design.h_d, design.h_b])
        own = np.vstack([np.zeros((3, m)), design.h_c, design.h_a])
        self._observe = np.ascontiguousarray(np.hstack([through @ to_innovation, own]))
        self._advance = np.ascontiguousarray(np.hstack([design.a, design.b]))
        self._seen, self._next = np.zeros(5 + m), np.zeros(n)
        self._shown, self._filter_next = self._seen[:5], self._seen[5:]
        self._output_rest = design.output_rest
        self._command_rest, self._air_rest = design.input_rest[:2], float(design.input_rest[2])
        self._rules = design.supervision
        self._thresholds: list[float] = design.thresholds.tolist()
        self._above_since = [NOT, NOT]
        self._leads_since = [NOT, NOT]
        self._own_since = [NOT, NOT]  # more than the other fault's cross-talk
        self._below_since = [NOT, NOT]
        self._onset_s = NOT
        self._detected_s = NOT
        self._under_way = [False, False]  # which residuals the detection is about
        self._isolated: list[_Isolated] = []

    def state(self) -> dict[str, Any]:
        """Return what a detector that takes this one's place needs, fit for JSON (nan included); between two ticks."""
        return {
            "_in": self._in.tolist(),
            **{name: getattr(self, name) for name in _DECISION},
            "_isolated": [[one.fault, one.onset_s, one.isolated_s] for one in self._isolated],
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take the place of the detector whose `state` this is.

        Raises
        ------
        ValueError
            When it is none of a detector of this design.
        """
        try:
            signals = same_shape(state["_in"], self._in)
            decision = {name: state[name] for name in _DECISION}
            isolated = [_Isolated(*one) for one in state["_isolated"]]
        except (KeyError, TypeError, ValueError) as problem:
            msg = f"not the state of such a detector: {type(problem).__name__} {problem}"
            raise ValueError(msg) from None
        self._in[:], self._isolated = signals, isolated
        vars(self).update(decision)

    def warm_restart(
        self, measured: Vector, air_inlet_temperature_c: float, command: Vector, missed_ticks: int | None = None
    ) -> None:
        """Go over ticks that were missed, as if all signals had moved from the last ones to these in straight lines.

        Call it before `observe`, with that tick's measurements and the command before. The decision stands still.

        When it is not known what was before, it begins with no innovation: of the states that explain the measurements
        it takes the one nearest to rest, by the covariance that the observer's inputs give them. So a transient is not
        taken for a fault, and a fault looks as if it began now.

        Parameters
        ----------
        measured : ndarray, shape (3,)
            Evaporator pressure [Pa], superheat [K], wall temperature [degC].
        air_inlet_temperature_c : float
        command : ndarray, shape (2,)
            Compressor speed [rad/s], valve opening [0..1].
        missed_ticks : int, optional
            How many; None: what was before is not known.
        """
        if missed_ticks is None:
            self._begin_from_rest(measured, air_inlet_temperature_c, command)
            return
        design = self.design
        n = len(design.a)
        start, end = self._in[n : n + 6].copy(), self._now(measured, air_inlet_temperature_c, command)
        for tick in range(1, missed_ticks + 1):
            inputs = start + (end - start) * (tick / (missed_ticks + 1))
            innovation = design.c @ self._observer - self._used @ inputs[3:]
            self._filter[:] = design.h_a @ self._filter + design.h_b @ innovation
            self._observer[:] = design.a @ self._observer + design.b @ inputs

    def _begin_from_rest(self, measured: Vector, air_inlet_temperature_c: float, command: Vector) -> None:
        design = self.design
        inputs = self._now(measured, air_inlet_temperature_c, command)
        rest = np.linalg.solve(np.eye(len(design.a)) - design.a, design.b @ inputs)
        driven = design.b * _INPUT_SIZES
        covariance = _covariance(design.a, driven @ driven.T)
        towards, unexplained = covariance @ design.c.T, self._used @ inputs[3:] - design.c @ rest
        # Least squares: a sensor that is not used explains nothing, nor do two that see the same.
        self._observer[:] = rest + towards @ np.linalg.lstsq(design.c @ towards, unexplained, rcond=None)[0]
        self._filter[:] = 0.0

    def _now(self, measured: Vector, air_inlet_temperature_c: float, command: Vector) -> Vector:
        """The observer's inputs, in deviations."""
        actual = np.concatenate([command, [air_inlet_temperature_c], measured])
        now: Vector = actual - np.concatenate([self.design.input_rest, self.design.output_rest])
        return now

    def observe(self, time_s: float, measured: Vector, air_inlet_temperature_c: float) -> Detection:
        """Innovation, residual and decision of this tick.

        Parameters
        ----------
        time_s : float
            Time of the tick.
        measured : ndarray, shape (3,)
            Evaporator pressure [Pa], superheat [K], wall temperature [degC].
        air_inlet_temperature_c : float

        Returns
        -------
        Detection
        """
        np.subtract(measured, self._output_rest, out=self._deviation)
        self._in[self._air] = air_inlet_temperature_c - self._air_rest
        np.dot(self._observe, self._in, out=self._seen)
        self._filter[:] = self._filter_next
        seen = self._shown.copy()  # what is handed out stays as it is
        residual = seen[3:]
        speed, pressure = residual.tolist()
        first, second = self._thresholds
        self._decide(time_s, abs(speed) / first, abs(pressure) / second)
        if not self._isolated:
            detected = self._onset_s != NOT
            onset_s = self._onset_s if detected else math.nan
            return Detection(
                seen[:3], residual, self.design.thresholds, detected, None, math.nan, onset_s, math.nan, None
            )
        last = self._isolated[-1]
        also = FAULTS[self._isolated[0].fault] if len(self._isolated) > 1 else None
        size = pressure if last.fault else speed
        return Detection(
            seen[:3],
            residual,
            self.design.thresholds,
            True,
            FAULTS[last.fault],
            size,
            last.onset_s,
            last.isolated_s,
            also,
        )

    def commanded(self, command: Vector) -> None:
        """Close the tick with the command [rad/s, 0..1] that the controller has sent.

        Must be called once after each `observe`: the observer moves on to the next tick here.
        """
        np.subtract(command, self._command_rest, out=self._command)
        np.dot(self._advance, self._known, out=self._next)
        self._observer[:] = self._next

    def _decide(self, time_s: float, *ratios: float) -> None:
        """One step of the state machine on `ratios = |r_i| / threshold_i`."""
        rules = self._rules
        above, below = self._above_since, self._below_since
        for i in (0, 1):
            ratio, other = ratios[i], ratios[1 - i]
            if ratio > 1.0:
                above[i] = min(above[i], time_s)
                self._leads_since[i] = _since(self._leads_since[i], ratio > rules.lead * other, time_s)
                self._own_since[i] = _since(self._own_since[i], ratio > rules.cross_talk[i] * other, time_s)
            elif above[i] != NOT:
                above[i] = self._leads_since[i] = self._own_since[i] = NOT
            if ratio >= rules.clear_ratio:
                below[i] = NOT
            elif below[i] == NOT:
                below[i] = time_s
            if time_s - above[i] >= rules.confirm_s:
                self._under_way[i] = True
        if self._onset_s == NOT:
            if self._under_way[0] or self._under_way[1]:
                self._begin(time_s)
            return
        self._isolate(time_s)
        over = (time_s - below[0] >= rules.clear_s, time_s - below[1] >= rules.clear_s)
        if over[0] or over[1]:
            self._end(over, time_s)

    def _begin(self, time_s: float) -> None:
        """A detection begins, with the first of the residuals that it is about."""
        self._onset_s = min(since for since, holds in zip(self._above_since, self._under_way, strict=True) if holds)
        self._detected_s = time_s

    def _end(self, over: tuple[bool, bool], time_s: float) -> None:
        """Forget what is over; what then is left without an isolated fault is a detection of its own."""
        left = [known for known in self._isolated if not over[known.fault]]
        is_last = bool(self._isolated) and not left
        self._isolated = left
        self._under_way = [holds and not ends for holds, ends in zip(self._under_way, over, strict=True)]
        if is_last:
            self._under_way = [time_s - since >= self._rules.confirm_s for since in self._above_since]
        if not any(self._under_way):
            self._onset_s = NOT
        elif is_last:
            self._begin(time_s)

    def _isolate(self, time_s: float) -> None:
        """Add to the isolated faults those whose residuals now say so."""
        if len(self._isolated) == len(FAULTS):
            return
        rules = self._rules
        since, hold_s = self._own_since, rules.also_isolate_s
        if not self._isolated and time_s - self._detected_s < rules.undecided_s:
            since, hold_s = self._leads_since, rules.isolate_s
        known = [one.fault for one in self._isolated]
        for i in (0, 1):
            if i not in known and time_s - since[i] >= hold_s:
                onset_s = self._onset_s if not self._isolated else self._above_since[i]
                self._isolated.append(_Isolated(i, onset_s, time_s))
                self._under_way[i] = True


def _since(since: float, holds: bool, time_s: float) -> float:
    """Time since when a condition holds without a break; `NOT` while it does not."""
    return min(since, time_s) if holds else NOT


def _covariance(A: Vector, W: Vector) -> Vector:
    """Solution of `P = A P A' + W`; SciPy has one, but takes longer to load than this takes for a dozen states."""
    n = len(A)
    P: Vector = np.linalg.solve(np.eye(n * n) - np.kron(A, A), W.ravel()).reshape(n, n)
    return P
