"""Probability of detection over size from hits and misses, as MIL-HDBK-1823A (2009), appendix G, has it.

The probability is a logistic function of the logarithm of the size, fitted by maximum likelihood. The size found in
90 % of the cases at 95 % confidence, a90/95, is the largest for which the likelihood ratio test does not refuse, at 5 %
on that side, that it is a90.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats
from scipy.special import expit, logit

Vector = NDArray[np.float64]
FOUND, CONFIDENCE = 0.90, 0.95
#: Fewer cases than this give no curve: the handbook asks for 60.
FEWEST = 10
#: A bound farther from its estimate than this (in logarithms of size) is none.
_FARTHEST = math.log(1e4)


@dataclass(frozen=True)
class Pod:
    """A fitted probability of detection.

    Attributes
    ----------
    intercept, slope : float
        Of the logit over the logarithm of size.
    cases, hits : int
    largest_missed, smallest_found : float
    """

    intercept: float
    slope: float
    cases: int
    hits: int
    largest_missed: float
    smallest_found: float
    _x: Vector = field(repr=False)
    _hit: Vector = field(repr=False)

    def probability(self, size: Vector) -> Vector:
        """Return the probability that faults of these sizes are found."""
        return np.asarray(expit(self.intercept + self.slope * np.log(size)))

    def size(self, found: float = FOUND) -> float:
        """Return the size that is found with this probability."""
        return math.exp((float(logit(found)) - self.intercept) / self.slope)

    def size_at(self, found: float = FOUND, confidence: float = CONFIDENCE, upper: bool = True) -> float:
        """Return the bound of `size(found)` at this one-sided confidence; inf (or 0) when the data give none.

        It is the size farthest from the estimate for which the constrained maximum of the likelihood is within the
        quantile of chi-square with one degree of freedom of the free one.
        """
        at_most = float(stats.chi2.ppf(2.0 * confidence - 1.0, 1))
        free, here = _log_likelihood(self.intercept, self.slope, self._x, self._hit), math.log(self.size(found))

        def beyond(log_size: float) -> float:
            return 2.0 * (free - _constrained(log_size, float(logit(found)), self._x, self._hit)) - at_most

        sign, step, inside = (1.0 if upper else -1.0), 0.05, here
        while step < _FARTHEST:
            outside = here + sign * step
            if beyond(outside) > 0.0:
                bound = float(optimize.brentq(beyond, *sorted((inside, outside)), xtol=1e-9))
                return math.exp(bound)
            inside, step = outside, 1.6 * step
        return math.inf if upper else 0.0


def _log_likelihood(intercept: float, slope: float, x: Vector, hit: Vector) -> float:
    t = intercept + slope * x
    return float(np.sum(hit * t - np.logaddexp(0.0, t)))


def _constrained(log_size: float, target: float, x: Vector, hit: Vector) -> float:
    """Return the largest log-likelihood of curves that pass through (log_size, target in logits).

    It is concave in the slope, so a zero of its derivative is the maximum; a slope is not negative.
    """
    away = x - log_size

    def derivative(slope: float) -> float:
        return float(np.sum(away * (hit - expit(target + slope * away))))

    high = 1.0
    while derivative(high) > 0.0 and high < 1e6:
        high *= 2.0
    slope = 0.0
    if derivative(0.0) > 0.0:
        slope = float(optimize.brentq(derivative, 0.0, high, xtol=1e-10)) if derivative(high) < 0.0 else high
    return _log_likelihood(target - slope * log_size, slope, x, hit)


def fit_pod(size: Vector, hit: NDArray[np.bool_]) -> Pod | None:
    """Return the probability of detection fitted to hits and misses.

    Parameters
    ----------
    size : ndarray, shape (n,)
        Magnitudes, above 0.
    hit : ndarray of bool, shape (n,)

    Returns
    -------
    Pod or None
        None when the data have no curve: fewer than `FEWEST` cases, no hit or no miss, hits and misses that do not
        overlap (then every steep curve between them is as good), larger faults that are found less often, or a curve
        that reaches 90 % outside the sizes that there were only: the handbook allows no extrapolation.
    """
    size, hits = np.asarray(size, dtype=np.float64), np.asarray(hit, dtype=np.float64)
    found, missed = size[hits > 0.5], size[hits <= 0.5]
    if len(size) < FEWEST or not len(found) or not len(missed) or found.min() >= missed.max():
        return None
    x = np.log(size)
    middle, width = float(x.mean()), float(x.std()) or 1.0
    u = (x - middle) / width

    def cost(beta: Vector) -> tuple[float, Vector]:
        t = beta[0] + beta[1] * u
        error = expit(t) - hits
        return float(np.sum(np.logaddexp(0.0, t) - hits * t)), np.array([error.sum(), (error * u).sum()])

    beta = optimize.minimize(cost, np.zeros(2), jac=True, method="BFGS", options={"gtol": 1e-9}).x
    slope = float(beta[1]) / width
    if not 0.0 < slope < 1e4:
        return None
    intercept = float(beta[0]) - slope * middle
    fitted = Pod(intercept, slope, len(size), len(found), float(missed.max()), float(found.min()), x, hits)
    return fitted if x.min() <= (float(logit(FOUND)) - intercept) / slope <= x.max() else None
