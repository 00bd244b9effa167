"""Faults that are started and stopped while the loop runs: their shapes, and their way through a running graph."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ac_common.fault_profiles import PROFILES, unit_profile
from ac_common.topics import INJECTOR, TOPICS
from ac_common.units import RPM
from ac_experiments.bags.reader import health_reports, read_bag, read_raw
from ac_experiments.scenario import load
from bringup.commands.topic_watch import topics_once
from bringup.launch.launch import run_graph
from bringup.replay.replay import replay
from fault_injector_node.live import LiveFault, Shape
from tests.operator import Operator

SAMPLE_TIME_S = 0.1


@given(
    profile=st.sampled_from(PROFILES),
    size=st.floats(-1e5, 1e5),
    rise_s=st.floats(0.1, 50.0),
    period_s=st.floats(0.5, 50.0),
    time_constant_s=st.floats(0.1, 500.0),
    duty_percent=st.floats(1.0, 99.0),
    seed=st.integers(0, 1000),
)
def test_live_fault_has_the_shape_of_a_scheduled_one(
    profile: str, size: float, rise_s: float, period_s: float, time_constant_s: float, duty_percent: float, seed: int
) -> None:
    keys: dict[str, Any] = {
        "rise_s": rise_s,
        "period_s": period_s,
        "time_constant_s": time_constant_s,
        "duty_percent": duty_percent,
        "seed": seed,
    }
    time_s = np.arange(300) * 100_000_000 / 1e9
    fault = LiveFault(SAMPLE_TIME_S)
    assert fault.value(-0.1) == 0.0
    fault.start(Shape(profile, size, **keys))
    live = [fault.value(t) for t in time_s]
    fault.stop()
    assert fault.value(40.0) == 0.0
    scheduled = size * unit_profile(time_s, profile, 0.0, **keys)
    np.testing.assert_allclose(live, scheduled, rtol=1e-9, atol=1e-9 * abs(size))


def test_unknown_profile_is_refused() -> None:
    with pytest.raises(ValueError, match="allowed: step, ramp"):
        LiveFault(0.1).start(Shape("stepp", 1.0))


@pytest.mark.ros
@pytest.mark.clock
def test_fault_is_started_changed_and_stopped_in_a_running_graph(operator: Operator, tmp_path: Path) -> None:
    done: list[str] = []
    acted: list[int] = [0]

    def interfere(tick: int, _ticks: int) -> None:
        # A service takes its time, while reports pile up: every level is to last for some ticks.
        if tick < acted[-1] + 5 or len(done) == 3:
            return
        acted.append(tick)
        if not done:
            refused = operator.set(INJECTOR, compressor_speed__profile="jump", compressor_speed__size_rad_s=1e9)
            assert not any(result.successful for result in refused)
            assert "allowed: step, ramp" in refused[0].reason
            assert all(result.successful for result in operator.set(INJECTOR, compressor_speed__size_rad_s=40 * RPM))
            answer = operator.switch("compressor_speed", on=True)
            assert answer.success
            assert "step of 4.18879 rad/s" in answer.message
            done.append("started")
        elif len(done) == 1:
            assert all(result.successful for result in operator.set(INJECTOR, compressor_speed__size_rad_s=20 * RPM))
            done.append("changed")
        elif len(done) == 2:
            assert operator.switch("compressor_speed", on=False).success
            done.append("stopped")

    # On the wall clock: there is time to interfere between two ticks, and the loop must not mind.
    run = run_graph(load("nominal", ["duration_s=8"]), tmp_path, mode="realtime", care=True, progress=interfere)
    assert done == ["started", "changed", "stopped"]
    recording = read_bag(run.bag)
    truth = recording.series["fault/compressor_speed:compressor"]
    known = truth[np.isfinite(truth)]
    levels = known[np.flatnonzero(np.diff(known, prepend=np.inf))]
    np.testing.assert_allclose(levels, [0.0, 40 * RPM, 20 * RPM, 0.0])
    added = recording.series["actuator/command:compressor"] - recording.series["controller/command:compressor"]
    both = np.isfinite(added) & np.isfinite(truth)
    assert both.sum() > 40
    np.testing.assert_allclose(added[both], truth[both], atol=1e-9)


@pytest.mark.ros
@pytest.mark.clock
def test_table_of_topics_shows_the_running_loop(tmp_path: Path) -> None:
    seen: dict[str, dict[str, Any]] = {}

    def look(tick: int, _ticks: int) -> None:
        if tick > 0 and not seen:
            seen.update({row["name"]: row for row in topics_once(3.0)})

    run_graph(load("nominal", ["duration_s=8"]), tmp_path, mode="realtime", care=True, progress=look)
    assert {f"/ac/{topic.name}" for topic in TOPICS} <= set(seen)
    command = seen["/ac/controller/command"]
    assert command["type"] == "sensor_msgs/msg/JointState"
    assert command["publishers"] == ["gimc_controller"]
    assert command["subscribers"] == ["fault_injector", "fdi", "recorder"]
    assert 0.0 < command["rate_hz"] < 20.0
    speed, opening = (float(value) for value in command["value"].split(", "))
    np.testing.assert_allclose([speed, opening], [1000 * RPM, 0.4], rtol=1e-3)


@pytest.mark.ros
@pytest.mark.clock
def test_realtime_keeps_to_the_wall_clock(tmp_path: Path) -> None:
    run = run_graph(load("nominal", ["duration_s=3"]), tmp_path, mode="realtime", care=True)
    assert run.ticks == 30
    assert run.wall_seconds >= 3.0 - 0.1  # never faster than the clock; how much slower is the machine's business
    recording = read_bag(run.bag)
    np.testing.assert_array_equal(recording.time_s, np.arange(30) * 100_000_000 / 1e9)
    assert recording.metadata["mode"] == "realtime"
    assert recording.metadata["missed_ticks"] == run.missed_ticks
    fdi = dict(health_reports(read_raw(run.bag)))["fdi"]
    if not any(int(fdi[key]) for key in ("late_inputs", "skipped_ticks", "missed_commands")):
        # Recorded on the wall clock or not: a node answers the same inputs with the same outputs.
        assert replay(run.bag, "fdi").bit_for_bit
    missing = np.isnan(recording.series["controller/command:compressor"]).sum()
    assert missing <= run.missed_ticks  # what is missing has been counted
