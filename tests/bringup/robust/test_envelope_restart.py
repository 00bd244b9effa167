"""Detector and compensator of the whole envelope, killed while they accommodate a fault: their successors go on."""

from dataclasses import dataclass

import numpy as np
import pytest
from mischief import Mischief, killing

from ac_common.topics import COMPENSATOR, FDI
from ac_experiments.bags.reader import read_bag
from ac_experiments.recording import Recording
from ac_experiments.scenario import check
from bringup.launch.launch import GraphRun, run_graph

pytestmark = [pytest.mark.ros, pytest.mark.clock]

FAULTY = {
    "name": "faulty",
    "design": "envelope",
    "duration_s": 42.0,
    "faults": [{"kind": "evaporator_pressure", "size_kpa": 5, "onset_s": 27}],
    "noise": {
        "evaporator_pressure_kpa": 0.2,
        "superheat_k": 0.1,
        "wall_temperature_k": 0.05,
        "condenser_pressure_kpa": 2.0,
        "seed": 7,
    },
}
KILLED = {310: FDI, 360: COMPENSATOR}
OUTPUT = {FDI: "fdi/residual/evaporator_pressure", COMPENSATOR: "compensator/q:compressor"}


@dataclass
class Ordeal:
    run: GraphRun
    recording: Recording


@pytest.fixture(scope="module")
def ordeal(tmp_path_factory: pytest.TempPathFactory) -> Ordeal:
    mischief = Mischief([(tick, killing(node)) for tick, node in KILLED.items()], rest=10)
    run = run_graph(check(FAULTY), tmp_path_factory.mktemp("ordeal"), "realtime", progress=mischief, say=mischief.say)
    return Ordeal(run, read_bag(run.bag))


def test_both_are_started_again(ordeal: Ordeal) -> None:
    assert [restart.node for restart in ordeal.run.restarts] == list(KILLED.values())


def last_and_first(node: str, recording: Recording) -> tuple[int, int]:
    """Ticks of the last output before a node was killed and of the first one of its successor."""
    silent = np.isnan(recording.series[OUTPUT[node]])
    killed = next(tick for tick, name in KILLED.items() if name == node)
    gap = killed - 5 + int(np.argmax(silent[killed - 5 :]))
    return gap - 1, gap + int(np.argmin(silent[gap:]))


@pytest.mark.parametrize("node", KILLED.values())
def test_its_successor_takes_up_where_it_was(node: str, ordeal: Ordeal) -> None:
    """Begun anew, estimate and q would be nothing."""
    before, after = last_and_first(node, ordeal.recording)
    values = ordeal.recording.series[OUTPUT[node]]
    assert abs(values[before]) > 1.0
    assert values[after] == pytest.approx(values[before], rel=0.15)


def test_the_decision_stays(ordeal: Ordeal) -> None:
    before, after = last_and_first(FDI, ordeal.recording)
    said = {round(row.time_s * 10): (row.isolated, row.isolated_s, row.onset_s) for row in ordeal.recording.status}
    assert said[before][0] == "evaporator_pressure"
    assert said[after] == said[before]
