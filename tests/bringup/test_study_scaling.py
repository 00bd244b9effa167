"""What the benchmark of studies says of one short study on one worker agrees with itself."""

import pytest

from bringup.benchmarks.study_scaling import measure


def test_shares_and_rates_follow_from_what_was_measured():
    one = measure(workers=1, seconds=0.0, run_s=5.0)
    timing = one.timing
    assert (timing.runs, timing.workers, one.cores) == (2, 1, 1)
    assert 0.0 < timing.busy_cpu_s <= 1.05 * timing.busy_s + 0.05
    assert timing.busy_s <= timing.wall_s
    assert one.runs_a_minute * timing.wall_s == pytest.approx(120.0)
    assert one.busy * timing.wall_s == pytest.approx(timing.busy_cpu_s)
    assert one.scheduler * timing.busy_cpu_s == pytest.approx(timing.client_cpu_s)
    assert all(mb > 0.0 for mb in one.memory_mb)
