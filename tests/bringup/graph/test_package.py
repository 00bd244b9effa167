"""What colcon needs says the same as what pip reads."""

import re
import sys
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

from ac_common.topics import TOPICS
from tests.test_layers import FILES, PACKAGES, first_parts

ROOT = Path(__file__).parents[3]


def test_package_xml_agrees_with_pyproject() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    package = ET.parse(ROOT / "package.xml").getroot()
    assert package.findtext("name") == project["name"]
    assert package.findtext("version") == project["version"]
    assert package.findtext("license") == "Apache-2.0"
    assert project["classifiers"] == ["License :: OSI Approved :: Apache Software License"]
    assert package.findtext("export/build_type") == "ament_python"
    assert (ROOT / "resource" / project["name"]).exists()
    executables = {"fdi_node", "ac_plant_node", "fault_injector_node", "compensator_node", "gimc_controller_node"}
    assert executables | {"scenario_node", "recorder_node", "acftc"} == set(project["scripts"])


def test_what_is_imported_is_declared_and_the_recipe_for_colcon_has_it() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = [text for texts in project["optional-dependencies"].values() for text in texts]
    declared = {re.split(r"[<>=\[]", text)[0] for text in (*project["dependencies"], *extras)}
    names = {
        "Jinja2": "jinja2",
        "MarkupSafe": "markupsafe",
        "PyYAML": "yaml",
        "ros-jazzy-rclpy": "rclpy",
        "ruamel.yaml": "ruamel",
        "foxglove-sdk": "foxglove",
    }
    modules = {names.get(name, name) for name in declared if name != "ros-jazzy-common-interfaces"}
    used: set[str] = set().union(*map(first_parts, FILES))
    messages = {topic.type.split("/")[0] for topic in TOPICS} | {
        "lifecycle_msgs",
        "std_srvs",
        "rcl_interfaces",
        "builtin_interfaces",
    }
    foreign = used - set(sys.stdlib_module_names) - set(PACKAGES) - messages
    assert foreign - {"ament_index_python"} <= modules  # that one belongs to rclpy
    recipe = (ROOT / "docs" / "ros2.md").read_text().partition("pip install")[2]
    installed = {"numpy", "scipy", "psutil", "PyYAML", "ros-jazzy-rclpy", "ros-jazzy-common-interfaces"}
    assert [name for name in declared - installed if not re.search(rf"\b{name}\b", recipe)] == []


def test_every_message_package_is_declared() -> None:
    declared = {element.text for element in ET.parse(ROOT / "package.xml").getroot().iter("exec_depend")}
    used = {topic.type.split("/")[0] for topic in TOPICS}
    for source in ROOT.glob("*/*.py"):
        used |= set(re.findall(r"^from (\w+)\.(?:msg|srv) import", source.read_text(), flags=re.MULTILINE))
    assert used <= declared
