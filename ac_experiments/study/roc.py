"""Receiver operating characteristic over a scale on the thresholds, from the peaks of the decision's statistic."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ac_experiments.study.intervals import CONFIDENCE, Interval

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Roc:
    """A curve from (1, 1) to (0, 0).

    Attributes
    ----------
    scale : ndarray, shape (k,)
        Of the thresholds, rising.
    false_alarms, detections : ndarray, shape (k,)
        Share of the fault-free stretches in which a fault would be detected, and of the faults that would be.
    area : Interval
        Under the curve: how likely a faulty stretch has the larger peak, ties counting half.
    """

    scale: Vector
    false_alarms: Vector
    detections: Vector
    area: Interval


def roc(fault_free: Vector, faulty: Vector, confidence: float = CONFIDENCE) -> Roc | None:
    """Return the characteristic of a detector that decides for a fault when a peak is above the scale.

    The interval of the area is that of DeLong, DeLong and Clarke-Pearson (Biometrics 44, 1988, 837).

    Parameters
    ----------
    fault_free, faulty : ndarray
        Peaks; nan ones are left out.
    confidence : float

    Returns
    -------
    Roc or None
        None when either has no value.
    """
    quiet, loud = (np.sort(values[~np.isnan(values)]) for values in (fault_free, faulty))
    if not len(quiet) or not len(loud):
        return None
    scale = np.unique(np.concatenate([[0.0], quiet, loud]))
    return Roc(scale, _above(quiet, scale), _above(loud, scale), _area(quiet, loud, confidence))


def _above(ordered: Vector, scale: Vector) -> Vector:
    return np.asarray(1.0 - np.searchsorted(ordered, scale, side="right") / len(ordered))


def _area(quiet: Vector, loud: Vector, confidence: float) -> Interval:
    below = 0.5 * (np.searchsorted(quiet, loud, "left") + np.searchsorted(quiet, loud, "right")) / len(quiet)
    beyond = 1.0 - 0.5 * (np.searchsorted(loud, quiet, "left") + np.searchsorted(loud, quiet, "right")) / len(loud)
    value = float(below.mean())
    if min(len(quiet), len(loud)) < 2:
        return Interval(value, 0.0, 1.0)
    deviation = math.sqrt(float(below.var(ddof=1)) / len(loud) + float(beyond.var(ddof=1)) / len(quiet))
    half = float(stats.norm.ppf(0.5 * (1.0 + confidence))) * deviation
    return Interval(value, max(value - half, 0.0), min(value + half, 1.0))
