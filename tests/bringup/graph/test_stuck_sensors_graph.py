"""Sensors that stand still in a running graph: to the bit as in the simulation, and started and stopped live."""

import math
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from ac_common.faults import STICKING
from ac_common.topics import INJECTOR, SERIES, truth_of
from ac_experiments.bags.reader import read_bag
from ac_experiments.recording import Recording
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

#: Sensors that stick while the loop runs.
BY_HAND = ("condenser_pressure_sensor", "condenser_air_sensor")


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


@dataclass
class Hand:
    """Somebody who has each of some sensors stick for a while, one after the other, and tries another fault first."""

    operator: Operator
    refused: str = ""
    acted: int = 0
    acted_s: float = -math.inf

    def __call__(self, tick: int, _ticks: int) -> None:
        if not self.refused:
            self.refused = self.operator.set(INJECTOR, compressor_speed__profile="stuck")[0].reason
        if tick == 0 or time.monotonic() < self.acted_s + 0.8 or self.acted == 2 * len(BY_HAND):
            return
        kind = BY_HAND[self.acted // 2]
        if self.acted % 2 == 0:
            assert all(result.successful for result in self.operator.set(INJECTOR, **{f"{kind}__profile": "stuck"}))
            assert "stuck starts with the next tick" in self.operator.switch(kind, on=True).message
        else:
            assert self.operator.switch(kind, on=False).success
        self.acted, self.acted_s = self.acted + 1, time.monotonic()


@pytest.fixture(scope="module")
def by_hand(tmp_path_factory: pytest.TempPathFactory) -> tuple[Hand, Recording]:
    """One run on the wall clock in which all that sticks sticks by hand."""
    scenario = check({"name": "stuck", "duration_s": 9.0, "air": AIR})
    with Operator() as operator:
        hand = Hand(operator)
        run = run_graph(scenario, tmp_path_factory.mktemp("stuck"), mode="realtime", care=True, progress=hand)
    return hand, read_bag(run.bag)


@pytest.mark.clock
@pytest.mark.parametrize("kind", BY_HAND)
def test_a_live_sensor_sticks_and_comes_back(kind: str, by_hand: tuple[Hand, Recording]) -> None:
    hand, recording = by_hand
    truth = np.nan_to_num(recording.series[truth_of(kind)])
    assert hand.acted == 2 * len(BY_HAND)
    held = np.flatnonzero(truth)
    assert len(held) >= 5
    assert held[-1] < len(truth) - 1
    assert not truth[: held[0]].any()


@pytest.mark.clock
def test_other_faults_refuse_to_stick(by_hand: tuple[Hand, Recording]) -> None:
    assert "allowed: step, ramp" in by_hand[0].refused
