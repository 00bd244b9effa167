"""A run through real processes: complete, deterministic, the same as the simulation, readable by others."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from ac_common.fdi_status import StatusRow
from ac_common.topics import SERIES, TICKED
from ac_experiments.bags.reader import RawBag, read_bag, read_raw
from ac_experiments.bags.simulated import write_bag
from ac_experiments.designs import designs_of
from ac_experiments.scenario_schema import Scenario
from ac_experiments.simulate import simulate
from bringup.launch.launch import GraphRun, run_graph
from bringup.replay.replay import replay

pytestmark = pytest.mark.ros


def loop_payloads(raw: RawBag) -> dict[str, list[tuple[int, bytes]]]:
    """Everything but the health reports, which tell wall-clock times."""
    return {topic: messages for topic, messages in raw.messages.items() if topic != "/diagnostics"}


def numbers(row: StatusRow) -> tuple[float, ...]:
    return (row.time_s, row.detected, row.size, row.onset_s, row.isolated_s, *row.thresholds)


def test_two_runs_record_the_same_bytes(run: GraphRun, scenario: Scenario, tmp_path: Path) -> None:
    again = run_graph(scenario, tmp_path)
    assert loop_payloads(read_raw(run.bag)) == loop_payloads(read_raw(again.bag))


def test_graph_gives_the_numbers_of_the_simulation(run: GraphRun, scenario: Scenario) -> None:
    recorded, simulated = read_bag(run.bag), simulate(scenario)
    assert recorded.metadata["complete"]
    np.testing.assert_array_equal(recorded.time_s, simulated.time_s)
    assert set(recorded.series) == set(SERIES)
    for key in SERIES:
        np.testing.assert_array_equal(recorded.series[key], simulated.series[key], err_msg=key)
    assert [row.isolated for row in recorded.status] == [row.isolated for row in simulated.status]
    np.testing.assert_array_equal(*([numbers(row) for row in side.status] for side in (recorded, simulated)))


def test_the_simulation_writes_the_same_bag(run: GraphRun, scenario: Scenario, tmp_path: Path) -> None:
    designs = designs_of(scenario)
    write_bag(tmp_path / "bag", simulate(scenario, designs=designs), designs)
    recorded, written = read_raw(run.bag), read_raw(tmp_path / "bag")
    assert written.complete
    assert loop_payloads(written) == loop_payloads(recorded)
    assert written.types == recorded.types
    assert set(written.attachments) == set(recorded.attachments)
    result = replay(tmp_path / "bag", "fdi")
    assert result.different == 0
    assert result.compared == 6 * scenario.ticks


def test_foreign_reader_finds_every_message(run: GraphRun, scenario: Scenario) -> None:
    with AnyReader([run.bag]) as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
        for topic in TICKED:
            assert counts[f"/ac/{topic.name}"] == scenario.ticks, topic.name
        assert counts["/clock"] == scenario.ticks
        stamps: dict[str, list[int]] = {}
        speeds = []
        for connection, log_ns, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            if connection.topic == "/ac/controller/command":
                speeds.append(message.velocity[0])
                assert np.isnan(message.position[0])
                assert message.name == ["compressor", "expansion_valve"]
            if connection.topic.startswith("/ac/"):
                stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
                assert stamp == log_ns
                stamps.setdefault(connection.topic, []).append(stamp)
    wanted = [k * scenario.tick_ns for k in range(scenario.ticks)]
    assert all(sorted(stamps[f"/ac/{topic.name}"]) == wanted for topic in TICKED)
    # A fault that no filter is for is silent while there is none.
    (slow,) = (fault for fault in scenario.faults if fault.kind == "valve_slow")
    assert sorted(stamps["/ac/fault/valve_slow"]) == [stamp for stamp in wanted if stamp >= slow.onset_s * 1e9]

    np.testing.assert_array_equal(speeds, read_bag(run.bag).series["controller/command:compressor"])


def test_bag_is_healthy_and_says_what_was_run(run: GraphRun, scenario: Scenario) -> None:
    (file,) = run.bag.glob("*.mcap")
    tool = Path(sys.executable).with_name("pymcap-cli")
    doctor = subprocess.run([tool, "doctor", str(file)], capture_output=True, text=True, timeout=60)
    assert doctor.returncode == 0, doctor.stdout + doctor.stderr
    assert "error" not in doctor.stdout.lower().replace("no errors", ""), doctor.stdout
    raw = read_raw(run.bag)
    assert raw.complete
    assert json.loads(json.dumps(raw.run["scenario"])) == scenario.model_dump(mode="json")


def test_nodes_report_their_health(run: GraphRun) -> None:
    raw = read_raw(run.bag)
    assert len(raw.messages["/diagnostics"]) >= 1
    assert raw.types["/diagnostics"] == "diagnostic_msgs/msg/DiagnosticArray"
