"""Whatever goes wrong: one clear line, no process left, and a bag that can be read."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from rosbags.highlevel import AnyReader

from ac_common.errors import RunError, UserError
from ac_common.topics import FDI, RECORDER
from ac_experiments.bags.reader import read_bag
from ac_experiments.scenario import load
from ac_experiments.scenario_schema import Scenario
from bringup.benchmarks.children import node_processes
from bringup.launch import run_end
from bringup.launch.launch import _prepare, run_graph
from bringup.launch.processes import Domain, ros_environment, start, stop
from bringup.launch.user_nodes import user_nodes
from tests.processes import processes_that_mention
from tests.said import complaints

pytestmark = pytest.mark.ros

#: Runs a scenario that would take minutes, and says on stdout when the loop runs.
RUNNER = """
import sys
from ac_common.errors import UserError
from bringup.launch.launch import run_graph
from ac_experiments.scenario import load
try:
    run_graph(load("nominal"), sys.argv[1], progress=lambda done, ticks: print("tick", done, flush=True))
except UserError as problem:
    sys.exit(str(problem))
"""


def start_run(out: Path) -> subprocess.Popen[str]:
    """Start a run in a process of its own and return when it has recorded something."""
    process = subprocess.Popen(
        [sys.executable, "-c", RUNNER, str(out)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    for line in process.stdout:
        if line.startswith("tick") and int(line.split()[1]) > 50:
            return process
    pytest.fail(f"the run did not start: {process.communicate()[1]}")


def wait_until_gone(out: Path, patience_s: float = 10.0) -> None:
    deadline = time.monotonic() + patience_s
    while processes_that_mention(str(out)):
        assert time.monotonic() < deadline, processes_that_mention(str(out))
        time.sleep(0.02)  # processes of others give no event that could be waited for


def test_interrupted_run_leaves_a_good_bag_and_no_process(tmp_path: Path) -> None:
    process = start_run(tmp_path)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=20)
    assert process.returncode != 0
    assert len(complaints(said)) == 1
    assert "interrupted" in said
    assert not processes_that_mention(str(tmp_path))
    assert len(read_bag(tmp_path).time_s) > 50
    with AnyReader([tmp_path / "bag"]) as reader:  # closed properly: it has its index
        assert sum(connection.msgcount for connection in reader.connections) > 50


def test_third_interrupt_leaves_at_once_and_the_nodes_go_along(tmp_path: Path) -> None:
    process = start_run(tmp_path)
    for _ in range(3):
        process.send_signal(signal.SIGINT)
        time.sleep(0.05)  # signals of one kind that are pending count once
    _, said = process.communicate(timeout=20)
    assert process.returncode in (130, 1)  # on a quick machine the end was over before the third
    assert "Traceback" not in said
    wait_until_gone(tmp_path)
    assert len(read_bag(tmp_path).time_s) > 50


def test_node_that_is_interrupted_twice_ends_without_a_traceback() -> None:
    slow = HELD.replace("ctypes.PyDLL(None).pause()", "import time; print('ending', flush=True); time.sleep(0.5)")
    with subprocess.Popen(
        [sys.executable, "-c", slow],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, **ros_environment()},
    ) as node:
        assert node.stdout is not None
        for word in ("ready", "ending"):
            while node.stdout.readline() != f"{word}\n":
                assert node.poll() is None
            node.send_signal(signal.SIGINT)
        _, said = node.communicate(timeout=30)
    assert (node.returncode, said) == (0, "")


def test_killed_bringup_takes_its_nodes_along(tmp_path: Path) -> None:
    process = start_run(tmp_path)
    process.kill()
    process.communicate()
    wait_until_gone(tmp_path)
    assert len(read_bag(tmp_path).time_s) > 50


#: A parent with a child that will not be told to end; `argv[1]` is what to find the child by.
STUBBORN = """
import os, subprocess, sys
from ac_ros_common.process_exit import PARENT_VARIABLE
child = "import signal, time; from ac_ros_common.process_exit import end_with_parent; "
child += "signal.signal(signal.SIGTERM, signal.SIG_IGN); end_with_parent(); print('ready', flush=True); time.sleep(600)"
environment = {**os.environ, PARENT_VARIABLE: str(os.getpid())}
subprocess.Popen([sys.executable, "-c", child, sys.argv[1]], env=environment).wait()
"""


def test_child_that_hangs_does_not_outlive_a_killed_parent(tmp_path: Path) -> None:
    parent = subprocess.Popen([sys.executable, "-c", STUBBORN, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    assert parent.stdout.readline() == "ready\n"
    parent.kill()
    parent.wait()
    assert processes_that_mention(str(tmp_path))  # it was told to end, and did not
    wait_until_gone(tmp_path)


#: A node that the middleware does not let go: it hangs in a call that keeps the interpreter's lock.
HELD = """
import ctypes
from ac_ros_common import loop_node as node_shell
from bringup.nodes.scenario import ScenarioNode
node_shell.LEAVE_S = 3.0
class Held(ScenarioNode):
    def report_health(self):
        super().report_health()
        print("ready", flush=True)
    def destroy_node(self):
        ctypes.PyDLL(None).pause()
