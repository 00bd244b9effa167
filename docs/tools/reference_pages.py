"""Write the pages of `docs/reference/` from the code: topics, parameters, commands, Python names.

``python -m docs.tools.reference_pages`` writes them and `docs/scenarios.md` anew, and puts files into the pages that
show them; a test compares all with the code.
"""

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

import click

from ac_common.delivery import DEADLINE_S, DEPTH
from ac_common.faults import ISOLABLE, UNKNOWN, units
from ac_common.fdi_status import StatusRow
from ac_common.topics import CAR, JOINT_FIELD, NAMESPACE, SCALARS, TOPICS, WITH_ENVELOPE, Topic
from ac_common.wire import pack_status, read_diagnostics
from ac_ros_common.parameters import COMMON, Parameter
from bringup.launch.process_table import PROCESSES
from docs.tools import python_reference, scenario_reference, shown_files

FOLDER = Path(__file__).parents[2] / "docs" / "reference"
WRITTEN = "<!-- Written by `python -m docs.tools.reference_pages`; edit {} instead. -->"


def topics_page() -> str:
    """Return the content of the page of the topics."""
    heads = ["| topic | what | type and unit | from | to |", "|---|---|---|---|---|"]
    status = read_diagnostics(pack_status(0, StatusRow(0.0, False, None, 0.0, 0.0, 0.0, (0.0,) * len(ISOLABLE))))[0]
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
            *heads,
            *map(_row, TOPICS),
            "",
            "¹ with the designs of an operating point (`design: paper`), ² with those of the whole envelope.",
            "",
            "A run with a car has two more, in every tick, without a deadline. To a car `scenario/air` tells what its",
            "blower moves, `scenario/condenser_air_inlet_temperature` and `scenario/air_humidity` what outside air is",
            "like; `scenario/air_inlet_temperature` and `scenario/condenser_air` say nothing to it.",
            "",
            *heads,
            *map(_row, CAR),
            "",
            "Besides: `/clock` (`rosgraph_msgs/Clock`, in lockstep mode, from the plant) and `/diagnostics`",
            "(`diagnostic_msgs/DiagnosticArray`, every node's health, about once a second).",
            "",
            "## Fields",
            "",
            f"- {'; '.join(f'`{name.replace("/msg/", "/")}`: `{scalar.field}`' for name, scalar in SCALARS.items())}.",
            "- `sensor_msgs/JointState`: `name` holds the joints of the table, in that order; the value of each is in",
            f"  one field ({joints}), the rest is NaN.",
            "- `diagnostic_msgs/DiagnosticArray` on `fdi/status`: one status; level 0: nothing is detected, level 1: a",
            f"  fault is; values with the keys {', '.join(f'`{key}`' for key in status.values)}. Sizes and",
            f"  thresholds are in {units(ISOLABLE)}, times count from the first tick, nan stands for *not yet*.",
            f"  A fault that is certainly there and that no filter is for is isolated as `{UNKNOWN}`; it has no size.",
            "  Of what is isolated `unsure` is that whose name may yet be the other's: there is no q for it meanwhile.",
            "",
            "## Quality of service",
            "",
            f"Loop topics: reliable, volatile, keep last {DEPTH}. Our publishers offer a deadline of {DEADLINE_S:g} s;",
            "our subscribers ask for none. So a publisher of your own matches when it is reliable, as with the",
            "defaults, and a subscriber of your own with the defaults. `/clock` and `/diagnostics`: no deadline.",
            "",
        ]
    )


def _row(topic: Topic) -> str:
    """Return the row of a topic; a number after a reader says of which designs it is."""
    envelope = WITH_ENVELOPE.get(topic.name, topic.subscribers)
    readers = [name + ("" if name in envelope else " ¹") for name in topic.subscribers]
    readers += [f"{name} ²" for name in envelope if name not in topic.subscribers]
    return (
        f"| `{topic.name}` | {topic.meaning} | {topic.type.rpartition('/')[2]}, {topic.unit} | {topic.publisher} | "
        f"{', '.join(readers) or '–'} |"
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
            parts += _command(command, name, context)
    return "\n".join(line.rstrip() for line in "\n".join(parts).splitlines()) + "\n"


def _command(command: click.Command, name: str, parent: click.Context) -> list[str]:
    """Return the help of a command, and of those below it."""
    inner = click.Context(command, info_name=name, parent=parent, terminal_width=100, max_content_width=100)
    parts = [f"## `{inner.command_path}`", "", "```text", command.get_help(inner), "```", ""]
    for below, one in sorted(getattr(command, "commands", {}).items()):
        parts += _command(one, below, inner)
    return parts


def pages() -> dict[Path, str]:
    """Return every page that this module writes, with its content."""
    return {
        FOLDER / "topics.md": topics_page(),
        FOLDER / "parameters.md": parameters_page(),
        FOLDER / "command-line.md": commands_page(),
        scenario_reference.PAGE: scenario_reference.text(),
        python_reference.PAGE: python_reference.text(WRITTEN.format("the docstrings")),
        **shown_files.pages(),
    }


def main() -> None:
    """Write all pages."""
    for page, text in pages().items():
        page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
