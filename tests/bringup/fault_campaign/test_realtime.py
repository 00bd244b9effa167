"""Real-time care, the watchdog of the ticks, who missed a tick, and runs that go on for hours, shortened."""

import json
import math
import os
import struct
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader

from ac_common.health import MissedTick, health_of, missed_ticks
from ac_common.topics import PRESSURE
from ac_experiments.bags.reader import health_reports, read_raw
from ac_experiments.bags.recorder import BagWriter, RecordedTopic
from ac_ros_common import realtime
from ac_ros_common.health_publisher import AGAIN_S, MOST_AGAIN, Health
from ac_ros_common.realtime import Latencies, RealtimeSettings
from bringup.benchmarks.endurance import COLUMNS, growth_mb, lost_messages, main, missing_messages, sustained_mb
from bringup.benchmarks.host_noise import lost_s, missed_by_us
from bringup.launch import keep_cpus_awake
from bringup.launch.processes import ros_environment, stop


def test_care_says_what_the_system_has_permitted_and_gives_it_back() -> None:
    """In a process of its own: locked memory is a matter of the whole process."""
    probe = """
import json, os
from pathlib import Path
from ac_ros_common.realtime import RealtimeSettings
status = lambda: Path("/proc/self/status").read_text().splitlines()
locked = lambda: int(next(line for line in status() if line.startswith("VmLck")).split()[1])
opened = lambda: [os.path.realpath(f"/proc/self/fd/{n}") for n in os.listdir("/proc/self/fd")]
awake = lambda: opened().count("/dev/cpu_dma_latency")
care = RealtimeSettings()
said = care.begin()
during = (locked(), awake())
care.end()
print(json.dumps([said, during, (locked(), awake()), care.state]))
"""
    result = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, timeout=60, check=True)
    said, (locked, held), after, state = json.loads(result.stdout)
    assert ("memory locked" in said) == (locked > 0)
    assert ("kept awake" in said) == (held == 1)
    assert "(" in said or (locked > 0 and held == 1)  # whatever was refused has its reason
    assert after == [0, 0]
    assert state == "none"


