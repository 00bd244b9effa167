"""Nodes that are stopped (SIGSTOP) for 5 s and continued: nothing stale is acted upon; in lockstep everybody waits."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mischief import Mischief, pid_of

from ac_common.safe_command import SAFE_RATE
from ac_common.topics import COMPENSATOR, CONTROLLER, FDI, INJECTOR, PLANT
from ac_experiments.bags.reader import read_bag, read_raw
from ac_experiments.scenario import load
from bringup.launch import restarts
from bringup.launch.launch import run_graph

pytestmark = [pytest.mark.ros, pytest.mark.clock]

STOP_S = 5.0


def stop_for_a_while(*nodes: str, seconds: float = STOP_S) -> None:
    """Stop nodes; a process of its own continues them, whatever becomes of the test."""
    pids = [pid_of(node) for node in nodes]
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)
    code = f"import os, time; time.sleep({seconds}); [os.kill(pid, 18) for pid in {pids}]"
    subprocess.Popen([sys.executable, "-S", "-c", code])


def test_stopped_for_5_s_one_after_the_other_no_node_acts_on_what_is_stale(tmp_path: Path) -> None:
    plan = [
        (10, lambda: stop_for_a_while(FDI, COMPENSATOR, CONTROLLER)),
        (80, lambda: stop_for_a_while(PLANT)),
        (150, lambda: stop_for_a_while(INJECTOR)),
    ]
    mischief = Mischief(plan)
    run = run_graph(load("nominal", ["duration_s=25"]), tmp_path, mode="realtime", care=True, progress=mischief)
    assert len(mischief.done) == len(plan)
    assert run.restarts == ()
    recording = read_bag(run.bag)
    raw = read_raw(run.bag)
    series = recording.series
    assert len(recording.time_s) == 250  # the plant's stamps go on with the clock
    # For every node: the messages of what it was stopped for are missing but for the last few ticks.
    for node, topic, tick in (
        (FDI, "fdi/residual/evaporator_pressure", mischief.done[0]),
        (CONTROLLER, "controller/command:compressor", mischief.done[0]),
        (PLANT, "plant/superheat", mischief.done[1]),
        (INJECTOR, "measured/superheat", mischief.done[2]),
    ):
        missing = np.isnan(series[topic][tick : tick + 60])
        assert missing.sum() >= 10 * STOP_S - 8, node
    # No tick is answered twice, nor late by more than what counts as fresh.
    for topic in ("controller/command", "actuator/command", "compensator/q"):
        messages = raw.messages[f"/ac/{topic}"]
        stamps = [data[4:12] for _, data in messages]
        assert len(stamps) == len(set(stamps)), topic
        ages = [log_ns / 1e9 - _stamp_s(data) for log_ns, data in messages]
        assert np.quantile(np.array(ages) - min(ages), 0.99) < 0.5, topic
    # At rest all the time: the safe command is where it was.
    moved = np.abs(np.diff(series["actuator/command:compressor"][np.isfinite(series["actuator/command:compressor"])]))
    assert np.max(moved) < 10 * SAFE_RATE[0]
    superheat = series["plant/superheat"]
    np.testing.assert_allclose(superheat[np.isfinite(superheat)][-5:], 20.0, atol=0.5)


def _stamp_s(data: bytes) -> float:
    return int.from_bytes(data[4:8], "little", signed=True) + int.from_bytes(data[8:12], "little") / 1e9


def test_a_node_that_hangs_for_good_is_ended_and_started_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(restarts, "HUNG_S", 5.0)  # to save time
    mischief = Mischief([(10, lambda: os.kill(pid_of(COMPENSATOR), signal.SIGSTOP))])
    scenario = load("nominal", ["duration_s=16"])
    run = run_graph(scenario, tmp_path, mode="realtime", care=True, progress=mischief, say=mischief.say)
    (restart,) = run.restarts
    assert restart.node == COMPENSATOR
    assert restart.is_back
    assert mischief.said[0] == "node compensator died (ended, as it had not reported for 5 s) and is started again"
    series = read_bag(run.bag).series
    q = np.isfinite(series["compensator/q:compressor"])
    assert not q[mischief.done[0] + 5 : round(10 * restart.died_s) - 1].any()
    assert q[-5:].any()


def test_in_lockstep_everybody_waits_and_the_recording_is_the_same(tmp_path: Path) -> None:
    scenario = load("nominal", ["duration_s=30"])
    plan = [(0, lambda: stop_for_a_while(FDI, seconds=2.0)), (0, lambda: stop_for_a_while(PLANT, seconds=1.0))]
    mischief = Mischief(plan)
    disturbed = run_graph(scenario, tmp_path / "a", progress=mischief)
    assert mischief.done
    assert mischief.done[-1] < 300
    calm = run_graph(scenario, tmp_path / "b")
    one, other = read_raw(disturbed.bag), read_raw(calm.bag)
    assert {t: m for t, m in one.messages.items() if t != "/diagnostics"} == {
        t: m for t, m in other.messages.items() if t != "/diagnostics"
    }
