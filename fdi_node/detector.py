"""Fault detection at run time: innovation, residual, and the decision which fault is there.

The observer and the isolation filter are linear and run in deviations from the operating point:

    f_e = N~ u - M~ y   (M~ = (A+LC, L, C, I), N~ = (A+LC, B+LD, C, D); u with the measured air inlet temperature)
    r   = H f_e         (low-passed estimates of f_N and f_p)

The decision is a small state machine on `|r_i| / threshold_i`: a fault is isolated when its residual leads, and the
other one, too, when its residual is then more than the first fault could make it.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bringup.topics import FAULTS
from fdi_node.cache import Arrays

Vector = NDArray[np.float64]


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


@dataclass(frozen=True)
class Detection:
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


@dataclass(frozen=True)
class _Isolated:
    """A fault that is isolated: its index in `FAULTS`, since when it is there, when it was isolated."""

    fault: int
    onset_s: float
    isolated_s: float


class FaultDetector:
    """State of the observer, the isolation filter and the decision."""

    def __init__(self, design: FdiDesign) -> None:
        self.design = design
        self._observer = np.zeros(len(design.a))
        self._filter = np.zeros(len(design.h_a))
        self._inputs = np.zeros(6)
        self._above_since = [math.nan, math.nan]
        self._leads_since = [math.nan, math.nan]
        self._own_since = [math.nan, math.nan]  # more than the other fault's cross-talk
        self._below_since = [math.nan, math.nan]
        self._onset_s = math.nan
        self._detected_s = math.nan
        self._isolated: list[_Isolated] = []

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
        design = self.design
        deviation = measured - design.output_rest
        innovation: Vector = design.c @ self._observer - deviation
        residual: Vector = design.h_c @ self._filter + design.h_d @ innovation
        self._filter = design.h_a @ self._filter + design.h_b @ innovation
        self._inputs[2] = air_inlet_temperature_c - design.input_rest[2]
        self._inputs[3:] = deviation
        self._decide(time_s, [abs(float(r)) / float(t) for r, t in zip(residual, design.thresholds, strict=True)])
        last = self._isolated[-1] if self._isolated else None
        return Detection(
            innovation=innovation,
            residual=residual,
            thresholds=design.thresholds,
            detected=not math.isnan(self._onset_s),
            isolated=None if last is None else FAULTS[last.fault],
            size=math.nan if last is None else float(residual[last.fault]),
            onset_s=self._onset_s if last is None else last.onset_s,
            isolated_s=math.nan if last is None else last.isolated_s,
            also_isolated=FAULTS[self._isolated[0].fault] if len(self._isolated) > 1 else None,
        )

    def commanded(self, command: Vector) -> None:
        """Close the tick with the command [rad/s, 0..1] that the controller has sent.

        Must be called once after each `observe`: the observer moves on to the next tick here.
        """
        design = self.design
        self._inputs[:2] = command - design.input_rest[:2]
        self._observer = design.a @ self._observer + design.b @ self._inputs

    def _decide(self, time_s: float, ratios: list[float]) -> None:
        """One step of the state machine on `ratios = |r_i| / threshold_i`."""
        rules = self.design.supervision
        for i, ratio in enumerate(ratios):
            other = ratios[1 - i]
            self._above_since[i] = _since(self._above_since[i], ratio > 1.0, time_s)
            self._leads_since[i] = _since(self._leads_since[i], ratio > max(1.0, rules.lead * other), time_s)
            self._own_since[i] = _since(self._own_since[i], ratio > max(1.0, rules.cross_talk[i] * other), time_s)
            self._below_since[i] = _since(self._below_since[i], ratio < rules.clear_ratio, time_s)
        if math.isnan(self._onset_s):
            onsets = [since for since in self._above_since if time_s - since >= rules.confirm_s]
            self._onset_s = min(onsets, default=math.nan)
            self._detected_s = time_s
            return
        self._isolate(time_s)
        over = [time_s - since >= rules.clear_s for since in self._below_since]
        self._isolated = [known for known in self._isolated if not over[known.fault]]
        if all(over):
            self._onset_s = math.nan

    def _isolate(self, time_s: float) -> None:
        """Add to the isolated faults those whose residuals now say so."""
        rules = self.design.supervision
        since, hold_s = self._own_since, rules.also_isolate_s
        if not self._isolated and time_s - self._detected_s < rules.undecided_s:
            since, hold_s = self._leads_since, rules.isolate_s
        known = [one.fault for one in self._isolated]
        for i in (0, 1):
            if i not in known and time_s - since[i] >= hold_s:
                onset_s = self._onset_s if not self._isolated else self._above_since[i]
                self._isolated.append(_Isolated(i, onset_s, time_s))


def _since(since: float, holds: bool, time_s: float) -> float:
    """Time since when a condition holds without a break; nan while it does not."""
    if not holds:
        return math.nan
    return time_s if math.isnan(since) else since
