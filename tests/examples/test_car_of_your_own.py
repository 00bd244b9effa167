"""The commands of docs/how-to/own-car.md: another refrigerant and car, calibrated, designed for, run in the graph."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "how-to" / "own-car.md").read_text(encoding="utf-8")


@pytest.mark.ros
def test_commands_of_the_page(shell: Callable[..., str], folder: Path) -> None:
    calibrate, equilibria, run = re.findall(r"^acftc .*$", PAGE, re.MULTILINE)
    (folder / "results").mkdir()
    shell(calibrate)
    med = json.loads(shell(equilibria, "--json"))["med"]
    assert med["superheat_k"] == pytest.approx(15.0, abs=0.01)
    assert med["evaporator_pressure_kpa"] == pytest.approx(265.0, abs=0.01)
    changes = ("--set", "duration_s=20", "--set", "faults.0.onset_s=5")
    summary = json.loads(shell(run, *changes, "--no-report", "--json"))
    assert summary["faults"][0]["isolated_as"] == "compressor_speed"
    assert 0 < summary["metrics"]["peak_pressure_error_kpa"] < 1.0
