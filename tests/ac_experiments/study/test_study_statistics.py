"""Statistics of studies against closed forms: detectors whose rate, characteristic and probability are known."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from scipy.special import expit, logit

from ac_experiments.study import intervals
from ac_experiments.study.importance import rank_correlations, sobol_indices
from ac_experiments.study.outcomes import peak_held
from ac_experiments.study.pod import fit_pod
from ac_experiments.study.roc import roc
from ac_experiments.study.sampling import saltelli

# -------------------------------------------------------------------------------------------------------- intervals


@pytest.mark.parametrize(("count", "low", "high"), [(0, 0.0, 3.689), (1, 0.0253, 5.572), (10, 4.795, 18.39)])
def test_poisson_interval_is_the_published_one(count, low, high):
    """Garwood's table of 95 % limits."""
    found = intervals.rate(count, 2.0)
    assert found.value == count / 2.0
    assert (2.0 * found.low, 2.0 * found.high) == pytest.approx((low, high), rel=1e-3)


@given(st.integers(0, 60), st.floats(0.1, 1e4))
def test_poisson_interval_ends_where_the_count_becomes_unlikely(count, hours):
    found = intervals.rate(count, hours)
    assert stats.poisson(found.high * hours).cdf(count) == pytest.approx(0.025, rel=1e-6)
    if count:
        assert stats.poisson(found.low * hours).sf(count - 1) == pytest.approx(0.025, rel=1e-6)


@given(st.integers(0, 80), st.integers(1, 80))
def test_share_ends_where_the_count_becomes_unlikely(good, of):
    good = min(good, of)
    found = intervals.share(good, of)
    assert found.low <= found.value <= found.high
    if good < of:
        assert stats.binom(of, found.high).cdf(good) == pytest.approx(0.025, rel=1e-6)
    if good:
        assert stats.binom(of, found.low).sf(good - 1) == pytest.approx(0.025, rel=1e-6)


def covered(inside: list[bool]) -> float:
    return float(np.mean(inside))


def test_intervals_of_quantiles_cover_the_true_one():
    """At least as often as they say; by so little more as order statistics allow."""
    rng = np.random.default_rng(1)
    for level, n in ((0.5, 41), (0.95, 150)):
        truth = -math.log(1.0 - level)  # of an exponential variable
        inside = []
        for _ in range(1000):
            found = intervals.quantile(rng.exponential(size=n), level)
            inside.append(found.low <= truth <= found.high)
        assert 0.94 < covered(inside) < 0.99


def test_what_never_happened_is_later_than_all_that_did():
    delays = np.array([1.0] * 90 + [math.inf] * 10)
    assert intervals.quantile(delays, 0.5).value == 1.0
    assert intervals.quantile(delays, 0.95).value == math.inf
    assert intervals.quantile([1.0, 2.0, 3.0], 0.95).high == math.inf


def test_differences_cover_the_true_one():
    rng = np.random.default_rng(2)
    means, shares, pairs = [], [], []
    for _ in range(1500):
        a, b = rng.normal(0.0, 1.0, 12), rng.normal(0.5, 3.0, 20)
        low, high = intervals.difference_of_means(a, b)[1:]
        means.append(low <= 0.5 <= high)
        low, high = intervals.difference_of_shares((rng.binomial(60, 0.6), 60), (rng.binomial(50, 0.8), 50))[1:]
        shares.append(low <= 0.2 <= high)
        first, second = rng.binomial(1, 0.7, 80), rng.binomial(1, 0.7, 80)
        only = int((first > second).sum()), int((second > first).sum())
        low, high = intervals.difference_of_pairs(*only, 80)[1:]
        pairs.append(low <= 0.0 <= high)
    assert 0.93 < covered(means) < 0.97
    assert 0.93 < covered(shares) < 0.975
    assert covered(pairs) > 0.94  # exact, so at least


# -------------------------------------------------------------------------------------------------------------- ROC


def test_area_and_curve_of_two_normal_detectors():
    """Peaks N(0, 1) without and N(d, 1) with a fault: area Phi(d / sqrt 2), detections Phi(d - Phi^-1(1 - alarms))."""
    rng, d = np.random.default_rng(3), 1.5
    inside, worst = [], 0.0
    truth = stats.norm.cdf(d / math.sqrt(2.0))
    for _ in range(300):
        found = roc(10.0 + rng.normal(0.0, 1.0, 120), 10.0 + rng.normal(d, 1.0, 90))
        assert found is not None
        inside.append(found.area.low <= truth <= found.area.high)
        expected = stats.norm.cdf(d - stats.norm.ppf(1.0 - np.clip(found.false_alarms, 1e-9, 1 - 1e-9)))
        worst = max(worst, float(np.abs(found.detections - expected).mean()))
    assert 0.91 < covered(inside) < 0.98
    assert worst < 0.15
    large = roc(10.0 + rng.normal(0.0, 1.0, 100_000), 10.0 + rng.normal(d, 1.0, 100_000))
    assert large is not None
    assert large.area.value == pytest.approx(truth, abs=3e-3)


