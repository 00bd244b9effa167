"""Choices of a scenario through real processes, the numbers of the simulation: derived superheat, the paper's K0."""

from pathlib import Path

import numpy as np
import pytest

from ac_common.topics import SERIES
from ac_experiments.bags.reader import read_bag
from ac_experiments.scenario import load
from ac_experiments.simulate import simulate
from bringup.launch.launch import run_graph

pytestmark = pytest.mark.ros


def test_graph_and_simulation_agree_on_a_derived_superheat(tmp_path: Path) -> None:
    scenario = load("sensor_fault_derived", ["duration_s=20", "references={}", "faults.0.onset_s=5"])
    recorded, simulated = read_bag(run_graph(scenario, tmp_path).bag), simulate(scenario)
    assert np.abs(recorded.series["measured/superheat"] - recorded.series["plant/superheat"]).max() > 0.1
    for key in SERIES:
        np.testing.assert_array_equal(recorded.series[key], simulated.series[key], err_msg=key)
    assert [row.isolated for row in recorded.status] == [row.isolated for row in simulated.status]
    assert recorded.status[-1].isolated == "evaporator_pressure"


def test_graph_and_simulation_agree_on_the_paper_s_controller(tmp_path: Path) -> None:
    scenario = load("actuator_fault", ["controller=paper", "duration_s=20", "references={}", "faults.0.onset_s=5"])
    recorded, simulated = read_bag(run_graph(scenario, tmp_path).bag), simulate(scenario)
    for key in SERIES:
        np.testing.assert_array_equal(recorded.series[key], simulated.series[key], err_msg=key)
    ours = simulate(scenario.model_copy(update={"controller": "tracking"}))
    difference = recorded.series["controller/command:compressor"] - ours.series["controller/command:compressor"]
    assert np.abs(difference).max() > 1.0
