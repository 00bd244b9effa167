"""What colcon needs says the same as what pip reads."""

import re
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

from bringup.topics import TOPICS

ROOT = Path(__file__).parents[2]


def test_package_xml_agrees_with_pyproject() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    package = ET.parse(ROOT / "package.xml").getroot()
    assert package.findtext("name") == project["name"]
    assert package.findtext("version") == project["version"]
    assert package.findtext("license") == project["license"]
    assert package.findtext("export/build_type") == "ament_python"
    assert (ROOT / "resource" / project["name"]).exists()
    executables = {"fdi_node", "ac_plant_node", "fault_injector_node", "compensator_node", "gimc_controller_node"}
    assert executables | {"scenario_node", "recorder_node", "acftc"} == set(project["scripts"])


def test_every_message_package_is_declared() -> None:
    declared = {element.text for element in ET.parse(ROOT / "package.xml").getroot().iter("exec_depend")}
    used = {topic.type.split("/")[0] for topic in TOPICS}
    for source in ROOT.glob("*/*.py"):
        used |= set(re.findall(r"^from (\w+)\.(?:msg|srv) import", source.read_text(), flags=re.MULTILINE))
    assert used <= declared
