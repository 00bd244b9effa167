"""False alarms and missed faults under sensor noise: the computed rates against simulated noise."""

from dataclasses import replace

import numpy as np
import pytest

from ac_common.units import KPA, RPM
from ac_design import FdiWeights
from ac_design import design_fdi as design
from ac_design.analysis.error_rates import error_rates, simulated_residuals
from ac_design.model import sensor_noise

FAULTS = (10.0 * RPM, 1.25 * KPA)
"""A quarter of the paper's faults."""
SETTLED = 1500
"""Ticks after which the residuals of noise are stationary."""


@pytest.mark.parametrize("superheat", ["direct", "derived"])
def test_rates_are_those_of_simulated_noise(superheat: str) -> None:
    """With thresholds so low that there is something to count; the formula is the same for the real ones."""
    weights = FdiWeights(superheat=superheat)  # type: ignore[arg-type]
    noise, fdi = sensor_noise("med", weights), design("med", 0.1, weights)
    seen = simulated_residuals(fdi, noise, runs=200, ticks=SETTLED + 6000, seed=1)[:, SETTLED:]
    hours = seen.shape[0] * seen.shape[1] * fdi.sample_time_s / 3600.0
    sigma = np.array([rate.sigma for rate in error_rates(fdi, noise, FAULTS)])
    assert seen.std(axis=(0, 1)) == pytest.approx(sigma, rel=0.05)
    low = replace(fdi, thresholds=2.5 * sigma)
    for i, rate in enumerate(error_rates(low, noise, (4.0 * sigma[0], 4.0 * sigma[1]))):
        over = np.abs(seen[:, :, i]) > low.thresholds[i]
        crossings = np.count_nonzero(over[:, 1:] & ~over[:, :-1])
        assert crossings / hours == pytest.approx(rate.false_alarms_per_hour, rel=0.15)
        missed = np.mean(np.abs(seen[:, :, i] + 4.0 * sigma[i]) < low.thresholds[i])
        assert missed == pytest.approx(rate.missed, rel=0.15)


@pytest.mark.parametrize("point", ["low", "med", "high"])
@pytest.mark.parametrize("superheat", ["direct", "derived"])
def test_no_false_alarm_in_simulated_hours_and_the_stated_rate(point: str, superheat: str) -> None:
    weights = FdiWeights(superheat=superheat)  # type: ignore[arg-type]
    noise, fdi = sensor_noise(point, weights), design(point, 0.1, weights)
    for rate in error_rates(fdi, noise, (40.0 * RPM, 5.0 * KPA)):
        assert rate.false_alarms_per_hour <= weights.false_alarms_per_hour
        assert rate.missed < 1e-9
    seen = simulated_residuals(fdi, noise, runs=200, ticks=1800, seed=2)  # ten hours
    assert not np.any(np.abs(seen) > fdi.thresholds)
