"""The table of the car's scenarios in docs/plant.md is what comes out today."""

import os
from pathlib import Path

import pytest

from ac_experiments.scenario import load
from ac_experiments.simulate import simulate
from docs.tools.car_pictures import HEADS, SCENARIOS, row

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "plant.md").read_text(encoding="utf-8").splitlines()


def cycle() -> str:
    """The real schedule where it is at hand, as in the tests of the scenarios with a car."""
    file = os.environ.get("ACFTC_SC03")
    return file or pytest.skip("SC03 not at hand: set ACFTC_SC03 to the EPA's file")


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_row_is_what_is_simulated(name: str) -> None:
    scenario = load(name, [f"car.drive_cycle={cycle()}"] if name == "sc03" else [])
    cells = row(simulate(scenario), scenario.has_belt)
    assert len(cells) == len(HEADS)
    assert f"| {' | '.join(HEADS)} |" in PAGE
    assert f"| {' | '.join(cells)} |" in PAGE, "run `python -m docs.tools.car_pictures`"
