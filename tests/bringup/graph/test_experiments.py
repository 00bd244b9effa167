"""The paper's E5 and E6, with everything sooner, through the graph: as simulated, and within the required figures."""

from pathlib import Path

import pytest

from ac_experiments.bags.reader import read_bag
from ac_experiments.metrics import summarise
from ac_experiments.scenario import load
from ac_experiments.simulate import simulate
from bringup.launch.launch import run_graph

pytestmark = pytest.mark.ros


SOONER = [
    "duration_s=130",
    "faults.0.onset_s=40",
    *(
        f"references.{name}.0.{key}=10"
        for name in ("evaporator_pressure_kpa", "superheat_k")
        for key in ("at_s", "ramp_s")
    ),
]


@pytest.mark.parametrize("name", ["actuator_fault", "sensor_fault"])
def test_an_experiment_gives_the_summary_of_the_simulation(name: str, tmp_path: Path) -> None:
    scenario = load(name, SOONER)
    run = run_graph(scenario, tmp_path)
    recorded, simulated = summarise(read_bag(run.bag)), summarise(simulate(scenario))
    assert recorded["ticks"] == scenario.ticks
    about_the_run = {"mode", "started", "wall_seconds", "real_time_factor"}
    assert {k: v for k, v in recorded.items() if k not in about_the_run} == {
        k: v for k, v in simulated.items() if k not in about_the_run
    }
    commanded = {"actuator_fault": -40.0, "sensor_fault": 0.0}[name]
    assert recorded["metrics"]["command_change_rpm"] == pytest.approx(commanded, abs=0.5)
    assert recorded["metrics"]["peak_pressure_error_kpa"] < 1.0
