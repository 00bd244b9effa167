"""What became of a run, in the words of the field, and how near its decision came to another one.

The words are those of Yuill and Braun, HVAC&R Research 19 (2013) 871: a run with or without a fault is told right
("correct"), or by a false alarm, a missed detection, a misdiagnosis, or no response.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ac_common.faults import BY_KIND, ISOLABLE_KINDS, UNKNOWN
from ac_common.topics import residual_of
from ac_experiments.recording import Recording

CORRECT, NO_RESPONSE, FALSE_ALARM, MISSED, MISDIAGNOSED = (
    "correct",
    "no response",
    "false alarm",
    "missed",
    "misdiagnosed",
)
#: From best to worst: a run with several faults is what came of the worst told.
OUTCOMES = (CORRECT, NO_RESPONSE, MISSED, MISDIAGNOSED, FALSE_ALARM)
MEANINGS = {
    CORRECT: "no fault and no alarm, or the fault named right first",
    NO_RESPONSE: "detected and never named, or the run could not go on",
    MISSED: "a fault, and no alarm",
    MISDIAGNOSED: "another fault named first",
    FALSE_ALARM: "an alarm while no fault was there",
}


def right_name(kind: str) -> str:
    """Return what a fault is to be isolated as."""
    return kind if BY_KIND[kind].has_filter else UNKNOWN


def outcome(faults: Sequence[Mapping[str, Any]], alarms_before: int, problem: str) -> str:
    """Return what became of a run.

    Parameters
    ----------
    faults
        As in `summary.json`.
    alarms_before
        Detections that began while no fault was there.
    problem
        Why the run could not go on; empty: it did.
    """
    if problem:
        return NO_RESPONSE
    if alarms_before:
        return FALSE_ALARM
    return max((_of_fault(fault) for fault in faults), key=OUTCOMES.index, default=CORRECT)


def _of_fault(fault: Mapping[str, Any]) -> str:
    named = fault["isolated_as"]
    if named is None:
        return MISSED if fault["detected_s"] is None else NO_RESPONSE
    return CORRECT if named == right_name(fault["kind"]) else MISDIAGNOSED


def alarms_before(recording: Recording, onset_s: float) -> int:
    """Count the detections that begin before the first fault; `onset_s` is infinite without one."""
    count, detected = 0, False
    for row in recording.status:
        if row.time_s >= onset_s:
            break
        count += row.detected and not detected
        detected = row.detected
    return count


def decision_ratios(recording: Recording) -> NDArray[np.float64]:
    """Return each residual's magnitude over its threshold, (ticks, faults with a filter)."""
    residuals = np.column_stack([recording.series[residual_of(kind)] for kind in ISOLABLE_KINDS])
    thresholds = np.array([row.thresholds for row in recording.status])
    return np.asarray(np.abs(residuals) / thresholds)


def peak_held(ratios: NDArray[np.float64], hold_s: float, sample_time_s: float) -> float:
    """Return the largest ratio that one residual has exceeded without a break for `hold_s`.

    With thresholds of `scale` times theirs, a decision that asks for `hold_s` detects a fault if and only if this is
    above `scale`: so the runs of one study give the whole receiver operating characteristic. nan: the run was shorter.

    Parameters
    ----------
    ratios : ndarray, shape (ticks, residuals)
    hold_s, sample_time_s : float
    """
    ticks = math.ceil(hold_s / sample_time_s - 1e-9) + 1
    if len(ratios) < ticks:
        return math.nan
    windows = np.lib.stride_tricks.sliding_window_view(ratios, ticks, axis=0)
    return float(windows.min(axis=-1).max())


def peaks(recording: Recording, onset_s: float, hold_s: float) -> tuple[float, float]:
    """Return `peak_held` before the first fault and from then on; nan where there is no such time."""
    ratios, sample_time_s = decision_ratios(recording), float(recording.metadata["sample_time_s"])
    first = int(np.searchsorted(recording.time_s, onset_s))
    return peak_held(ratios[:first], hold_s, sample_time_s), peak_held(ratios[first:], hold_s, sample_time_s)