def test_latency_of_the_processors_is_held_at_zero(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    device, driver = tmp_path / "cpu_dma_latency", tmp_path / "current_driver"
    device.touch()
    driver.write_text("acpi_idle\n")
    monkeypatch.setattr(realtime, "IDLE_DRIVER", driver)
    monkeypatch.setattr(realtime, "CPU_DMA_LATENCY", device)
    care = RealtimeSettings()
    assert care._keep_awake() == "processors kept awake"
    assert device.read_bytes() == struct.pack("<i", 0)
    care.end()
    monkeypatch.setattr(realtime, "CPU_DMA_LATENCY", tmp_path / "missing")
    assert care._keep_awake() == "processors may doze (No such file or directory)"
    driver.write_text("none\n")
    assert care._keep_awake() == "processors may doze (no cpuidle driver)"


@pytest.mark.parametrize(
    ("groups", "limits", "rationed"),
    [
        ("0::/a/b\n", {}, False),
        ("0::/a/b\n", {"a/b/cpu.max": "max 100000", "a/cpu.max": "max 100000"}, False),
        ("0::/a/b\n", {"a/b/cpu.max": "150000 100000"}, True),
        ("0::/a/b\n", {"a/b/cpu.max": "max 100000", "a/cpu.max": "50000 100000"}, True),
        ("0::/elsewhere\n", {"cpu.max": "150000 100000"}, True),  # as a container sees itself
        ("4:memory:/m\n1:cpu:/\n0::/\n", {"cpu/cpu.cfs_quota_us": "-1"}, False),
        ("4:memory:/m\n1:cpu:/c\n0::/\n", {"cpu/c/cpu.cfs_quota_us": "50000"}, True),
    ],
)
def test_processor_time_that_is_rationed_is_not_used_up(
    groups: str, limits: dict[str, str], rationed: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(keep_cpus_awake, "GROUPS", tmp_path / "cgroup")
    monkeypatch.setattr(keep_cpus_awake, "GROUPS_OF_THIS", tmp_path / "own")
    monkeypatch.setattr(realtime, "IDLE_DRIVER", tmp_path / "missing")
    (tmp_path / "own").write_text(groups)
    for name, content in limits.items():
        file = tmp_path / "cgroup" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(content + "\n")
    assert keep_cpus_awake.is_rationed() == rationed
    if rationed:
        assert keep_cpus_awake.keep_awake(tmp_path, {}) == []


@pytest.mark.ros
def test_processors_that_the_kernel_would_halt_have_something_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each has a process of its own, behind everything else, that is gone when it is told to."""
    driver, environment = tmp_path / "current_driver", ros_environment()
    monkeypatch.setattr(realtime, "IDLE_DRIVER", driver)
    monkeypatch.setattr(keep_cpus_awake, "GROUPS_OF_THIS", tmp_path / "missing")
    driver.write_text("acpi_idle\n")
    assert keep_cpus_awake.keep_awake(tmp_path, environment) == []
    driver.unlink()
    children = keep_cpus_awake.keep_awake(tmp_path, environment)
    pids = [child.process.pid for child in children]
    until_s = time.monotonic() + 30.0

    def are_idle() -> bool:
        return all(os.sched_getscheduler(pid) == os.SCHED_IDLE and len(os.sched_getaffinity(pid)) == 1 for pid in pids)

    try:
        while not are_idle() and time.monotonic() < until_s:
            time.sleep(0.01)  # nothing announces it
        assert are_idle()
        assert set.union(*(os.sched_getaffinity(pid) for pid in pids)) == os.sched_getaffinity(0)
    finally:
        stop(children)
    assert {child.end for child in children} == {"SIGTERM"}
    monkeypatch.setenv(realtime.AWAKE_VARIABLE, "1")
    assert RealtimeSettings()._keep_awake() == "processors kept awake by idle processes"


@pytest.mark.ros
def test_what_is_not_the_loops_is_done_a_step_behind_it() -> None:
    probe = """
import json, os, rclpy
from rclpy.executors import SingleThreadedExecutor
from ac_ros_common.loop_node import LoopNode
rclpy.init(args=["--ros-args", "-p", "priority:=20"])
node, executor, seen = LoopNode("shell", ()), SingleThreadedExecutor(), []
see = lambda: seen.append(os.sched_getparam(0).sched_priority)
def others():
    for _ in range(20):
        node._do_others(executor)
executor.add_node(node)
node.trigger_configure(), node.trigger_activate()
see(), node.soon(see), others(), see()
node.soon(node.trigger_deactivate), others(), see()
print(json.dumps([node.realtime.scheduling, seen, node.state]))
node.destroy_node()
rclpy.shutdown()
"""
    result = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, timeout=60, check=True)
    scheduled, seen, state = json.loads(result.stdout)
    assert seen == ([20, 19, 20, 0] if scheduled == "SCHED_FIFO 20" else [0] * 4)
    assert state == "inactive"


@given(st.lists(st.floats(2e-6, 100.0), min_size=1, max_size=300), st.sampled_from([0.5, 0.9, 0.99]))
def test_quantiles_are_those_of_the_durations_to_a_bin(durations: list[float], share: float) -> None:
    latencies = Latencies()
    for duration in durations:
        latencies.add(duration)
    exact = np.quantile(durations, share, method="inverted_cdf")
    assert latencies.quantile_s(share) == pytest.approx(exact, rel=0.024)
    assert latencies.quantile_s(1.0) == max(durations)
    assert math.isnan(Latencies().quantile_s(0.5))


def test_watchdog_counts_ticks_that_took_longer_than_they_may(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = [100.0]
    monkeypatch.setattr("ac_ros_common.health_publisher.time.monotonic", lambda: now_s[0])
    health = Health()
    for took_s in (0.001, 0.030, 0.002, 0.015):
        started_s = now_s[0]
        now_s[0] += took_s
        health.worked(started_s, 0.02)
    said = health.report()
    assert (said.overruns, said.ticks) == (1, 4)
    assert said.longest_tick_ms == pytest.approx(30.0)


def test_what_was_announced_is_told_again_for_a_while_and_not_in_the_next_run(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = [100.0]
    monkeypatch.setattr("ac_ros_common.health_publisher.time.monotonic", lambda: now_s[0])
    health = Health()

    def told() -> list[list[object]]:
        return json.loads(health.report().values()["announced"])

    health.announce(1.0, "no q")
    assert told() == [[1.0, "no q"]]
    now_s[0] += 0.9 * AGAIN_S
    health.announce(9.0, "as usual again")
    assert told() == [[1.0, "no q"], [9.0, "as usual again"]]
    now_s[0] += 0.2 * AGAIN_S
    assert told() == [[9.0, "as usual again"]]
    for k in range(3 * MOST_AGAIN):
        health.announce(10.0 + k, "no q")
    assert len(told()) == 1 + 3 * MOST_AGAIN  # all that is new, however much
    assert len(told()) == MOST_AGAIN
    health.announce(99.0, "no q")
    health.forget()
    assert told() == []


def test_overruns_of_a_node_are_those_of_all_its_lives() -> None:
    lives = [("fdi", {"overruns": n}) for n in ("0", "2", "3", "0", "1", "nonsense")]
    (row,) = health_of(lives)
    assert row.overruns == 4


def test_a_missed_tick_is_the_machines_only_when_that_stood_still_for_long_enough() -> None:
    def judged(*missed: tuple[float, ...]) -> tuple[int, int]:
        ours = missed_by_us([MissedTick(k, *tick) for k, tick in enumerate(missed)], 0.02, stalls)
        return len(missed) - len(ours), len(ours)

    stalls: list[tuple[float, float]] = []
    assert judged() == (0, 0)
    assert judged((9.99,), (9.99, 0.001)) == (0, 2)
    stalls = [(10.00, 10.03), (20.00, 20.01)]
    assert judged((9.99,), (10.01,), (10.02,), (20.004,)) == (4, 0)
    assert judged((9.97,), (9.984,), (10.026,), (10.03,), (15.0,), (30.0,)) == (0, 6)
    # Several short ones count in all, each instant once; and a command is late by no more than the machine took away.
    stalls = [(10.000, 10.003), (10.001, 10.002), (10.002, 10.004), (10.010, 10.0115), (10.021, 10.023)]
    assert judged((10.0,)) == (1, 0)  # 4 ms and 1.5 ms
    assert judged((10.005, math.nan), (10.005, 0.002), (10.005, 0.0034)) == (2, 1)
    assert judged((10.005, 0.0036), (9.983, 0.0005), (10.03, 0.0)) == (1, 2)


@given(
    st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 0.3)), max_size=20),
    st.floats(0.0, 1.0),
    st.floats(0.0, 1.0),
)
def test_time_that_the_machine_took_away_is_counted_once(
    pieces: list[tuple[float, float]], began_s: float, length_s: float
) -> None:
    stalls = sorted((due_s, due_s + late_s) for due_s, late_s in pieces)
    fine_s = np.linspace(began_s, began_s + length_s, 20_001)
    covered = np.zeros_like(fine_s, dtype=bool)
    for due_s, woke_s in stalls:
        covered |= (fine_s >= due_s) & (fine_s <= woke_s)
    assert lost_s(np.reshape(stalls, (-1, 2)), began_s, began_s + length_s) == pytest.approx(
        length_s * covered.mean(), abs=5e-3
    )


def test_a_message_is_lost_when_it_can_have_been_sent() -> None:
    reports = [
        ("fault_injector", {"missing/plant/superheat": "9"}),
        ("fdi", {"missing/measured/superheat": "50"}),  # goes on with the one before
        ("fault_injector", {"missing/plant/superheat": "2", "missing/plant/wall_temperature": "4"}),
    ]
    missing = {"measured/superheat": 3, "measured/wall_temperature": 4, "plant/superheat": 1, "fdi/status": 2}
    assert lost_messages(missing, 0, reports) == {"measured/superheat": 3, "plant/superheat": 1, "fdi/status": 2}
    assert lost_messages(missing, 2, reports) == {"measured/superheat": 3}
    assert lost_messages(missing, 3, reports) == {}
    assert lost_messages(missing, 3, []) == {"measured/wall_temperature": 4}


def test_missed_ticks_are_gathered_from_all_reports() -> None:
    told = [
        {"epoch_monotonic_s": "100.0", "missed_at": "[2, 5]", "late_commands": "[[2, 0.001]]"},
        {},
        {"epoch_monotonic_s": "100.0", "missed_at": "[5, 9]", "late_commands": "[[5, 0.5]]"},
    ]
    missed = missed_ticks(told, 0.1)
    assert missed[:2] == (MissedTick(2, 100.2, 0.001), MissedTick(5, 100.5, 0.5))
    assert (missed[2].tick, missed[2].began_s) == (9, pytest.approx(100.9))
    assert math.isnan(missed[2].late_s)
    assert missed_ticks([], 0.1) == ()


NONSENSE = st.sampled_from(["", "nan", "-inf", "{}", "[", "[[]]", "[null, 7.0, true]", '[["a", 1], [3]]', "[" * 9_999])


@given(st.dictionaries(st.sampled_from(["epoch_monotonic_s", "missed_at", "late_commands", "overruns"]), NONSENSE))
def test_what_makes_no_sense_in_a_report_is_not_reported(values: dict[str, str]) -> None:
    sensible = {"epoch_monotonic_s": "100.0", "missed_at": "[2]", "late_commands": "[[2, 0.001]]", "overruns": "3"}
    assert missed_ticks([sensible, values], 0.1) == (MissedTick(2, 100.2, 0.001),)
    (row,) = health_of([("plant", sensible), ("plant", values)])
    assert row.overruns == 3


def test_growth_is_that_after_the_first_minute() -> None:
    time_s = list(range(0, 600, 10))
    warming = [80.0 + min(t, 50) for t in time_s]
    leaking = [80.0 + 0.01 * t for t in time_s]
    assert growth_mb(time_s, warming, 60.0) == pytest.approx(0.0)
    assert growth_mb(time_s, leaking, 60.0) == pytest.approx(0.01 * 540 * 0.75, rel=0.1)
    assert math.isnan(growth_mb([0.0], [1.0], 60.0))


def test_a_leak_goes_on_and_a_step_does_not() -> None:
    time_s = list(range(0, 1200, 10))
    leaking = [80.0 + 0.01 * t for t in time_s]
    stepped = [80.0 + 4.0 * (t > 400) for t in time_s]
    assert sustained_mb(time_s, leaking, 60.0) > 6.0
    assert growth_mb(time_s, stepped, 60.0) == pytest.approx(4.0)
    assert sustained_mb(time_s, stepped, 60.0) == pytest.approx(0.0)


def test_a_bag_of_many_chunks_keeps_its_index_on_disk_and_has_all_of_it_at_the_end(tmp_path: Path) -> None:
    bag = BagWriter(tmp_path / "bag", [RecordedTopic("/ac/plant/superheat", PRESSURE, 10, 1.0)], {})
    for k in range(50):
        bag.write(0, bytes(40), k, k)
        bag._flushed_s = -1.0
        bag.flush_if_due()
        assert len(bag._writer._Writer__chunk_indices) == 1
    bag.close()
    assert sorted(file.name for file in (tmp_path / "bag").iterdir()) == ["bag_0.mcap", "metadata.yaml"]
    with (tmp_path / "bag" / "bag_0.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
        assert summary is not None
        assert len(summary.chunk_indexes) == 50
        assert [index.message_start_time for index in summary.chunk_indexes] == list(range(50))
        found = [message.log_time for _, _, message in make_reader(stream).iter_messages()]
        assert found == list(range(50))


@pytest.mark.ros
@pytest.mark.clock
@pytest.mark.slow
def test_a_long_run_shortened(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`python -m bringup.benchmarks.endurance` in full: two hours at 50 Hz. Here: the bag, and no node that swells."""
    main(["--seconds", "8", "--rate", "10", "--out", str(tmp_path)])
    said = capsys.readouterr().out
    rows = [line for line in said.splitlines() if line.strip().partition(" ")[0].isdecimal() and " s " in line]
    assert len(rows) >= 2, said
    assert all(len(row.split()) == 2 + len(COLUMNS) for row in rows)
    assert "bag complete: True" in said, said
    assert "goes on growing, by" not in said, said
    assert "by our code" in said
    assert "buffers being full: " in said
    raw = read_raw(tmp_path / "bag")
    missed = int(said.partition("ticks missed: ")[2].partition(";")[0])
    assert lost_messages(missing_messages(raw, 80), missed, health_reports(raw)) == {}, said
    states = {values.get("realtime_care", "") for values in _last_health(tmp_path)}
    assert any(state.startswith("memory") for state in states) or os.getuid() != 0, states
    if not (realtime.has_idle_driver() or keep_cpus_awake.is_rationed()):
        assert any(state.endswith("kept awake by idle processes") for state in states), states
    assert realtime.AWAKE_VARIABLE not in os.environ  # of the nodes alone: this process may run others


def _last_health(out: Path) -> list[dict[str, str]]:
    return [values for _, values in health_reports(read_raw(out / "bag")) if values.get("state") == "active"]
