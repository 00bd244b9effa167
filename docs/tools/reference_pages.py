"""Write the pages of `docs/reference/` from the code: topics, parameters of the nodes, the command line.

``python -m docs.tools.reference_pages`` writes them and `docs/scenarios.md` anew; a test compares them with the code.
"""

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

import click

from ac_common.fdi_status import StatusRow
from ac_common.topics import DIAGNOSTICS, JOINT_FIELD, JOINTS, NAMESPACE, PRESSURE, TOPICS, Topic
from ac_common.wire import pack_status, read_diagnostics
from ac_ros_common.parameters import COMMON, Parameter
from ac_ros_common.qos import DEADLINE_S, DEPTH
from bringup.launch.process_table import PROCESSES
from docs.tools import scenario_reference

FOLDER = Path(__file__).parents[2] / "docs" / "reference"
WRITTEN = "<!-- Written by `python -m docs.tools.reference_pages`; edit {} instead. -->"

#: Meaning of each topic; a topic that is missing here is an error.
MEANING = {
    "plant/evaporator_pressure": "p_e, actual",
    "plant/superheat": "superheat SH, actual: a difference",
    "plant/wall_temperature": "T_w, wall of the superheated zone, actual",
    "plant/condenser_pressure": "p_c, actual",
    "plant/air_inlet_temperature": "air into the evaporator, a measured disturbance",
    "measured/evaporator_pressure": "p_e with f_p and noise",
    "measured/superheat": "SH with noise; with a derived superheat, also with the effect of f_p",
    "measured/wall_temperature": "T_w with noise",
    "reference/evaporator_pressure": "reference of p_e",
    "reference/superheat": "reference of SH",
    "scenario/air": "air mass flow through the evaporator, kg/s",
    "scenario/air_inlet_temperature": "its temperature",
    "scenario/fault/compressor_speed": "f_N of the scenario",
    "scenario/fault/evaporator_pressure": "f_p of the scenario",
    "controller/command": "u, within its limits",
    "actuator/command": "what reaches the plant: u with f_N",
    "fdi/innovation/evaporator_pressure": "f_e, row of p_e",
    "fdi/innovation/superheat": "f_e, row of SH: a difference",
    "fdi/innovation/wall_temperature": "f_e, row of T_w: a difference",
    "fdi/residual/compressor_speed": "r_N, the estimate of f_N",
    "fdi/residual/evaporator_pressure": "r_p, the estimate of f_p",
    "fdi/status": "detected, isolated fault, size, onset, thresholds",
    "compensator/q": "q = Q f_e",
    "fault/compressor_speed": "f_N, the truth: for evaluation only, no node of the loop reads it",
    "fault/evaporator_pressure": "f_p, the truth, likewise",
}
JOINT_UNIT = {"velocity": "rad/s", "position": "0..1"}
DIFFERENCES = ("plant/superheat", "measured/superheat", "reference/superheat")


def unit(topic: Topic) -> str:
    """Return the unit of a topic's values in its messages."""
    if topic.name == "scenario/air":
        return "kg/s"
    if topic.type == JOINTS:
        return ", ".join(f"{joint} {JOINT_UNIT[JOINT_FIELD[joint]]}" for joint in topic.joints)
    if topic.type == PRESSURE:
        return "Pa"
    if topic.type == DIAGNOSTICS:
        return "see below"
    return "K" if topic.name in DIFFERENCES or topic.name.startswith("fdi/innovation") else "°C"


