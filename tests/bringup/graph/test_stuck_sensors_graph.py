"""Sensors that stand still in a running graph: to the bit as in the simulation, and started and stopped live."""

from pathlib import Path

import numpy as np
import pytest

from ac_common.faults import STICKING
from ac_common.topics import INJECTOR, SERIES, truth_of
from ac_experiments.bags.reader import read_bag
from ac_experiments.scenario import check
from ac_experiments.simulate import simulate
from bringup.launch.launch import run_graph
from tests.operator import Operator

pytestmark = pytest.mark.ros

NOISE = {"evaporator_pressure_kpa": 0.05, "superheat_k": 0.05, "wall_temperature_k": 0.05, "seed": 3}
AIR = {
    "mass_flow_percent": [{"at_s": 0.5, "to": 10.0, "ramp_s": 5}],
    "inlet_temperature_k": [{"at_s": 0.5, "to": 2.0, "ramp_s": 5}],
    "condenser_inlet_temperature_k": [{"at_s": 0.5, "to": 2.0, "ramp_s": 5}],
}


def test_graph_gives_the_numbers_of_the_simulation(tmp_path: Path) -> None:
    faults = [
        {"kind": fault.kind, "profile": "stuck", "onset_s": 2.0 + 0.3 * number, "end_s": 5.0}
        for number, fault in enumerate(STICKING)
    ]
    given = {"name": "stuck", "duration_s": 6.0, "air": AIR, "faults": faults, "noise": NOISE}
    scenario = check(given | {"superheat_sensor": "derived"})
    recorded, simulated = read_bag(run_graph(scenario, tmp_path).bag), simulate(scenario)
    for key in SERIES:
        np.testing.assert_array_equal(recorded.series[key], simulated.series[key], err_msg=key)
    for fault in STICKING:
        assert np.ptp(recorded.series[truth_of(fault.kind)]) > 0.0


@pytest.mark.clock
@pytest.mark.parametrize("kind", ["condenser_pressure_sensor", "condenser_air_sensor"])
def test_a_live_sensor_sticks_and_comes_back(operator: Operator, tmp_path: Path, kind: str) -> None:
    acted: list[int] = [0]

    def interfere(tick: int, _ticks: int) -> None:
        if tick < acted[-1] + 8 or len(acted) == 3:
            return
        acted.append(tick)
        if len(acted) == 2:
            assert all(result.successful for result in operator.set(INJECTOR, **{f"{kind}__profile": "stuck"}))
            assert "stuck starts with the next tick" in operator.switch(kind, on=True).message
        else:
            assert operator.switch(kind, on=False).success

    scenario = check({"name": "stuck", "duration_s": 8.0, "air": AIR})
    run = run_graph(scenario, tmp_path, mode="realtime", care=True, progress=interfere)
    truth = np.nan_to_num(read_bag(run.bag).series[truth_of(kind)])
    assert len(acted) == 3
    held = np.flatnonzero(truth)
    assert len(held) >= 5
    assert held[-1] < len(truth) - 1
    assert not truth[: held[0]].any()


@pytest.mark.clock
def test_other_faults_refuse_to_stick(operator: Operator, tmp_path: Path) -> None:
    refused: list[str] = []

    def interfere(_tick: int, _ticks: int) -> None:
        if not refused:
            refused.append(operator.set(INJECTOR, compressor_speed__profile="stuck")[0].reason)

    run_graph(check({"name": "stuck", "duration_s": 2.0}), tmp_path, mode="realtime", care=True, progress=interfere)
    assert "allowed: step, ramp" in refused[0]
