"""Two studies side by side: differences with intervals, pairwise where both have played the same case."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ac_experiments.study import intervals
from ac_experiments.study.intervals import Interval
from ac_experiments.study.outcomes import CORRECT, FALSE_ALARM, MISDIAGNOSED, MISSED
from ac_experiments.study.results import CONTROL
from ac_experiments.study.schema import NO_FAULT
from ac_experiments.study.summary import Runs, false_alarms

_FIGURES = ("detection_delay_s", "isolation_delay_s", "peak_fault_free", "peak_faulty", *CONTROL)


@dataclass(frozen=True)
class Difference:
    """One figure of two studies.

    Attributes
    ----------
    what : str
    first, second : float
    difference : Interval
        Second minus first.
    paired : int
        Pairs that it is from; 0: the runs of both are independent.
    ratio : tuple of float or None
        Second over first, pair by pair: mean and largest. None where there are no pairs, or no positive figures.
    """

    what: str
    first: float
    second: float
    difference: Interval
    paired: int
    ratio: tuple[float, float] | None = None


def pairs_of(first: Runs, second: Runs) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Return the places of runs that are the same case in both: of one number, with the same drive, fault and draws."""
    if first.study.seed != second.study.seed:
        return np.empty(0, dtype=int), np.empty(0, dtype=int)
    common = [name for name in first.columns if name.startswith("drawn.") and name in second.columns]
    keys = ("run", "drive", "fault_kind", "fault_size", "fault_onset_s", *common)
    there = {key: place for place, key in enumerate(_keys(second, keys))}
    found = [(place, there[key]) for place, key in enumerate(_keys(first, keys)) if key in there]
    one, two = zip(*found, strict=True) if found else ((), ())
    return np.array(one, dtype=int), np.array(two, dtype=int)


def _keys(runs: Runs, names: tuple[str, ...]) -> list[tuple[object, ...]]:
    columns = [
        [None if isinstance(value, float) and np.isnan(value) else value for value in runs[name].tolist()]
        for name in names
    ]
    return list(zip(*columns, strict=True))


def compare(first: Runs, second: Runs) -> list[Difference]:
    """Return the differences of outcomes, false alarms and figures, those of each row with its interval at 95 %."""
    one, two = pairs_of(first, second)
    is_paired = len(one) == len(first) == len(second)
    rows = [_alarms(first, second)]
    has_fault: Callable[[Runs], NDArray[np.bool_]] = lambda runs: runs["fault_kind"] != NO_FAULT  # noqa: E731
    for outcome, of in ((CORRECT, None), (FALSE_ALARM, None), (MISSED, has_fault), (MISDIAGNOSED, has_fault)):
        good = [runs["outcome"] == outcome for runs in (first, second)]
        among = [np.full(len(runs), True) if of is None else of(runs) for runs in (first, second)]
        if not all(one.any() for one in among):
            continue  # no fault in one of them, so nothing to miss
        rows.append(_shares(outcome, good, among, (one, two) if is_paired else None))
    for name in _FIGURES:
        if name not in first.columns or name not in second.columns:
            continue
        row = _means(name, first[name], second[name], (one, two) if is_paired else None)
        if row is not None:
            rows.append(row)
    return rows


def _alarms(first: Runs, second: Runs) -> Difference:
    """Return false alarms per hour, and their difference: the exact intervals put together as Newcombe does."""
    rates = [false_alarms(runs)["per_hour"] for runs in (first, second)]
    value = rates[1].value - rates[0].value
    below = float(np.hypot(rates[1].value - rates[1].low, rates[0].high - rates[0].value))
    above = float(np.hypot(rates[1].high - rates[1].value, rates[0].value - rates[0].low))
    return Difference(
        "false alarms per hour", rates[0].value, rates[1].value, Interval(value, value - below, value + above), 0
    )


_Pairs = tuple[NDArray[np.int_], NDArray[np.int_]] | None


def _shares(name: str, good: list[NDArray[np.bool_]], among: list[NDArray[np.bool_]], pairs: _Pairs) -> Difference:
    counts = [(int((g & a).sum()), int(a.sum())) for g, a in zip(good, among, strict=True)]
    first, second = (count / of if of else np.nan for count, of in counts)
    what = f"{name}, share"
    if pairs is None:
        return Difference(what, first, second, intervals.difference_of_shares(counts[0], counts[1]), 0)
    a, b, chosen = good[0][pairs[0]], good[1][pairs[1]], among[0][pairs[0]]
    only_first, only_second = int((a & ~b & chosen).sum()), int((b & ~a & chosen).sum())
    number = int(chosen.sum())
    return Difference(what, first, second, intervals.difference_of_pairs(only_first, only_second, number), number)


def _means(name: str, first: NDArray[np.float64], second: NDArray[np.float64], pairs: _Pairs) -> Difference | None:
    if pairs is not None:
        a, b = first[pairs[0]], second[pairs[1]]
        known = np.isfinite(a) & np.isfinite(b)
        if known.sum() < 2:
            return None
        a, b = a[known], b[known]
        ratio = (float((b / a).mean()), float((b / a).max())) if (a > 0.0).all() else None
        return Difference(name, float(a.mean()), float(b.mean()), intervals.mean(b - a), int(known.sum()), ratio)
    a, b = first[np.isfinite(first)], second[np.isfinite(second)]
    if min(len(a), len(b)) < 2:
        return None
    return Difference(name, float(a.mean()), float(b.mean()), intervals.difference_of_means(a, b), 0)
