"""`acftc run` as a user meets it: real nodes over DDS, what it leaves behind, and what Ctrl-C leaves behind."""

import json
import os
import signal
import subprocess
import sys
import uuid
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import psutil
import pytest

from ac_common.topics import SERIES
from ac_experiments.bags.reader import read_bag
from ac_experiments.scenario import load
from ac_experiments.simulate import simulate
from tests.said import complaints

pytestmark = pytest.mark.ros

SHORT = {
    "actuator_fault": ["duration_s=12", "faults.0.onset_s=4", "references={}"],
    "isolation_two_sensors": [
        "duration_s=12",
        "faults=[{kind: evaporator_pressure, size_kpa: 5, onset_s: 4}]",
        "air={}",
    ],
}
#: One report will do.
REPORTED = "actuator_fault"


@pytest.fixture
def marked() -> Iterator[tuple[dict[str, str], str]]:
    """Environment that every child process inherits, and the mark to find them by."""
    mark = f"acftc-test-{uuid.uuid4()}"
    yield {**os.environ, "ACFTC_TEST_MARK": mark}, mark
    assert left_over(mark) == []


def left_over(mark: str) -> list[str]:
    return [
        " ".join(process.info["cmdline"] or [])
        for process in psutil.process_iter(["cmdline", "environ"])
        if mark in (process.info["environ"] or {}).values()
    ]


def acftc(*arguments: str, environment: dict[str, str]) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "bringup.cli", *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)


def assert_cut_recording_has_a_report(out_dir: Path, environment: dict[str, str]) -> None:
    """Whatever is left of a recording has one, as soon as there is a tick in it."""
    (file,) = (out_dir / "bag").glob("*.mcap")
    cut = out_dir / "cut.mcap"
    cut.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    report = acftc("report", str(cut), "--alone", "--json", "--out", f"{out_dir}/cut.html", environment=environment)
    out, err = report.communicate(timeout=240)
    assert report.returncode == 0, err
    assert not json.loads(out)["complete"]
    assert 10 < json.loads(out)["ticks"] < 120
    assert "cut short" in (out_dir / "cut.html").read_text()


@pytest.mark.parametrize("name", SHORT)
def test_a_run_leaves_bag_summary_and_report_and_agrees_with_the_simulation(name: str, tmp_path: Path, marked):
    environment, _ = marked
    overrides = [word for change in SHORT[name] for word in ("--set", change)]
    overrides += [] if name == REPORTED else ["--no-report"]
    run = acftc("run", name, "--out", str(tmp_path), "--json", *overrides, environment=environment)
    out, err = run.communicate(timeout=240)
    assert run.returncode == 0, err
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert json.loads(out) == summary
    assert summary["mode"] == "lockstep"
    assert summary["ticks"] == 120
    assert (tmp_path / "bag" / "metadata.yaml").exists()

    recording = read_bag(tmp_path / "bag")
    alone = simulate(load(name, SHORT[name]))
    for key in SERIES:
        # The same functions in the same order: not even rounding differs.
        assert np.array_equal(recording.series[key], alone.series[key]), key
    assert [(row.detected, row.isolated) for row in recording.status] == [
        (row.detected, row.isolated) for row in alone.status
    ]

    replay = acftc("replay", str(tmp_path / "bag"), "--node", "fdi", "--json", environment=environment)
    out, err = replay.communicate(timeout=240)
    assert replay.returncode == 0, err
    answer = json.loads(out)
    assert answer["compared"] == answer["identical"] == 6 * 120

    if name == REPORTED:
        assert (tmp_path / "report.html").stat().st_size > 1_000_000  # plotly is inside
        assert_cut_recording_has_a_report(tmp_path, environment)


#: The signals that end a run, and how many lines it has to say: the second one is told that the end is under way.
@pytest.mark.parametrize(
    ("numbers", "lines"), [([signal.SIGINT], 1), ([signal.SIGTERM], 1), ([signal.SIGINT, signal.SIGINT], 2)]
)
def test_a_run_that_is_stopped_says_so_in_one_line_and_leaves_a_readable_bag(tmp_path: Path, marked, numbers, lines):
    environment, mark = marked
    long = ["--set", "duration_s=3000"]
    run = acftc("run", "nominal", "--out", str(tmp_path), *long, environment=environment)
    bag = tmp_path / "bag" / "bag_0.mcap"
    # The recorder has written ticks: the loop is running.
    while not (bag.exists() and bag.stat().st_size > 200_000):
        with pytest.raises(subprocess.TimeoutExpired):  # it is still running
            run.wait(timeout=0.1)
    run.send_signal(numbers[0])
    for number in numbers[1:]:
        with pytest.raises(subprocess.TimeoutExpired):  # the nodes take longer to end
            run.wait(timeout=0.1)
        run.send_signal(number)
    out, err = run.communicate(timeout=120)
    assert run.returncode == 130, err
    assert len(complaints(err)) == lines
    assert "interrupted" in err
    assert "Traceback" not in err
    assert out == ""
    assert left_over(mark) == []
    recording = read_bag(tmp_path / "bag")
    assert not recording.metadata["complete"]
    assert np.isfinite(recording.series["plant/evaporator_pressure"]).sum() > 50
