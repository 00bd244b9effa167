"""`acftc study` as a user meets it: real processes, one line on stderr, exit codes."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.said import complaints

STUDY = """
scenario: actuator_fault
set: {duration_s: 30, faults.0.onset_s: 10, noise.superheat_k: 0.02}
runs: 4
vary:
  faults.0.size_rpm: {uniform: [20, 60]}
  plant: {normal: [0, 0.2]}
"""


def acftc(*arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "bringup.cli", *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, check=False, timeout=250)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study of four short runs, each of another plant."""
    where = tmp_path_factory.mktemp("study")
    (where / "mine.yaml").write_text(STUDY)
    result = acftc("study", "mine.yaml", "--out", "done", "--workers", "1", "--json", cwd=where)
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout) == json.loads((where / "done" / "study.json").read_text())
    assert "runs in" in result.stderr
    return where


def test_the_built_in_studies_are_listed() -> None:
    result = acftc("study", "--list")
    assert result.returncode == 0, result.stderr
    for name in ("envelope_healthy", "envelope_faults", "small_faults", "paper_points", "driver_cost"):
        assert name in result.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["study", "smal_faults"], ["did you mean 'small_faults'"]),
        (["study", "missing.yaml"], ["missing.yaml", "cannot be read"]),
        (["study", "small_faults", "--runs", "0"], ["--runs", "acftc study run --help"]),
        (["study", "rerun", "missing", "3"], ["missing", "cannot be read"]),
        (["study", "compare", "missing", "missing"], ["missing", "cannot be read"]),
        (["study", "worst", "small_faults", "--metric", "harn"], ["did you mean 'harm'"]),
        (["study", "small_faults", "--out", "nowhere://a"], ["nowhere://a", "cannot be written to"]),
    ],
)
def test_bad_input_is_one_line(arguments: list[str], words: list[str], tmp_path: Path) -> None:
    result = acftc(*arguments, cwd=tmp_path)
    assert result.returncode == 2, result.stderr
    assert len(complaints(result.stderr)) == 1, result.stderr
    for word in words:
        assert word in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_run_is_played_again_with_its_report(folder: Path) -> None:
    result = acftc("study", "rerun", "done", "2", "--out", "again", cwd=folder)
    assert result.returncode == 0, result.stderr
    assert "the same as run 2 of the study, to the last bit" in result.stderr
    assert {"scenario.yaml", "plant.yaml", "summary.json", "report.html"} <= {
        item.name for item in (folder / "again").iterdir()
    }
    result = acftc("study", "rerun", "done", "4", cwd=folder)
    assert result.returncode == 2
    assert "has runs 0 to 3, not 4" in result.stderr


def test_studies_are_compared(folder: Path) -> None:
    result = acftc("study", "compare", "done", "done", "--json", cwd=folder)
    assert result.returncode == 0, result.stderr
    rows = json.loads(result.stdout)
    assert all(row["difference"]["value"] == 0.0 for row in rows)
    assert "B - A" in acftc("study", "compare", "done", "done", cwd=folder).stdout


@pytest.mark.ros
def test_a_run_is_played_again_through_the_graph(folder: Path) -> None:
    """The plant is the run's, the designs are those of the plant in use: the same numbers as in one process."""
    result = acftc("study", "rerun", "done", "1", "--graph", "--out", "graph", cwd=folder)
    assert result.returncode == 0, result.stderr
    assert (folder / "graph" / "bag").is_dir()
    assert "the same as run 1 of the study, to the last bit" in result.stderr
