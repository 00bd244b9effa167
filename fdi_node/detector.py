"""Fault detection at run time: innovation, residual, and the decision which fault is there.

The observer and the isolation filter are linear and run in deviations from the operating point:

    f_e = N~ u - M~ y   (M~ = (A+LC, L, C, I), N~ = (A+LC, B+LD, C, D); u with the measured air inlet temperature)
    r   = H f_e         (low-passed estimates of f_N and f_p)

The decision is a small state machine for each fault on `|r_i| / threshold_i`.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fdi_node.cache import Arrays

Vector = NDArray[np.float64]

FAULTS = ("compressor_speed", "evaporator_pressure")
"""The faults that are told apart, in the order of the residuals."""


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
    clear_ratio : float
        A fault is over when its residual has been below this part of its threshold
    clear_s : float
        for this long.
    """

    confirm_s: float = 0.5
    isolate_s: float = 0.5
    lead: float = 1.5
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
        "compressor_speed" or "evaporator_pressure".
    size : float
        Estimate of the isolated fault [rad/s or Pa]; nan when none is isolated.
    onset_s : float
        When the residual first left its threshold [s]; nan when nothing is detected.
    isolated_s : float
        When the fault was isolated [s]; nan when none is.
    """

    innovation: Vector
    residual: Vector
    thresholds: Vector
    detected: bool
    isolated: str | None
    size: float
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
        self._below_since = math.nan
        self._onset_s = math.nan
        self._isolated: int | None = None
        self._isolated_s = math.nan

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
        i = self._isolated
        return Detection(
            innovation=innovation,
            residual=residual,
            thresholds=design.thresholds,
            detected=not math.isnan(self._onset_s),
            isolated=None if i is None else FAULTS[i],
            size=math.nan if i is None else float(residual[i]),
            onset_s=self._onset_s,
            isolated_s=self._isolated_s,
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
            self._above_since[i] = _since(self._above_since[i], ratio > 1.0, time_s)
            leading = ratio > 1.0 and ratio > rules.lead * ratios[1 - i]
            self._leads_since[i] = _since(self._leads_since[i], leading, time_s)
        if math.isnan(self._onset_s):
            onsets = [since for since in self._above_since if time_s - since >= rules.confirm_s]
            self._onset_s = min(onsets, default=math.nan)
        elif self._isolated is None:
            for i, since in enumerate(self._leads_since):
                if time_s - since >= rules.isolate_s:
                    self._isolated, self._isolated_s = i, time_s
        watched = max(ratios) if self._isolated is None else ratios[self._isolated]
        self._below_since = _since(self._below_since, watched < rules.clear_ratio, time_s)
        if time_s - self._below_since >= rules.clear_s:
            self._onset_s, self._isolated, self._isolated_s = math.nan, None, math.nan


def _since(since: float, holds: bool, time_s: float) -> float:
    """Time since when a condition holds without a break; nan while it does not."""
    if not holds:
        return math.nan
    return time_s if math.isnan(since) else since
