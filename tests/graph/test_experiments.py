"""The paper's E5 and E6 whole, through the graph: the simulation's figures (`tests/controller` has the bars)."""

from pathlib import Path

import pytest

from bringup.bags.reader import read_bag
from bringup.loop import simulate
from bringup.ros.graph import run_graph
from bringup.scenario import load
from bringup.summary import summarise

pytestmark = pytest.mark.ros


@pytest.mark.parametrize("name", ["actuator_fault", "sensor_fault"])
def test_whole_experiment_gives_the_summary_of_the_simulation(name: str, tmp_path: Path) -> None:
    run = run_graph(load(name), tmp_path)
    recorded, simulated = summarise(read_bag(run.bag)), summarise(simulate(load(name)))
    assert recorded["ticks"] == load(name).ticks
    about_the_run = {"mode", "started", "wall_seconds", "real_time_factor"}
    assert {k: v for k, v in recorded.items() if k not in about_the_run} == {
        k: v for k, v in simulated.items() if k not in about_the_run
    }
