"""What docs/ros2.md names exists."""

import re
from importlib.util import find_spec
from pathlib import Path

from ac_common.fault_profiles import PROFILES
from ac_common.topics import BY_NAME
from ac_ros_common.parameters import Parameter
from bringup.launch.process_table import PROCESSES
from fault_injector_node.node import PARAMETERS

TEXT = (Path(__file__).parents[3] / "docs" / "ros2.md").read_text(encoding="utf-8")


def test_topics_exist() -> None:
    named = set(re.findall(r"ros2 topic (?:echo|hz) /ac/(\S+)", TEXT))
    assert named
    assert named <= set(BY_NAME)


def test_nodes_and_modules_exist() -> None:
    table = dict(re.findall(r"^\| `(\w+)` \| `python -m ([\w.]+)", TEXT, flags=re.MULTILINE))
    assert table == {name: process.module for name, process in PROCESSES.items()}
    assert all(find_spec(module) for module in table.values())
    assert set(re.findall(r"/ac/(\w+)$", TEXT, flags=re.MULTILINE)) <= set(PROCESSES)


def test_parameters_and_profiles_exist() -> None:
    declared: dict[str, Parameter] = {parameter.name: parameter for parameter in PARAMETERS}
    named = set(re.findall(r"ros2 param (?:set|describe) /ac/fault_injector (\S+)", TEXT))
    assert named
    assert all(declared[name].live for name in named)
    assert f"Profiles: {', '.join(PROFILES)}." in TEXT