def topics_page() -> str:
    """Return the content of the page of the topics."""
    rows = [
        f"| `{t.name}` | {MEANING[t.name]} | {t.type.rpartition('/')[2]}, {unit(t)} | {t.publisher} | "
        f"{', '.join(t.subscribers) or '–'} |"
        for t in TOPICS
    ]
    status = read_diagnostics(pack_status(0, StatusRow(0.0, False, None, 0.0, 0.0, 0.0, (0.0, 0.0))))[0]
    joints = ", ".join(f"`{joint}`: `{field}`" for joint, field in JOINT_FIELD.items())
    return "\n".join(
        [
            "---",
            "hide: [toc]",
            "---",
            "# Topics",
            "",
            WRITTEN.format("`ac_common/topics.py`"),
            "",
            f"Names are relative to the namespace `{NAMESPACE}`. Values are SI; every message carries the stamp of its",
            "tick, and what carries the same stamp belongs together. The recorder subscribes to all of them.",
            "",
            "| topic | what | type and unit | from | to |",
            "|---|---|---|---|---|",
            *rows,
            "",
            "Besides: `/clock` (`rosgraph_msgs/Clock`, in lockstep mode, from the plant) and `/diagnostics`",
            "(`diagnostic_msgs/DiagnosticArray`, every node's health, about once a second).",
            "",
            "## Fields",
            "",
            "- `sensor_msgs/FluidPressure`: `fluid_pressure`; `sensor_msgs/Temperature`: `temperature`.",
            "- `sensor_msgs/JointState`: `name` holds the joints of the table, in that order; the value of each is in",
            f"  one field ({joints}), the rest is NaN.",
            "- `diagnostic_msgs/DiagnosticArray` on `fdi/status`: one status; level 0: nothing is detected, level 1: a",
            f"  fault is; values with the keys {', '.join(f'`{key}`' for key in status.values)}. Sizes and",
            "  thresholds are in rad/s and Pa, times count from the first tick, nan stands for *not yet*.",
            "",
            "## Quality of service",
            "",
            f"Loop topics: reliable, volatile, keep last {DEPTH}, deadline {DEADLINE_S:g} s. A publisher of your own",
            "must offer reliable delivery and no longer a deadline, or our subscribers do not match with it. A",
            "subscriber of your own matches with the defaults. `/clock` and `/diagnostics`: reliable, no deadline.",
            "",
        ]
    )


def parameters_page() -> str:
    """Return the content of the page of the nodes' parameters."""
    parts = [
        "# Parameters of the nodes",
        "",
        WRITTEN.format("`PARAMETERS` in each node's module"),
        "",
        "`acftc run` sets them from the scenario; `acftc run ... --params-file FILE` overrides them. `ros2 param",
        "describe /ac/fdi design_file` shows what this page says. A node that is started alone takes them from the",
        "YAML file beside its code, or from yours: `python -m fdi_node --ros-args --params-file my.yaml`. `fdi`,",
        "`compensator` and `gimc_controller` need a `design_file`: [how to make",
        "one](../ros2.md#designs-of-nodes-that-are-started-alone). *Live*: may be set while the node runs.",
        "",
        "## All nodes",
        "",
        *_table(COMMON),
    ]
    for name, process in PROCESSES.items():
        declared: Sequence[Parameter] = import_module(process.class_module).PARAMETERS
        parts += ["", f"## `{name}`", "", f"`python -m {process.module}`", "", *_table(declared)]
    return "\n".join([*parts, ""])


def _table(parameters: Sequence[Parameter]) -> list[str]:
    rows = ["| parameter | default | allowed | live | meaning |", "|---|---|---|---|---|"]
    for p in parameters:
        allowed = ", ".join(f"`{choice}`" for choice in p.choices)
        if p.low is not None and p.high is not None:
            allowed = f"{p.low:g} to {p.high:g}"
        live = "yes" if p.live else ""
        default = str(p.default).lower() if isinstance(p.default, bool) else p.default
        shown = f"`{default}`" if default != "" else "empty"
        rows.append(f"| `{p.name}` | {shown} | {allowed or '–'} | {live} | {p.description} |")
    return rows


def commands_page() -> str:
    """Return the content of the page of the command line."""
    from bringup.cli import cli

    parts = ["# Command line", "", WRITTEN.format("the commands in `bringup/commands/`"), ""]
    parts += ["What `--help` prints. Exit codes are at the end of the first one.", ""]
    with click.Context(cli, info_name="acftc", terminal_width=100, max_content_width=100) as context:
        parts += ["## `acftc`", "", "```text", cli.get_help(context), "```", ""]
        for name in cli.list_commands(context):
            command = cli.get_command(context, name)
            assert command is not None  # it is in the list
            inner = click.Context(command, info_name=name, parent=context, terminal_width=100, max_content_width=100)
            parts += [f"## `acftc {name}`", "", "```text", command.get_help(inner), "```", ""]
    return "\n".join(line.rstrip() for line in "\n".join(parts).splitlines()) + "\n"


def pages() -> dict[Path, str]:
    """Return every page that this module writes, with its content."""
    return {
        FOLDER / "topics.md": topics_page(),
        FOLDER / "parameters.md": parameters_page(),
        FOLDER / "command-line.md": commands_page(),
        scenario_reference.PAGE: scenario_reference.text(),
    }


def main() -> None:
    """Write all pages."""
    for page, text in pages().items():
        page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
