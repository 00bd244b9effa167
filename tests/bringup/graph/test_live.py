"""Faults that are started and stopped while the loop runs: their shapes, and their way through a running graph."""

import math
import time
from dataclasses import dataclass, field
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
from bringup.launch.launch import GraphRun, run_graph
from bringup.replay.replay import replay
from fault_injector_node.live import LiveFault, Shape
from tests.operator import Operator

SAMPLE_TIME_S = 0.1
#: Of the run that is looked at: as long as the three seconds of the table and three levels of a fault take.
DURATION_S = 11.0


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


@dataclass
class Watched:
    """Somebody who looks at the topics of a run first, and then starts, changes and stops a fault."""

    operator: Operator
    done: list[str] = field(default_factory=list)
    topics: dict[str, dict[str, Any]] = field(default_factory=dict)
    acted_s: float = -math.inf

    def __call__(self, tick: int, _ticks: int) -> None:
        # Looking takes its time, while reports pile up: every level is to last for some ticks.
        if tick == 0 or time.monotonic() < self.acted_s + 0.5 or len(self.done) == 4:
            return
        self.act()
        self.acted_s = time.monotonic()

    def act(self) -> None:
        """Do what is next."""
        if not self.done:
            self.topics |= {row["name"]: row for row in topics_once(3.0)}
            self.done.append("looked")
        elif len(self.done) == 1:
            refused = self.operator.set(INJECTOR, compressor_speed__profile="jump", compressor_speed__size_rad_s=1e9)
            assert not any(result.successful for result in refused)
            assert "allowed: step, ramp" in refused[0].reason
            self.resize(40 * RPM)
            answer = self.operator.switch("compressor_speed", on=True)
            assert answer.success
            assert "step of 4.18879 rad/s" in answer.message
            self.done.append("started")
        elif len(self.done) == 2:
            self.resize(20 * RPM)
            self.done.append("changed")
        else:
            assert self.operator.switch("compressor_speed", on=False).success
            self.done.append("stopped")

    def resize(self, size: float) -> None:
        """Give the fault another size, rad/s."""
        answers = self.operator.set(INJECTOR, compressor_speed__size_rad_s=size)
        assert all(answer.successful for answer in answers)


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> tuple[Watched, GraphRun]:
    # On the wall clock: there is time to interfere between two ticks, and the loop must not mind.
    scenario = load("nominal", [f"duration_s={DURATION_S}"])
    with Operator() as operator:
        watched = Watched(operator)
        run = run_graph(scenario, tmp_path_factory.mktemp("watched"), mode="realtime", care=True, progress=watched)
    return watched, run


@pytest.mark.ros
@pytest.mark.clock
def test_fault_is_started_changed_and_stopped_in_a_running_graph(watched: tuple[Watched, GraphRun]) -> None:
    someone, run = watched
    assert someone.done == ["looked", "started", "changed", "stopped"]
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
def test_table_of_topics_shows_the_running_loop(watched: tuple[Watched, GraphRun]) -> None:
    seen = watched[0].topics
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
def test_realtime_keeps_to_the_wall_clock(watched: tuple[Watched, GraphRun]) -> None:
    _, run = watched
    ticks = round(DURATION_S / SAMPLE_TIME_S)
    assert run.ticks == ticks
    assert (
        run.wall_seconds >= DURATION_S - 0.1
    )  # never faster than the clock; how much slower is the machine's business
    recording = read_bag(run.bag)
    np.testing.assert_array_equal(recording.time_s, np.arange(ticks) * 100_000_000 / 1e9)
    assert recording.metadata["mode"] == "realtime"
    assert recording.metadata["missed_ticks"] == run.missed_ticks
    fdi = dict(health_reports(read_raw(run.bag)))["fdi"]
    if not any(int(fdi[key]) for key in ("late_inputs", "skipped_ticks", "missed_commands")):
        # Recorded on the wall clock or not: a node answers the same inputs with the same outputs.
        assert replay(run.bag, "fdi").bit_for_bit
    missing = np.isnan(recording.series["controller/command:compressor"]).sum()
    assert missing <= run.missed_ticks  # what is missing has been counted
