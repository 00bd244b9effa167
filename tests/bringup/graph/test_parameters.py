"""Parameters: declared, described, limited, and each node's file lists exactly those."""

import pytest
import yaml

from bringup.launch.node_modules import MODULES, parameter_file
from docs.tools.parameter_files import text


@pytest.mark.parametrize("name", MODULES)
def test_parameter_file_is_what_the_node_declares(name: str) -> None:
    said = parameter_file(MODULES[name]).read_text(encoding="utf-8")
    assert said == text(name), "run: python -m docs.tools.parameter_files"
    content = yaml.safe_load(said)
    assert "autostart" in content["/**"]["ros__parameters"]
