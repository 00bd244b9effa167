"""A run with a car through real processes: the simulation's numbers, its topics complete, replayed alike."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ac_common.topics import CABIN_SERIES, CAR, CAR_SERIES, CONTROLLER, FDI, NAMESPACE, PLANT, SERIES
from ac_experiments.bags.reader import read_bag, read_raw
from ac_experiments.scenario import check
from ac_experiments.simulate import simulate
from bringup.launch.launch import GraphRun, run_graph
from bringup.replay.replay import replay

pytestmark = pytest.mark.ros

FELT = "fdi/innovation/evaporator_pressure"

#: Off and through a shift of gears, on the belt, under a blower that is turned up.
CAR_ON_THE_BELT: dict[str, Any] = {
    "name": "car",
    "duration_s": 12.0,
    "passive": True,
    "references": {"superheat_k": [{"at_s": 1, "to": -2, "ramp_s": 4}]},
    "car": {
        "outside_temperature_c": [[0, 35], [10, 36]],
        "sun_w_m2": 800,
        "recirculation_percent": 60,
        "blower_kg_s": [[0, 0.12], [4, 0.15]],
        "vehicle_speed_km_h": [[2, 0], [8, 30]],
        "cabin": 33,
        "compressor_drive": "belt",
    },
    "faults": [
        {"kind": "condenser_fan", "size_percent": 60, "onset_s": 3},
        {"kind": "air_inlet_sensor", "profile": "stuck", "onset_s": 3.5},
    ],
    "noise": {"superheat_k": 0.02, "seed": 3},
}


@pytest.fixture(scope="module")
def car(tmp_path_factory: pytest.TempPathFactory) -> GraphRun:
    return run_graph(check(CAR_ON_THE_BELT), tmp_path_factory.mktemp("car"))


def test_graph_gives_the_numbers_of_the_simulation(car: GraphRun) -> None:
    recorded, simulated = read_bag(car.bag), simulate(check(CAR_ON_THE_BELT))
    assert recorded.metadata["complete"]
    assert set(recorded.series) == {*SERIES, *CAR_SERIES, *CABIN_SERIES} == set(simulated.series)
    for key, values in simulated.series.items():
        np.testing.assert_array_equal(recorded.series[key], values, err_msg=key)
    speed = simulated.series["controller/command:compressor"]
    np.testing.assert_array_equal(speed, simulated.series["scenario/car:belt_speed"])
    assert speed.max() > 2.0 * speed.min()
    raw = read_raw(car.bag)
    assert all(len(raw.messages[f"{NAMESPACE}/{topic.name}"]) == len(recorded.time_s) for topic in CAR)


@pytest.mark.parametrize("node", [PLANT, CONTROLLER])
def test_nodes_that_know_the_car_replay_alike(car: GraphRun, node: str) -> None:
    result = replay(car.bag, node)
    assert result.ticks == 120
    assert not result.different, result.differences


def test_electric_compressor_in_a_soaked_car_whose_blower_is_known(tmp_path: Path) -> None:
    content = {**CAR_ON_THE_BELT, "duration_s": 4.0, "air_flow_sensor": "blower"}
    more = {"compressor_drive": "electric", "cabin": "soaked", "blower_kg_s": [[0, 0.12], [2, 0.18]]}
    content["car"] = {**CAR_ON_THE_BELT["car"], **more}
    run = run_graph(check(content), tmp_path)
    recorded, simulated = read_bag(run.bag), simulate(check(content))
    for key, values in simulated.series.items():
        np.testing.assert_array_equal(recorded.series[key], values, err_msg=key)
    assert not simulated.series["scenario/car:belt_speed"].any()
    assert simulated.series["plant/car:cabin_air"][0] > 50.0
    unknown = simulate(check({**content, "air_flow_sensor": "none"}))
    assert not np.array_equal(unknown.series[FELT], simulated.series[FELT])
    result = replay(run.bag, FDI)
    assert result.ticks == 40
    assert not result.different, result.differences


def test_live_changes_of_what_is_a_result_in_a_car_are_refused() -> None:
    code = (
        "import json, rclpy, sys; from rclpy.parameter import Parameter\n"
        "from bringup.nodes.scenario import ScenarioNode\n"
        "rclpy.init(); node = ScenarioNode()\n"
        "def change(name, value):\n"
        "    result = node.set_parameters([Parameter(name, value=value)])[0]\n"
        "    return result.reason if not result.successful else ''\n"
        "def configured(scenario):\n"
        "    change('scenario', scenario)\n"
        "    return node.trigger_configure().name\n"
        "said = [change('air.inlet_temperature_k', 2.0), configured('pull_down'), node.health.problem]\n"
        "said += [change('air.inlet_temperature_k', 0.0), configured('pull_down')]\n"
        "said += [change(name, value) for name, value in json.loads(sys.argv[1])]\n"
        "node.trigger_cleanup()\n"
        "said += [configured('nominal'), change('air.inlet_temperature_k', 2.0)]\n"
        "print(json.dumps(said))"
    )
    tried = [
        ("air.inlet_temperature_k", -3.0),
        ("air.condenser_mass_flow_percent", 10.0),
        ("air.condenser_mass_flow_percent", 0.0),
        ("air.mass_flow_percent", 10.0),
        ("air.condenser_inlet_temperature_k", 2.0),
    ]
    given = [sys.executable, "-c", code, json.dumps(tried)]
    done = subprocess.run(given, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    why = "in a car, where inlet air of the evaporator and air flow of the condenser are results"
    assert json.loads(done.stdout.splitlines()[-1]) == [
        "", "FAILURE", f"air.inlet_temperature_k: given 2; allowed: 0 {why}",
        "", "SUCCESS",
        f"air.inlet_temperature_k: given -3; allowed: 0 {why}",
        f"air.condenser_mass_flow_percent: given 10; allowed: 0 {why}",
        "", "", "",
        "SUCCESS", "",
    ]  # fmt: skip
