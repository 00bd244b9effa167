"""The scenario of docs/how-to/own-scenario.md: through the graph for a while, and what the page says comes out."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from ac_experiments.scenario import load
from ac_experiments.simulate import simulate

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "how-to" / "own-scenario.md").read_text(encoding="utf-8")
RUN, *_ = re.findall(r"^acftc .*$", PAGE, re.MULTILINE)


@pytest.mark.ros
def test_it_runs_through_the_graph(shell: Callable[..., str]) -> None:
    changes = ("duration_s=6", "faults.0.onset_s=2", "faults.1.onset_s=4")
    summary = json.loads(shell(RUN, *(f"--set={change}" for change in changes), "--no-report", "--json"))
    assert (summary["scenario"], summary["ticks"]) == ("hot_afternoon", 60)


def test_what_the_page_says_comes_out() -> None:
    run = simulate(load(str(ROOT / "examples" / "own_scenario.yaml")))
    isolated = [(0.0, None)]
    for row in run.status:
        if row.isolated != isolated[-1][1]:
            isolated.append((row.time_s, row.isolated))
    (drift_s, first), *slips = [(time_s, fault) for time_s, fault in isolated if fault is not None]
    assert first == "evaporator_pressure"
    assert 300 < drift_s < 360  # a drift with a time constant of 60 s from 300 s on
    assert [fault for _, fault in slips] == ["compressor_speed"] * 3
    for (time_s, _), onset_s in zip(slips, (700, 900, 1100), strict=True):
        assert 0 < time_s - onset_s < 5
