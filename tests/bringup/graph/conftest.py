"""Real processes over real DDS, and what helps to look at them."""

from collections.abc import Iterator

import pytest

from ac_experiments.scenario import check
from ac_experiments.scenario_schema import Scenario
from bringup.launch.launch import GraphRun, run_graph
from tests.operator import Operator

#: Faults of all places, noise and a moving reference within 12 s: every part of the loop has something to do.
SHORT = {
    "name": "short",
    "duration_s": 12.0,
    "references": {"evaporator_pressure_kpa": [{"at_s": 1, "to": 1.0, "ramp_s": 4}]},
    "air": {"mass_flow_percent": [{"at_s": 2, "to": 3.0}]},
    "faults": [
        {"kind": "compressor_speed", "size_rpm": 40, "onset_s": 2},
        {"kind": "evaporator_pressure", "size_kpa": 1, "onset_s": 6, "profile": "sine", "period_s": 3},
        {"kind": "valve_slow", "size_s": 2, "onset_s": 8},
        {"kind": "condenser_fouling", "size_percent": 5, "onset_s": 8, "profile": "ramp", "rise_s": 2},
        {"kind": "air_inlet_sensor", "size_k": 0.2, "onset_s": 9},
    ],
    "noise": {"evaporator_pressure_kpa": 0.02, "superheat_k": 0.02, "wall_temperature_k": 0.02, "seed": 7},
}


@pytest.fixture(scope="session")
def scenario() -> Scenario:
    return check(SHORT)


@pytest.fixture(scope="session")
def run(scenario: Scenario, tmp_path_factory: pytest.TempPathFactory) -> GraphRun:
    """One lockstep run that many tests look at."""
    return run_graph(scenario, tmp_path_factory.mktemp("run"))


@pytest.fixture
def operator() -> Iterator[Operator]:
    with Operator() as someone:
        yield someone
