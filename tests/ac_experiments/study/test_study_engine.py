"""Whatever happens to a study under way, its results are the same to the byte; or it says in one line what is wrong."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import psutil
import pyarrow.parquet as pq
import pytest
from distributed import LocalCluster

from ac_common.errors import RunError, UserError
from ac_experiments.study import engine
from ac_experiments.study.engine import run_study
from ac_experiments.study.results import RUNS, Store
from ac_experiments.study.schema import load_study
from tests.said import complaints

RUNS_IN_ALL = 24
#: Where Dask has its web server unless it is told otherwise.
DASK_PORT = 8787
STUDY = f"""
scenario: actuator_fault
set: {{duration_s: 40, noise.superheat_k: 0.05}}
runs: {RUNS_IN_ALL}
seed: 7
k0_alone: true
vary:
  faults.0.size_rpm: {{uniform: [-60, 60]}}
  faults.0.onset_s: {{uniform: [5, 20]}}
"""


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("study") / "tiny.yaml"
    path.write_text(STUDY)
    return path


@pytest.fixture(scope="module")
def here() -> Iterator[str]:
    """Address of a cluster in this process, which has all code loaded and compiled."""
    with LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0") as cluster:
        yield cluster.scheduler_address


@pytest.fixture(scope="module")
def undisturbed(file: Path, here: str) -> bytes:
    """The runs of the study, played by one worker without a break; to a folder in memory, as fsspec has it."""
    store = Store("memory://undisturbed")
    timing = run_study(load_study(file), store, scheduler=here)
    assert timing.runs == RUNS_IN_ALL
    return store.read(RUNS)


def command(file: Path, out: Path | str, *more: str) -> list[str]:
    return [sys.executable, "-m", "bringup.cli", "study", str(file), "--out", str(out), "--workers", "2", *more]


def resumed(file: Path, out: Path, here: str) -> bytes:
    """The runs of a study that was stopped, once it has been gone on with."""
    run_study(load_study(file), Store(str(out)), scheduler=here, resume=True)
    return (out / RUNS).read_bytes()


def started(file: Path, out: Path, *more: str) -> subprocess.Popen[str]:
    """A study as a user starts it, in a process group of its own."""
    return subprocess.Popen(
        command(file, out, *more), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )


def parts(out: Path) -> list[Path]:
    return sorted((out / "parts").glob("runs-*.parquet"))


def wait_for(condition: Callable[[], bool], process: subprocess.Popen[str]) -> None:
    """Return as soon as something holds; fail when the study ends before."""
    while not condition():
        try:
            process.wait(0.01)
        except subprocess.TimeoutExpired:
            continue
        pytest.fail(f"the study ended before: {process.communicate()}")


def workers_of(process: subprocess.Popen[str]) -> list[psutil.Process]:
    return [child for child in psutil.Process(process.pid).children() if "spawn_main" in " ".join(command_of(child))]


def command_of(process: psutil.Process) -> list[str]:
    """Return the command line of a process, none where it has ended meanwhile."""
    try:
        return process.cmdline()
    except psutil.NoSuchProcess:  # a zombie, too
        return []


@pytest.fixture
def out(tmp_path: Path) -> Iterator[Path]:
    yield tmp_path / "out"
    for process in psutil.process_iter(["cmdline"]):
        if str(tmp_path) in " ".join(process.info["cmdline"] or []):
            process.kill()


def test_two_workers_give_the_bytes_of_one(file: Path, out: Path, undisturbed: bytes) -> None:
    with socket.socket() as another:
        with contextlib.suppress(OSError):  # another's already
            another.bind(("", DASK_PORT))
            another.listen()
        result = subprocess.run(command(file, out), capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert str(DASK_PORT) not in result.stderr
    assert (out / RUNS).read_bytes() == undisturbed
    table = pq.read_table(out / RUNS)
    assert table["run"].to_pylist() == list(range(RUNS_IN_ALL))
    assert {"study.json", "study.html", "study.svg", "study.yaml"} <= {item.name for item in out.iterdir()}
    # Again: refused in one line; with --resume there is nothing left to play.
    again = subprocess.run(command(file, out), capture_output=True, text=True, check=False)
    assert again.returncode == 2
    assert len(complaints(again.stderr)) == 1
    assert "--resume" in again.stderr
    assert run_study(load_study(file), Store(str(out)), resume=True).runs == 0


def test_a_killed_workers_batch_is_run_again(file: Path, out: Path, undisturbed: bytes) -> None:
    process = started(file, out)
    for number in (1, 3):
        wait_for(lambda number=number: len(parts(out)) >= number and len(workers_of(process)) > 0, process)
        workers_of(process)[0].kill()
    _, said = process.communicate(timeout=200)
    assert process.returncode == 0, said
    assert (out / RUNS).read_bytes() == undisturbed


def test_a_result_that_dies_with_its_worker_is_played_again(
    file: Path, out: Path, undisturbed: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The worker is killed after a batch has come back, and before the client has asked what it returned."""
    next_of, killed = engine._Dealer._next, []

    def next_and_kill(dealer: engine._Dealer) -> Any:
        future = next_of(dealer)
        if future is not None and not killed:
            (worker,) = dealer._client.who_has([future])[future.key]
            killed.append(dealer._client.run(os.getpid, workers=[worker])[worker])
            os.kill(killed[0], signal.SIGKILL)
            deadline = time.monotonic() + 60.0
            while future.status != "lost":
                assert time.monotonic() < deadline
                time.sleep(0.001)
        return future

    monkeypatch.setattr(engine._Dealer, "_next", next_and_kill)
    run_study(load_study(file), Store(str(out)), workers=2)
    assert killed
    assert (out / RUNS).read_bytes() == undisturbed


