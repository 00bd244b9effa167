"""The loop in one process, on the nonlinear plant: what a run must reach, and the same numbers every time.

`acftc reproduce` judges the same runs more finely, against the paper.
"""

import numpy as np
import pytest

from ac_common.topics import SERIES
from ac_experiments.designs import designs_at
from ac_experiments.metrics import summarise
from ac_experiments.recording import Recording
from ac_experiments.scenario import check, load
from ac_experiments.simulate import simulate


@pytest.fixture(scope="module")
def nominal() -> Recording:
    return simulate(load("nominal"))


def test_nominal_stays_at_rest(nominal: Recording):
    summary = summarise(nominal)
    assert summary["metrics"]["peak_pressure_error_kpa"] < 0.05
    assert summary["metrics"]["peak_superheat_error_k"] < 0.05
    assert summary["false_alarms"] == 0
    assert not any(row.detected for row in nominal.status)


def test_every_series_is_there_and_finite(nominal: Recording):
    assert set(nominal.series) == set(SERIES)
    for key, values in nominal.series.items():
        assert values.shape == nominal.time_s.shape, key
        assert np.isfinite(values).all(), key


def test_two_runs_are_the_same_to_the_last_bit():
    noise = [
        "duration_s=60",
        "noise={evaporator_pressure_kpa: 0.2, superheat_k: 0.1, wall_temperature_k: 0.05, seed: 3}",
    ]
    first, second = (simulate(load("nominal", noise)) for _ in range(2))
    for key in SERIES:
        assert np.array_equal(first.series[key], second.series[key]), key
    assert [row.detected for row in first.status] == [row.detected for row in second.status]
    other = simulate(load("nominal", [*noise, "noise.seed=4"]))
    assert not np.array_equal(
        first.series["measured/evaporator_pressure"], other.series["measured/evaporator_pressure"]
    )


def test_the_loop_passes_each_signal_on():
    short = simulate(load("actuator_fault", ["duration_s=30", "faults.0.onset_s=10", "references={}"]))
    series = short.series
    fault = series["fault/compressor_speed:compressor"]
    assert np.array_equal(series["actuator/command:compressor"], series["controller/command:compressor"] + fault)
    assert np.array_equal(series["measured/superheat"], series["plant/superheat"])
    # The fault acts on the plant over the sample after its onset, and not before.
    onset = int(np.flatnonzero(fault)[0])
    pressure = series["plant/evaporator_pressure"]
    assert np.abs(np.diff(pressure[: onset + 1])).max() < 1.0
    assert pressure[onset + 1] < pressure[onset] - 1.0


@pytest.mark.parametrize("passive", [False, True])
def test_actuator_fault(passive: bool):
    summary = summarise(simulate(load("actuator_fault"), passive=passive))
    (fault,) = summary["faults"]
    assert fault["isolated_as"] == "compressor_speed"
    assert fault["isolated_s"] - fault["onset_s"] < 60
    assert summary["false_alarms"] == 0
    if not passive:
        assert summary["metrics"]["command_change_rpm"] == pytest.approx(-40, abs=1)
        assert summary["metrics"]["peak_pressure_error_kpa"] < 1.0


@pytest.mark.parametrize("passive", [False, True])
def test_sensor_fault(passive: bool):
    summary = summarise(simulate(load("sensor_fault"), passive=passive))
    (fault,) = summary["faults"]
    assert fault["isolated_as"] == "evaporator_pressure"
    assert fault["isolated_s"] - fault["onset_s"] < 60
    assert summary["false_alarms"] == 0
    metrics = summary["metrics"]
    if passive:
        assert metrics["command_change_rpm"] == pytest.approx(50, abs=5)
        assert metrics["steady_pressure_error_kpa"] == pytest.approx(-5, abs=0.2)
    else:
        assert abs(metrics["command_change_rpm"]) < 0.5
        assert metrics["peak_pressure_error_kpa"] < 0.5


def test_another_compensator_can_be_tried():
    scenario = load("sensor_fault", ["duration_s=560"])
    own = designs_at("med", scenario.sample_time_s)
    assert np.array_equal(
        simulate(scenario, designs=own).series["compensator/q:compressor"],
        simulate(scenario).series["compensator/q:compressor"],
    )


def test_a_jump_of_the_superheat_sensor_is_an_unknown_fault_and_k0_is_then_alone():
    fault = {"kind": "superheat_sensor", "size_k": 3.0, "onset_s": 20.0}
    recording = simulate(check({"name": "jump", "duration_s": 40.0, "faults": [fault]}))
    off = recording.series["measured/superheat"] - recording.series["plant/superheat"]
    np.testing.assert_allclose(off, np.where(recording.time_s >= 20.0, 3.0, 0.0), atol=1e-12)
    summary = summarise(recording)
    (found,) = summary["faults"]
    assert (found["size"], found["unit"], found["isolated_as"], found["estimate"]) == (3.0, "K", "unknown", None)
    assert found["isolated_s"] == pytest.approx(20.5)
    assert summary["false_alarms"] == 0
    q = np.abs(recording.series["compensator/q:compressor"])
    assert q[recording.time_s < 20.0].max() < 1e-6
    assert q.max() > 1.0  # the guard has seen it, too,
    assert q[recording.time_s > 26.0].max() == 0.0  # until it stands back


def test_a_slow_bias_of_the_superheat_sensor_cannot_be_told_from_the_other_faults():
    """The columns of air flow, f_N and f_p span all three readings at every frequency, so they explain any bias."""
    from ac_design.model import design_model

    for point in ("low", "med", "high"):
        system = design_model(point).system
        for frequency in np.logspace(-4, 0, 9):
            dynamics = 1j * frequency * np.eye(len(system.A)) - system.A
            columns = system.C @ np.linalg.solve(dynamics, np.hstack([system.E1, system.F1]))
            columns = columns + np.hstack([system.E2, system.F2])
            assert columns.shape == (3, 3)
            assert 10.0 < np.linalg.cond(columns) < 100.0
