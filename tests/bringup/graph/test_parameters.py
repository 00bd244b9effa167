"""Parameters: declared, described, limited, and each node's file lists exactly those."""

import pytest

from ac_common.yaml_file import parsed
from bringup.launch.process_table import PROCESSES
from docs.tools.parameter_files import text


@pytest.mark.parametrize("name", PROCESSES)
def test_parameter_file_is_what_the_node_declares(name: str) -> None:
    said = PROCESSES[name].parameter_file.read_text(encoding="utf-8")
    assert said == text(name), "run: python -m docs.tools.parameter_files"
    content = parsed(said, name)
    assert "autostart" in content["/**"]["ros__parameters"]
