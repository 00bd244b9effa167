"""Intervals of what a study estimates: exact ones wherever there are."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

CONFIDENCE = 0.95
Values = NDArray[np.float64] | Sequence[float]


class Interval(NamedTuple):
    """An estimate, and the confidence interval around it; nan where there is none."""

    value: float
    low: float
    high: float


def share(good: int, of: int, confidence: float = CONFIDENCE) -> Interval:
    """Return a share with the exact interval of Clopper and Pearson (Biometrika 26, 1934, 404)."""
    if of == 0:
        return Interval(math.nan, 0.0, 1.0)
    tail = 0.5 * (1.0 - confidence)
    low = float(stats.beta.ppf(tail, good, of - good + 1)) if good else 0.0
    high = float(stats.beta.ppf(1.0 - tail, good + 1, of - good)) if good < of else 1.0
    return Interval(good / of, low, high)


def rate(count: int, exposure: float, confidence: float = CONFIDENCE) -> Interval:
    """Return events over exposure with the exact interval of a Poisson count (Garwood, Biometrika 28, 1936, 437).

    Parameters
    ----------
    count : int
    exposure : float
        For instance hours; 0: nothing is known.
    confidence : float
        Of both sides together.
    """
    if not exposure > 0.0:
        return Interval(math.nan, 0.0, math.inf)
    tail = 0.5 * (1.0 - confidence)
    low = 0.5 * float(stats.chi2.ppf(tail, 2 * count)) if count else 0.0
    high = 0.5 * float(stats.chi2.ppf(1.0 - tail, 2 * count + 2))
    return Interval(count / exposure, low / exposure, high / exposure)


def quantile(values: Values, level: float, confidence: float = CONFIDENCE) -> Interval:
    """Return a quantile with an interval between order statistics, whatever the distribution.

    The estimate is the smallest value that so large a share of the values does not exceed. The number of values below
    the true quantile is binomial, so the ends are those of its quantiles (David and Nagaraja, Order Statistics, 7.1).
    An end that no value is far enough out for is infinite, and infinite values may be among the data: what never
    happened is later than everything that did.
    """
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    n = len(ordered)
    if n == 0:
        return Interval(math.nan, math.nan, math.nan)
    tail = 0.5 * (1.0 - confidence)
    count = stats.binom(n, level)
    low, high = int(count.ppf(tail)), int(count.ppf(1.0 - tail))  # P(count < low) <= tail, P(count > high) <= tail
    value = float(ordered[min(max(math.ceil(level * n - 1e-9), 1), n) - 1])
    lowest = float(ordered[low - 1]) if low >= 1 else -math.inf
    highest = float(ordered[high]) if high < n else math.inf
    return Interval(value, lowest, highest)


def mean(values: Values, confidence: float = CONFIDENCE) -> Interval:
    """Return a mean with Student's interval."""
    data = np.asarray(values, dtype=np.float64)
    if len(data) < 2:
        value = float(data[0]) if len(data) else math.nan
        return Interval(value, -math.inf, math.inf)
    half = float(stats.t.ppf(0.5 * (1.0 + confidence), len(data) - 1) * data.std(ddof=1)) / math.sqrt(len(data))
    return Interval(float(data.mean()), float(data.mean()) - half, float(data.mean()) + half)


def difference_of_means(first: Values, second: Values, confidence: float = CONFIDENCE) -> Interval:
    """Return the second mean minus the first, of independent values, with Welch's interval (Biometrika 1947, 28)."""
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    if min(len(a), len(b)) < 2:
        return Interval(float(b.mean() - a.mean()) if len(a) and len(b) else math.nan, -math.inf, math.inf)
    value = float(b.mean() - a.mean())
    errors = np.array([a.var(ddof=1) / len(a), b.var(ddof=1) / len(b)])
    total = float(errors.sum())
    if total == 0.0:
        return Interval(value, value, value)
    freedom = total**2 / float((errors**2 / np.array([len(a) - 1, len(b) - 1])).sum())
    half = float(stats.t.ppf(0.5 * (1.0 + confidence), freedom)) * math.sqrt(total)
    return Interval(value, value - half, value + half)


def difference_of_shares(first: tuple[int, int], second: tuple[int, int], confidence: float = CONFIDENCE) -> Interval:
    """Return the second share minus the first, of independent counts (good, of), with Newcombe's interval.

    Statistics in Medicine 17 (1998) 873, method 10: the intervals of Wilson put together.
    """
    (good_1, of_1), (good_2, of_2) = first, second
    if not (of_1 and of_2):
        return Interval(math.nan, -1.0, 1.0)
    one, two = _wilson(good_1, of_1, confidence), _wilson(good_2, of_2, confidence)
    value = two.value - one.value
    below = math.hypot(two.value - two.low, one.high - one.value)
    above = math.hypot(two.high - two.value, one.value - one.low)
    return Interval(value, value - below, value + above)


def _wilson(good: int, of: int, confidence: float) -> Interval:
    z = float(stats.norm.ppf(0.5 * (1.0 + confidence)))
    p, extra = good / of, z * z / of
    middle = (p + 0.5 * extra) / (1.0 + extra)
    half = z * math.sqrt(p * (1.0 - p) / of + 0.25 * extra / of) / (1.0 + extra)
    return Interval(p, middle - half, middle + half)


def difference_of_pairs(only_first: int, only_second: int, pairs: int, confidence: float = CONFIDENCE) -> Interval:
    """Return the second share minus the first where both judge the same cases, from the pairs that differ.

    The pairs in which only one of the two is good are binomial with a half if there is no difference (McNemar); the
    exact interval of that share, times the share of pairs that differ, is that of the difference given how many do.
    """
    differ = only_first + only_second
    if not pairs:
        return Interval(math.nan, -1.0, 1.0)
    _, low, high = share(only_second, differ, confidence)
    if not differ:
        return Interval(0.0, -rate(0, pairs, confidence).high, rate(0, pairs, confidence).high)
    return Interval(
        (only_second - only_first) / pairs, (2.0 * low - 1.0) * differ / pairs, (2.0 * high - 1.0) * differ / pairs
    )