def test_a_killed_client_is_resumed(file: Path, out: Path, here: str, undisturbed: bytes) -> None:
    process = started(file, out)
    wait_for(lambda: len(parts(out)) >= 3, process)
    left = workers_of(process)
    process.kill()
    process.wait()
    psutil.wait_procs(left, timeout=60)
    assert not [worker for worker in left if worker.is_running() and worker.status() != psutil.STATUS_ZOMBIE]
    before = {part: part.stat().st_mtime_ns for part in parts(out)}
    assert before
    assert resumed(file, out, here) == undisturbed
    assert before.items() <= {part: part.stat().st_mtime_ns for part in parts(out)}.items()  # nothing is played twice
    rows = [run for part in parts(out) for run in pq.read_table(part)["run"].to_pylist()]
    assert sorted(rows) == list(range(RUNS_IN_ALL))
    assert not [item for item in (out / "parts").iterdir() if item.name.startswith(".")]


def test_ctrl_c_leaves_what_is_done(file: Path, out: Path, here: str, undisturbed: bytes) -> None:
    process = started(file, out)
    wait_for(lambda: len(parts(out)) >= 2, process)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the workers, too
    _, said = process.communicate(timeout=100)
    assert process.returncode == 130, said
    assert len(complaints(said)) == 1, said
    assert "--resume" in said
    assert "interrupted with" in said
    assert not (out / RUNS).exists()
    assert resumed(file, out, here) == undisturbed


def test_a_full_disk_is_one_line_and_resumable(file: Path, tmp_path: Path, here: str, undisturbed: bytes) -> None:
    disk, kept = tmp_path / "disk", tmp_path / "kept"
    disk.mkdir()
    line = " ".join(command(file, disk / "run"))
    mount = f"mount -t tmpfs -o size=128k tmpfs {disk} || exit 77"
    script = f"{mount}; {line}; code=$?; cp -r {disk}/run {kept}; exit $code"
    result = subprocess.run(["unshare", "-Urm", "sh", "-c", script], capture_output=True, text=True, check=False)
    if result.returncode == 77 or "unshare" in result.stderr:
        pytest.skip(f"no disk of one's own can be mounted here: {result.stderr.strip()[:200]}")
    assert result.returncode == 1, result.stderr
    assert len(complaints(result.stderr)) == 1, result.stderr
    assert "No space left on device" in result.stderr
    assert "--resume" in result.stderr
    assert resumed(file, kept, here) == undisturbed


SCHEDULER = """
import sys
from distributed import LocalCluster
if __name__ == "__main__":
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0") as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""


def test_a_scheduler_that_is_gone_is_one_line_and_resumable(
    file: Path, out: Path, here: str, undisturbed: bytes
) -> None:
    cluster = subprocess.Popen(
        [sys.executable, "-c", SCHEDULER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert cluster.stdout is not None
    process = started(file, out, "--scheduler", cluster.stdout.readline().strip())
    wait_for(lambda: len(parts(out)) >= 2, process)
    cluster.kill()
    cluster.wait()
    _, said = process.communicate(timeout=100)
    assert process.returncode == 1, said
    assert len(complaints(said)) == 1, said
    assert "the scheduler is gone" in said
    assert resumed(file, out, here) == undisturbed


def test_what_cannot_be_gone_on_with_is_said_in_one_line(file: Path, tmp_path: Path) -> None:
    store = Store(str(tmp_path))
    study = load_study(file)
    with pytest.raises(UserError, match="cannot be reached"):
        run_study(study, store, scheduler="tcp://127.0.0.1:9")
    with pytest.raises(UserError, match="holds another study than tiny"):
        run_study(load_study(file, {"seed": 8}), store, resume=True)
    (tmp_path / "made_with.txt").write_text("another\n")
    with pytest.raises(UserError, match="another version of the program"):
        run_study(study, store, resume=True)


def test_a_worker_with_other_code_is_refused(file: Path, tmp_path: Path) -> None:
    from ac_experiments.study.engine import begin, play_batch

    store, study = Store(str(tmp_path)), load_study(file)
    begin(study, store, resume=False)
    with pytest.raises(RunError, match="another version of the program"):
        play_batch(store.url, study.identity, "other code", 0, 1)