node_shell.run_node(Held)
"""


def test_node_that_hangs_when_told_to_end_ends_all_the_same_and_says_where_it_stood() -> None:
    environment = {**os.environ, **ros_environment()}
    with subprocess.Popen(
        [sys.executable, "-c", HELD], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as node:
        assert node.stdout is not None
        assert node.stdout.readline() == "ready\n"
        node.terminate()
        try:
            _, said = node.communicate(timeout=30)
        finally:
            node.kill()
    assert node.returncode == 0  # its work is done
    assert "in destroy_node" in said


def test_reason_why_a_node_ended_is_told_also_when_it_hung_after_it(tmp_path: Path) -> None:
    fails = HELD.replace('print("ready", flush=True)', 'raise RuntimeError("broken")')
    child = start("held", ["-c", fails], tmp_path, ros_environment())
    try:
        assert child.process.wait(30) == 1
    finally:
        stop([child])
    assert child.last_words() == "scenario: RuntimeError: broken"


def test_what_is_over_in_time_ends_no_process() -> None:
    code = "import time; from ac_ros_common.exit_watchdog import bounded\n"
    code += "with bounded(0.3): pass\n"
    code += "time.sleep(0.6); print('lives', flush=True)\n"
    code += "with bounded(3.0): time.sleep(60)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30, check=False)
    assert (done.returncode, done.stdout) == (1, "lives\n")
    assert 'File "<string>", line 4' in done.stderr


def test_killed_node_is_named_and_its_end_is_everyones(scenario: Scenario, tmp_path: Path) -> None:
    killed: list[int] = []

    def kill_fdi(_done: int, _ticks: int) -> None:
        if not killed:
            killed.append(pid_of(FDI))
            os.kill(killed[0], signal.SIGKILL)

    with pytest.raises(RunError, match="node fdi died"):
        run_graph(scenario, tmp_path, progress=kill_fdi)
    assert not processes_that_mention(str(tmp_path))
    assert not read_bag(tmp_path).metadata["complete"]


#: A detector whose innovation is no number.
BROKEN_FDI = """
import sys
from ac_ros_common.loop_node import run_node
from fdi_node.node import FdiNode
class Broken(FdiNode):
    def send(self, time_ns, topic, *values):
        super().send(time_ns, topic, *(float("nan") if topic == "fdi/innovation/superheat" else v for v in values))
sys.exit(run_node(Broken))
"""


def test_lockstep_that_stands_still_is_given_up_and_says_what_was_refused(
    scenario: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_end, "STUCK_S", 6.0)
    broken = tmp_path / "broken.py"
    broken.write_text(BROKEN_FDI)
    said = r"the loop has stood still at tick 0 for 6 s; compensator refused 1 messages, the last: .*superheat.* finite"
    scenario = scenario.model_copy(update={"design": "paper"})  # whose compensator reads innovations
    with pytest.raises(RunError, match=said):
        run_graph(scenario, tmp_path / "out", user=user_nodes([f"fdi={sys.executable} {broken}"]))
    assert not processes_that_mention(str(tmp_path))


def test_what_a_node_leaves_in_its_process_group_ends_with_it(tmp_path: Path) -> None:
    """As a shell does that has started the node and is killed."""
    lasting = "import time; time.sleep(600)"
    code = f"import subprocess, sys; subprocess.Popen([sys.executable, '-c', '{lasting}', sys.argv[1]])"
    child = start("leaver", ["-c", code, str(tmp_path)], tmp_path, {})
    assert child.process.wait(10) == 0
    assert processes_that_mention(str(tmp_path))
    stop([child])
    wait_until_gone(tmp_path)


def test_only_what_an_earlier_run_has_left_makes_room(tmp_path: Path) -> None:
    for folder, names in (("log", ("fdi.log", "fdi.changed.yaml", "mine.log")), ("bag", ("bag_0.mcap", "notes.txt"))):
        (tmp_path / folder).mkdir()
        for name in names:
            (tmp_path / folder / name).write_text("")
    _prepare(tmp_path)
    assert {file.name for file in tmp_path.glob("*/*")} == {"mine.log", "notes.txt"}


def test_killed_recorder_loses_little(tmp_path: Path) -> None:
    done_before: list[int] = []
    called_s: list[float] = []

    def kill_recorder(done: int, _ticks: int) -> None:
        done_before.append(done)
        called_s.append(time.monotonic())
        if done > 100 and called_s[-1] - called_s[-2] > 0.8:
            os.kill(pid_of(RECORDER), signal.SIGKILL)

    with pytest.raises(RunError, match="node recorder died"):
        run_graph(load("nominal"), tmp_path, progress=kill_recorder)
    recorded = read_bag(tmp_path)
    # Health comes once a second; what was flushed half a second before the kill must be there.
    assert len(recorded.time_s) > done_before[-2]


def test_full_disk_is_the_recorders_clear_line(tmp_path: Path) -> None:
    # A limit on the size of files, inherited by the nodes, fails a write just as a full disk does.
    limited = "import resource, signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
    limited += "resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))\n"
    process = subprocess.run(
        [sys.executable, "-c", limited + RUNNER, str(tmp_path)], capture_output=True, text=True, timeout=120
    )
    assert process.returncode != 0
    assert "node recorder died" in process.stderr
    assert "File too large" in process.stderr
    assert len(complaints(process.stderr)) == 1
    assert not processes_that_mention(str(tmp_path))
    assert len(read_bag(tmp_path).time_s) > 50


def test_folder_that_cannot_be_written(scenario: Scenario, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="cannot be written"):
        run_graph(scenario, tmp_path / "file" / "out")


def test_two_runs_at_once_get_domains_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROS_DOMAIN_ID")
    first, second = Domain(), Domain()
    first.release()
    second.release()
    assert first.number != second.number


@pytest.mark.parametrize("number", ["233", "-1", "zero"])
def test_domain_that_cannot_be_is_refused(number: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", number)
    with pytest.raises(UserError, match="allowed: 0 to 232"):
        Domain()


def test_domain_in_use_is_refused(scenario: Scenario, tmp_path: Path) -> None:
    mine = Domain()
    try:
        with pytest.raises(UserError, match="in use by another run"):
            run_graph(scenario, tmp_path)
    finally:
        mine.release()


def pid_of(node: str) -> int:
    return node_processes()[node].pid
