"""Thresholds from noise, against simulated noise."""

import numpy as np
import pytest

from ac_design.thresholds import noise_thresholds, residual_covariances, step_peaks

OBSERVER = (np.diag([0.9, 0.7]), np.array([[0.1, 0.0], [0.05, 0.3]]), np.array([[1.0, 0.2], [0.0, 0.5]]))
FILTER = (np.array([[0.98]]), np.array([[0.02, 0.01]]), np.array([[1.0]]), np.array([[0.001, 0.0]]))
NOISE = np.array([2.0, 0.5])


def simulate(ticks: int) -> np.ndarray:
    random = np.random.default_rng(0).normal(size=(ticks, 2)) * NOISE
    (a, b, c), (ha, hb, hc, hd) = OBSERVER, FILTER
    xi, eta, seen = np.zeros(2), np.zeros(1), np.empty(ticks)
    for k, y in enumerate(random):
        innovation = c @ xi - y
        seen[k] = (hc @ eta + hd @ innovation)[0]
        xi, eta = a @ xi + b @ y, ha @ eta + hb @ innovation
    return seen[1000:]


def test_covariances_and_crossings_are_those_of_simulated_noise() -> None:
    seen = simulate(400_000)
    covariance, shifted = residual_covariances(OBSERVER, FILTER, NOISE)
    assert covariance[0, 0] == pytest.approx(seen.var(), rel=0.05)
    assert shifted[0, 0] == pytest.approx(np.mean(seen[1:] * seen[:-1]), rel=0.05)
    per_hour = 2000.0
    threshold = noise_thresholds(covariance, shifted, 0.1, per_hour)[0]
    over = np.abs(seen) > threshold
    crossings = np.count_nonzero(over[1:] & ~over[:-1])
    assert crossings / (len(seen) * 0.1 / 3600.0) == pytest.approx(per_hour, rel=0.15)


def test_fewer_alarms_ask_for_a_higher_threshold() -> None:
    covariance, shifted = residual_covariances(OBSERVER, FILTER, NOISE)
    high, low = (noise_thresholds(covariance, shifted, 0.1, rate)[0] for rate in (1e-3, 1.0))
    assert high > low > 3.0 * np.sqrt(covariance[0, 0])


def test_step_peak_of_a_chain_known_in_closed_form() -> None:
    """A plant `y = 2 (1 - 0.5^k)`, a blind observer, a filter that halves: the peak is the end value, 1."""
    plant = (np.array([[0.5]]), np.array([1.0]), np.array([[1.0]]))
    blind = (np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1)))
    halving = (np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1)), np.array([[0.5]]))
    assert step_peaks(plant, blind, halving, 100) == pytest.approx([1.0])
    assert step_peaks(plant, blind, halving, 2) == pytest.approx([0.5])  # y = 0, then 1
