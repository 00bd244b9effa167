"""A node loads what it needs to run: seven of them start for each run."""

import subprocess
import sys

import pytest

#: A node's class, and what it may not load: a parser of YAML, checks of scenarios, lists of installed packages.
HEAVY = {"ruamel", "pydantic", "scipy", "numba", "matplotlib", "statistics", "zstandard", "mcap"}
NEEDED = {
    "ac_plant_node.node": set(),
    "fault_injector_node.node": set(),
    "fdi_node.node": set(),
    "gimc_controller_node.compensator_node": set(),
    "gimc_controller_node.node": set(),
    "bringup.nodes.recorder": {"mcap", "zstandard"},
    "bringup.nodes.scenario": {"pydantic"},
}


@pytest.mark.parametrize("module", NEEDED)
def test_a_node_loads_nothing_heavy(module: str) -> None:
    probe = f"""
import sys
import {module}
from ac_common.topics import TOPICS
from ac_ros_common.messages import message_class
from rclpy.type_support import check_for_type_support
for topic in TOPICS:
    check_for_type_support(message_class(topic.type))
print(*{{name.split(".")[0] for name in sys.modules}})
"""
    found = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stderr
    assert HEAVY & set(found.stdout.split()) <= NEEDED[module]
