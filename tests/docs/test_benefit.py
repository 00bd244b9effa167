"""The figures of the page on what accommodation buys are those of the runs that it names."""

import re
from functools import cache
from typing import Any

import pytest

from ac_experiments.metrics import summarise
from ac_experiments.scenario import load
from ac_experiments.simulate import simulate
from tests.docs.test_site import ROOT

TEXT = (ROOT / "docs" / "benefit.md").read_text(encoding="utf-8")


@cache
def summary(scenario: str, passive: bool) -> dict[str, Any]:
    return summarise(simulate(load(scenario), passive=passive))


def row(table: str, name: str) -> list[str]:
    """The two cells of a row of the table whose head begins with `table`."""
    (found,) = re.findall(rf"^\| {re.escape(table)} \|.*?\n\n", TEXT, re.MULTILINE | re.DOTALL)
    (cells,) = re.findall(rf"^\| {re.escape(name)} \| (.*?) \| (.*?) \|$", found, re.MULTILINE)
    return list(cells)


def back(fault: dict[str, Any]) -> str:
    return "never" if fault["settled_s"] is None else f"after {fault['settled_s'] - fault['onset_s']:.1f} s"


@pytest.mark.parametrize(
    ("table", "scenario"), [("5 kPa too high", "sensor_fault"), ("40 rpm too fast", "actuator_fault")]
)
def test_the_tables_are_those_of_the_runs(table: str, scenario: str) -> None:
    runs = [summary(scenario, passive) for passive in (False, True)]
    faults = [run["faults"][0] for run in runs]
    peak = "... at most" if scenario == "sensor_fault" else "actual p_e off its reference, at most"
    assert row(table, peak) == [f"{fault['peak_pressure_error_kpa']:.2f} kPa" for fault in faults]
    assert row(table, "... back within 0.25 kPa") == [back(fault) for fault in faults]
    after = [f"after {fault['isolated_s'] - fault['onset_s']:.1f} s" for fault in faults]
    assert row(table, "isolated, by its name") == [after[0], f"{after[1]}, and nothing follows"]
    changes = [run["metrics"]["command_change_rpm"] for run in runs]
    if scenario == "actuator_fault":
        assert row(table, "command at rest, against before") == [f"{change:+.1f} rpm" for change in changes]
        superheat = [f"{run['metrics']['peak_superheat_error_k']:.2f} K" for run in runs]
        assert row(table, "actual superheat off its reference, at most") == superheat
        return
    assert row(table, "compressor at rest, against before") == [f"{changes[0]:+.1f} rpm", f"{changes[1]:+.0f} rpm"]
    steady = [f"{run['metrics']['steady_pressure_error_kpa']:.1f} kPa".replace("-0.0", "0.0") for run in runs]
    assert row(table, "actual p_e at rest, off its reference") == steady
    work = [f"{run['energy_kj']['compressor']:.0f} kJ" for run in runs]
    assert row(table, "work of the compressor over the 1000 s") == work
    assert row(table, "COP over the run") == [f"{run['cop']:.2f}" for run in runs]
