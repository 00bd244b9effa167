"""The tutorial's commands, one after the other as a newcomer types them, in a folder of their own; runs shortened."""

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path
from urllib.request import urlopen

import pytest

from ac_experiments.bags.reader import read_bag

pytestmark = [pytest.mark.ros, pytest.mark.slow]

ROOT = Path(__file__).parents[2]
BIN = Path(sys.executable).parent
PAGE = (ROOT / "docs" / "tutorial" / "first-fault.md").read_text(encoding="utf-8")
#: Lines of the blocks that are to be typed, and commands within sentences.
BLOCKS = re.findall(r"^(?:python3 start\.py |\. |acftc ).+$", PAGE, re.MULTILINE)
IN_SENTENCES = re.findall(r"`(acftc [^`]+)`", PAGE)
#: The fault comes early, and the run ends when it has been isolated.
SHORT = ("--set", "duration_s=20", "--set", "faults.0.onset_s=5")


@pytest.fixture
def environment() -> dict[str, str]:
    return {**os.environ, "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}", "BROWSER": "true"}


def test_the_tutorial_has_these_commands() -> None:
    """What the tests below run; who changes the page changes them."""
    assert [" ".join(line.split()[:3]) for line in BLOCKS] == [
        "python3 start.py acftc",
        ". .venv/bin/activate",
        "acftc run actuator_fault",
        "acftc run actuator_fault",
        "acftc run sensor_fault",
        "acftc run sensor_fault",
        "acftc dash",
    ]
    assert [" ".join(command.split()[:2]) for command in IN_SENTENCES] == [
        "acftc run",
        "acftc topics",
        "acftc simulate",
        "acftc report",
        "acftc export",
        "acftc run",
        "acftc run",
    ]


def test_the_runs_of_the_tutorial(tmp_path: Path, environment: dict[str, str]) -> None:
    """From the list of scenarios to the four runs: each leaves what the page says it leaves, and nothing in the way."""
    listed = subprocess.run(
        shlex.split(BLOCKS[0])[2:], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )
    assert {"actuator_fault", "sensor_fault"} <= set(listed.stdout.split())
    simulate = IN_SENTENCES[2]
    runs = [line for line in BLOCKS if line.startswith("acftc run")]
    # Those between are these with the other one's fault, or without Q.
    for command in (runs[0], runs[-1], simulate):
        called = [*shlex.split(command), *SHORT, "--json"]
        done = subprocess.run(called, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=240)
        assert done.returncode == 0, done.stderr[-2000:]
        summary = json.loads(done.stdout)
        name = command.split()[2]
        assert summary["faults"][0]["isolated_as"] == {"a": "compressor_speed", "s": "evaporator_pressure"}[name[0]]
        assert summary["passive"] == ("--passive" in command)
        folder = tmp_path / re.search(r"--out (\S+)", command)[1]  # type: ignore[index]
        assert (folder / "report.html").stat().st_size > 100_000
        assert json.loads((folder / "summary.json").read_text(encoding="utf-8"))["scenario"] == name
        assert len(read_bag(folder / "bag").time_s) == 200
    for command in IN_SENTENCES[3:5]:
        done = subprocess.run(
            shlex.split(command), cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=240
        )
        assert done.returncode == 0, done.stderr[-2000:]
    assert (tmp_path / "results" / "first" / "comparison.html").stat().st_size > 100_000
    assert len((tmp_path / "results" / "eighty" / "run.csv").read_text(encoding="utf-8").splitlines()) == 201


def test_breaking_it_by_hand(tmp_path: Path, environment: dict[str, str]) -> None:
    """`acftc dash` serves a page, and `acftc topics` beside it shows what flows; Ctrl-C ends both."""
    dash, topics = BLOCKS[6], IN_SENTENCES[1]
    with subprocess.Popen(
        shlex.split(dash), cwd=tmp_path, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as page:
        try:
            assert page.stderr is not None
            said = page.stderr.readline()
            assert said.startswith("http://127.0.0.1:"), said
            assert b"acftc live" in urlopen(said.split()[0]).read()
            command = [*shlex.split(topics), "--json"]
            seen: set[str] = set()
            deadline_s = time.monotonic() + 120.0  # the page is there before the nodes behind it
            while "/ac/fdi/status" not in seen and time.monotonic() < deadline_s:
                shown = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
                seen = {topic["name"] for topic in json.loads(shown.stdout or "[]")}
        finally:
            page.send_signal(signal.SIGINT)
        assert page.wait(60) == 0
    assert "/ac/fdi/status" in seen


def test_a_run_with_the_page_beside_it(tmp_path: Path, environment: dict[str, str]) -> None:
    called = [*shlex.split(IN_SENTENCES[0]), "--set", "duration_s=2", "--no-report"]
    done = subprocess.run(called, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stderr.startswith("http://127.0.0.1:")
    assert len(read_bag(tmp_path / "results" / "nominal" / "bag").time_s) == 20
