"""The YAML parameter file of each node, written from what the node declares.

``python -m docs.tools.parameter_files`` writes them anew; a test compares them with the code.
"""

from collections.abc import Sequence
from importlib import import_module

from ac_common.yaml_file import yaml_text
from ac_ros_common.parameters import COMMON, Parameter
from bringup.launch.process_table import PROCESSES


def text(name: str) -> str:
    """Return the content of a node's parameter file: every parameter with default, meaning and allowed values."""
    declared: Sequence[Parameter] = (*COMMON, *import_module(PROCESSES[name].class_module).PARAMETERS)
    lines = [
        f"# Parameters of the node `{name}` and their defaults. Use:",
        f"#   python -m {PROCESSES[name].module} --ros-args --params-file {PROCESSES[name].parameter_file.name}",
        "/**:",
        "  ros__parameters:",
    ]
    for parameter in declared:
        lines.append(f"    # {parameter.description}{_allowed(parameter)}")
        value = yaml_text(parameter.default, flow=True).strip().removesuffix("...").strip()
        lines.append(f"    {parameter.name}: {value}")
    return "\n".join(lines) + "\n"


def _allowed(parameter: Parameter) -> str:
    allowed = f"one of {', '.join(parameter.choices)}" if parameter.choices else ""
    if parameter.low is not None and parameter.high is not None:
        allowed = f"{parameter.low:g} to {parameter.high:g}"
    when = "may be set while the node runs" if parameter.live else ""
    return "".join(f"; {part}" for part in (allowed, when) if part)


def main() -> None:
    """Write all parameter files."""
    for name in PROCESSES:
        PROCESSES[name].parameter_file.write_text(text(name), encoding="utf-8")


if __name__ == "__main__":
    main()
