"""Real processes over real DDS, on a ROS domain of their own, and what helps to look at them."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from bringup.graph import GraphRun, run_graph
from bringup.scenario import Scenario, check

settings.register_profile("graph", deadline=None)  # the first message of a type takes its time
settings.load_profile("graph")

#: Two faults, noise and a moving reference within 12 s: every part of the loop has something to do.
SHORT = {
    "name": "short",
    "duration_s": 12.0,
    "references": {"evaporator_pressure_kpa": [{"at_s": 1, "to": 1.0, "ramp_s": 4}]},
    "air": {"mass_flow_percent": [{"at_s": 2, "to": 3.0}]},
    "faults": [
        {"kind": "compressor_speed", "size_rpm": 40, "onset_s": 2},
        {"kind": "evaporator_pressure", "size_kpa": 1, "onset_s": 6, "profile": "sine", "period_s": 3},
    ],
    "noise": {"evaporator_pressure_kpa": 0.02, "superheat_k": 0.02, "wall_temperature_k": 0.02, "seed": 7},
}


@pytest.fixture(scope="session", autouse=True)
def _own_domain() -> Iterator[None]:
    """Keep out of the way of whatever else runs on this machine."""
    before = os.environ.get("ROS_DOMAIN_ID")
    os.environ["ROS_DOMAIN_ID"] = str(60 + os.getpid() % 40)
    yield
    if before is None:
        del os.environ["ROS_DOMAIN_ID"]
    else:
        os.environ["ROS_DOMAIN_ID"] = before


@pytest.fixture(scope="session")
def scenario() -> Scenario:
    return check(SHORT)


@pytest.fixture(scope="session")
def run(scenario: Scenario, tmp_path_factory: pytest.TempPathFactory) -> GraphRun:
    """One lockstep run that many tests look at."""
    return run_graph(scenario, tmp_path_factory.mktemp("run"))


def processes_that_mention(text: str) -> list[str]:
    """Command lines of running processes that contain `text`."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal() and int(entry.name) != os.getpid():
            try:
                line = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
            except OSError:
                continue  # gone meanwhile
            if text in line:
                found.append(line)
    return found
