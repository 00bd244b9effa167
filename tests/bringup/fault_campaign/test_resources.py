"""Full disks, folders that cannot be written, clocks that jump, many runs in a row: nothing half, nothing left."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tiny_runs import Held, growth, run_many

from ac_common.errors import RunError
from ac_common.files import write_whole
from ac_experiments.bags.reader import read_bag
from bringup.launch.shared_memory import sweep
from tests.said import complaints


def on_a_full_disk(*arguments: str, size_kib: int, out: Path) -> subprocess.CompletedProcess[str]:
    """Run acftc with ``--out`` on a disk of so many KiB that exists for this process only; `out` gets a copy."""
    disk = out / "disk"
    disk.mkdir(parents=True)
    command = " ".join([sys.executable, "-m", "bringup.cli", *arguments, "--out", str(disk / "run")])
    mount = f"mount -t tmpfs -o size={size_kib}k tmpfs {disk} || exit 77"
    script = f"{mount}; {command}; code=$?; cp -r {disk}/run {out}; exit $code"
    result = subprocess.run(
        ["unshare", "-Urm", "sh", "-c", script], capture_output=True, text=True, timeout=250, check=False
    )
    if result.returncode == 77 or "unshare" in result.stderr:
        pytest.skip(f"no disk of one's own can be mounted here: {result.stderr.strip()[:200]}")
    return result


def assert_one_line(result: subprocess.CompletedProcess[str], code: int, *words: str) -> None:
    assert result.returncode == code, result.stderr
    assert len(complaints(result.stderr)) == 1, result.stderr
    assert all(word in result.stderr for word in words), result.stderr


def test_full_disk_in_a_simulation_is_one_line_and_leaves_nothing_half(tmp_path: Path) -> None:
    result = on_a_full_disk("simulate", "nominal", "--set", "duration_s=10", size_kib=64, out=tmp_path)
    assert_one_line(result, 1, "cannot be written", "No space left on device")
    left = {file.name for file in (tmp_path / "run").rglob("*") if file.is_file()}
    assert "report.html" not in left
    assert not any(name.startswith(".") for name in left), left
    if "summary.json" in left:
        json.loads((tmp_path / "run" / "summary.json").read_text())


@pytest.mark.ros
def test_full_disk_in_a_run_is_one_line_and_the_bag_can_be_read(tmp_path: Path) -> None:
    result = on_a_full_disk("run", "nominal", "--set", "duration_s=300", size_kib=500, out=tmp_path)
    assert_one_line(result, 1, "recorder", "No space left on device")
    assert not (tmp_path / "run" / "summary.json").exists()
    recorded = read_bag(tmp_path / "run")
    assert 10 < len(recorded.time_s) < 3000
    assert not recorded.metadata["complete"]


def test_what_was_there_survives_a_write_that_fails(tmp_path: Path) -> None:
    file = tmp_path / "summary.json"
    write_whole(file, "old")
    probe = (
        "import resource, signal, sys; from pathlib import Path; from ac_common.files import write_whole\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN); resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
        "write_whole(Path(sys.argv[1]), 'x' * 5000)"
    )
    result = subprocess.run([sys.executable, "-c", probe, str(file)], capture_output=True, text=True, check=False)
    assert "RunError" in result.stderr
    assert "File too large" in result.stderr
    assert file.read_text() == "old"
    assert [item.name for item in tmp_path.iterdir()] == ["summary.json"]
    with pytest.raises(RunError, match="cannot be written: No such file"):
        write_whole(tmp_path / "missing" / "summary.json", "")


def test_folder_that_is_not_writable_is_one_line(tmp_path: Path) -> None:
    folder = tmp_path / "closed"
    folder.mkdir(mode=0o500)
    if os.getuid() == 0:
        folder = Path("/proc/self")  # root may write everywhere else
    command = [sys.executable, "-m", "bringup.cli", "simulate", "nominal", "--out", str(folder / "out")]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert_one_line(result, 2, "cannot be written to")


def test_many_tiny_scenarios_leave_nothing_behind(tmp_path: Path) -> None:
    seen = run_many(60, tmp_path, looks=3, say=None)
    assert not growth(seen), growth(seen)
    assert [item.name for item in tmp_path.iterdir()] == ["summary.json"]


def test_growth_is_noticed() -> None:
    before, after = Held(10, 100.0, 5, 1, 0, 0), Held(90, 130.0, 6, 1, 0, 2)
    assert growth([before, after]) == ["files from 5 to 6", "shared from 0 to 2", "memory from 100 to 130 MB"]
    assert growth([before, before]) == []


@pytest.mark.ros
def test_tiny_runs_through_the_graph_leave_nothing_behind() -> None:
    # In a process of its own: what earlier tests of this one still have mapped would be counted, too.
    script = Path(__file__).with_name("tiny_runs.py")
    command = [sys.executable, str(script), "--graph", "--runs", "2"]
    result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=200)
    assert result.returncode == 0, (result.stdout + result.stderr)[-3000:]


def test_shared_memory_of_a_killed_process_is_swept_and_that_of_a_living_one_is_not(tmp_path: Path) -> None:
    hold = "import fcntl, sys, time; f = open(sys.argv[1]); fcntl.flock(f, 2); print(flush=True); time.sleep(60)"
    holders = []
    for name in ("fastrtps_a", "fastrtps_b"):
        (tmp_path / name).write_bytes(bytes(100))
        (tmp_path / f"{name}_el").touch()
        command = [sys.executable, "-c", hold, str(tmp_path / f"{name}_el")]
        holders.append(subprocess.Popen(command, stdout=subprocess.PIPE))
    (tmp_path / "somebody_elses").touch()
    for holder in holders:
        assert holder.stdout is not None
        holder.stdout.readline()
    try:
        assert sweep(tmp_path, young_s=-1.0) == 0
        for file in tmp_path.iterdir():
            os.utime(file)  # however long the holders took to start
        holders[0].send_signal(signal.SIGKILL)
        holders[0].wait()
        assert sweep(tmp_path) == 0  # too young to be sure
        assert sweep(tmp_path, young_s=-1.0) == 2
    finally:
        for holder in holders:
            holder.kill()
            holder.communicate()
    assert {item.name for item in tmp_path.iterdir()} == {"fastrtps_b", "fastrtps_b_el", "somebody_elses"}


@pytest.mark.ros
@pytest.mark.clock
def test_a_clock_that_jumps_does_not_disturb_a_run(tmp_path: Path) -> None:
    """The wall clock of every node goes back an hour in the middle of a realtime run; ticks keep to the other clock."""
    (tmp_path / "sitecustomize.py").write_text(JUMP)
    out = tmp_path / "out"
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    command = [sys.executable, "-m", "bringup.cli", "run", "nominal", "--mode", "realtime", "--set", "duration_s=6"]
    result = subprocess.run(
        [*command, "--no-report", "--out", str(out)],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env=environment,
    )
    assert result.returncode == 0, result.stderr
    recording = read_bag(out)
    assert recording.metadata["complete"]
    np.testing.assert_array_equal(np.diff(recording.time_s) > 0.0, True)
    assert len(recording.time_s) == 60
    assert np.isnan(recording.series["plant/superheat"]).sum() <= recording.metadata["missed_ticks"]


#: Makes `time.time` and `time.time_ns` of a process jump back by an hour some seconds after its start.
JUMP = """
import time
_began, _time, _time_ns = time.monotonic(), time.time, time.time_ns
_back_s = lambda: 3600 if time.monotonic() - _began > 6.0 else 0
time.time = lambda: _time() - _back_s()
time.time_ns = lambda: _time_ns() - _back_s() * 10**9
"""