def test_area_is_that_under_the_curve_and_ties_count_half():
    quiet, loud = np.array([1.0, 2.0, 2.0, 4.0, np.nan]), np.array([2.0, 3.0, 5.0])
    found = roc(quiet, loud)
    assert found is not None
    assert found.area.value == pytest.approx(-np.trapezoid(found.detections, found.false_alarms))
    assert found.area.value == pytest.approx(np.mean([[(b > a) + 0.5 * (b == a) for a in quiet[:4]] for b in loud]))
    assert (found.false_alarms[0], found.detections[0]) == (1.0, 1.0)
    assert (found.false_alarms[-1], found.detections[-1]) == (0.0, 0.0)
    assert roc(np.array([np.nan]), loud) is None


@settings(max_examples=50)
@given(st.lists(st.floats(0.0, 3.0), min_size=8, max_size=60), st.floats(0.05, 2.9))
def test_a_scale_detects_if_and_only_if_the_held_peak_is_above_it(ratios, scale):
    """As the decision counts: above the threshold at each tick for half a second, which is six of them at 10 Hz."""
    run, longest = 0, 0
    for ratio in ratios:
        run = run + 1 if ratio > scale else 0
        longest = max(longest, run)
    peak = peak_held(np.array(ratios)[:, None], 0.5, 0.1)
    assert (longest >= 6) == (peak > scale)


# -------------------------------------------------------------------------------------------------------------- POD


A50, SLOPE = 3.0, 4.0


def draws(rng, cases):
    size = np.exp(rng.uniform(math.log(0.5), math.log(20.0), cases))
    return size, rng.random(cases) < expit(SLOPE * np.log(size / A50))


def test_probability_of_detection_is_found_again_and_its_bound_covers():
    """A detector that finds size a with the logit 4 ln(a / 3): a90 = 3 exp(logit 0.9 / 4); a90/95 above it in 95 %."""
    rng = np.random.default_rng(4)
    truth = A50 * math.exp(float(logit(0.9)) / SLOPE)
    above, estimates = [], []
    for _ in range(250):
        fitted = fit_pod(*draws(rng, 300))
        assert fitted is not None
        estimates.append(fitted.size())
        above.append(fitted.size_at() >= truth)
        assert fitted.size_at(upper=False) < fitted.size() < fitted.size_at()
    assert np.median(estimates) == pytest.approx(truth, rel=0.03)
    assert 0.91 < covered(above) < 0.985
    large = fit_pod(*draws(rng, 50_000))
    assert large is not None
    assert (large.slope, large.size(0.5)) == pytest.approx((SLOPE, A50), rel=0.03)


def test_the_fit_is_the_maximum_of_the_likelihood_and_the_bound_on_its_contour():
    size, hit = draws(np.random.default_rng(5), 80)
    fitted = fit_pod(size, hit)
    assert fitted is not None
    x = np.log(size)

    def likelihood(a, b):
        t = a + b * x
        return np.sum(hit * t - np.logaddexp(0.0, t))

    best = likelihood(fitted.intercept, fitted.slope)
    for da, db in ((1e-3, 0.0), (-1e-3, 0.0), (0.0, 1e-3), (0.0, -1e-3)):
        assert likelihood(fitted.intercept + da, fitted.slope + db) < best
    bound = math.log(fitted.size_at())
    slopes = np.linspace(0.01, 20.0, 4000)
    along = max(likelihood(float(logit(0.9)) - b * bound, b) for b in slopes)
    assert 2.0 * (best - along) == pytest.approx(stats.chi2.ppf(0.90, 1), abs=1e-3)


@pytest.mark.parametrize(
    ("sizes", "hits"),
    [
        (np.linspace(1, 9, 9), np.arange(9) > 4),  # too few
        (np.linspace(1, 20, 20), np.ones(20, dtype=bool)),  # all found
        (np.linspace(1, 20, 20), np.arange(20) > 9),  # hits and misses do not overlap
        (np.linspace(1, 20, 20), np.arange(20) < 10),  # larger ones are found less often
        (
            np.repeat([1.0, 9.0], 100),
            np.arange(200) % 100 > 2 - np.arange(200) // 100,
        ),  # the least is found
        (np.repeat([1.0, 9.0], 100), np.arange(200) % 100 < 10 + np.arange(200) // 100),  # none is found
    ],
)
def test_no_curve_where_the_data_have_none(sizes, hits):
    assert fit_pod(sizes, hits) is None


# ------------------------------------------------------------------------------------------------------- importance


def test_sobol_indices_are_those_of_ishigami_and_homma():
    """It is sin x1 + 7 sin^2 x2 + 0.1 x3^4 sin x1 on (-pi, pi)^3, whose variance can be taken apart by hand."""
    x = math.pi * (2.0 * saltelli(3, 8192, 6) - 1.0)
    y = np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])
    a, b = 7.0, 0.1
    one, two = 0.5 * (1.0 + b * math.pi**4 / 5.0) ** 2, a**2 / 8.0
    three = b**2 * math.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
    total = one + two + three
    found = sobol_indices(["x1", "x2", "x3"], y, 0)
    assert [row.first for row in found] == pytest.approx([one / total, two / total, 0.0], abs=0.02)
    assert [row.total for row in found] == pytest.approx([(one + three) / total, two / total, three / total], abs=0.02)


def test_rank_correlation_is_one_for_what_only_rises_and_covers_none_for_noise():
    rng = np.random.default_rng(7)
    x, noise = rng.random(200), rng.random(200)
    up, other = rank_correlations({"x": x, "noise": noise}, np.exp(5.0 * x))
    assert up.first == pytest.approx(1.0)
    assert abs(other.first) < other.first_error + 0.05
    assert rank_correlations({"same": np.ones(200)}, x) == []
