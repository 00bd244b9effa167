"""What several commands share: options, arguments that complete in the shell, the examples at the end of help."""

import shlex
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from ac_common.errors import nearest


def examples(*lines: str) -> str:
    """Give the end of a help text: examples, one a line, each with a remark after `` # `` where it needs one."""
    parts = [line.partition(" # ") for line in lines]
    width = max(len(command.rstrip()) for command, _, remark in parts if remark) if any(p[2] for p in parts) else 0
    shown = [f"{command.rstrip():{width}}  # {remark.strip()}" if remark else command for command, _, remark in parts]
    # \\b: click must not fill them into a paragraph.
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in shown)


class OneOf(click.Choice[str]):
    """One of a few words; a misspelt one gets the nearest as a suggestion."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Check one word."""
        if value not in self.choices:
            hint = nearest(str(value), self.choices)
            self.fail(f"unknown {value!r}{hint} allowed: {', '.join(self.choices)}", param, ctx)
        return str(value)


class SomePath(click.Path):
    """A path; an empty one, as from a variable of the shell that is not set, is refused: it would be `.`."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Check a path."""
        if value == "":
            self.fail("the path is empty; give '.' for the present folder", param, ctx)
        return super().convert(value, param, ctx)


class ScenarioType(SomePath):
    """A scenario: the shell completes built-in names, then files."""

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Complete a name or a path."""
        from ac_experiments.drives import FAMILY
        from ac_experiments.scenario import built_in_scenarios

        known = (*built_in_scenarios(), f"{FAMILY}:")
        names = [CompletionItem(name) for name in known if name.startswith(incomplete)]
        return names or super().shell_complete(ctx, param, incomplete)


class SettingType(click.ParamType[str]):
    """``KEY=VALUE`` of a scenario: the shell completes the keys of the one that stands on the line."""

    name = "setting"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:  # noqa: ARG002
        """Complete a key."""
        from ac_common.errors import UserError
        from ac_experiments.scenario import load

        # With --set still waiting for its value, click leaves the scenario among the words that it could not place.
        scenario = ctx.params.get("scenario") or next(iter(ctx.args), "nominal")
        try:
            content = load(scenario).model_dump(mode="json")
        except UserError:
            return []
        return [CompletionItem(f"{key}=") for key in _keys(content) if key.startswith(incomplete)]


def _keys(content: Any, prefix: str = "") -> Iterator[str]:
    """Return the dotted keys of everything in a scenario that holds a value."""
    items = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    for key, value in items:
        if isinstance(value, dict | list) and value:
            yield from _keys(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}"


class NodeType(click.ParamType[str]):
    """Name of a node; the shell completes it."""

    name = "node"

    def __init__(self, names: Sequence[str]) -> None:
        self.names = names

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Check a name."""
        if value not in self.names:
            hint = nearest(str(value), self.names)
            self.fail(f"unknown node {value!r}{hint} allowed: {', '.join(self.names)}", param, ctx)
        return str(value)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:  # noqa: ARG002
        """Complete a name."""
        return [CompletionItem(name) for name in self.names if name.startswith(incomplete)]


def path_option(*names: str, **how: Any) -> Callable[[Any], Any]:
    """Return an option whose value is a path; `names` and the rest as of `click.option`."""
    return click.option(*names, type=SomePath(path_type=Path), **how)


#: What says nothing about a run itself: where its results go, and what is shown of it.
_NOT_OF_RUN = ("out", "force", "with_report", "with_bag", "as_json", "with_page")


def repeated(context: click.Context) -> str:
    """Return the command line that repeats what a command was asked to run; into which folder is left open."""
    words = ["acftc"]
    if context.parent is not None and context.parent.params.get("plant"):
        words += ["--plant", str(context.parent.params["plant"])]
    words.append(str(context.info_name))
    for parameter in context.command.params:
        value = context.params.get(str(parameter.name))
        if parameter.name in _NOT_OF_RUN or value == parameter.get_default(context) or not value:
            continue
        if isinstance(parameter, click.Argument):
            words.append(str(value))
            continue
        for each in value if isinstance(value, tuple) else (value,):
            words += [parameter.opts[0]] if each is True else [parameter.opts[0], str(each)]
    return shlex.join(words)


scenario_argument = click.argument("scenario", metavar="SCENARIO", type=ScenarioType())
bag_argument = click.argument("bag", metavar="BAG", type=SomePath(path_type=Path))
passive_option = click.option("--passive", is_flag=True, help="K0 alone: the compensator stays silent.")
set_option = click.option(
    "--set",
    "overrides",
    metavar="KEY=VALUE",
    type=SettingType(),
    multiple=True,
    help="Change one value of the scenario, for instance faults.0.size_rpm=60. May be given again.",
)
out_option = path_option(
    "--out", metavar="DIR", help="Folder for the results; made when missing. Default: results/SCENARIO."
)
force_option = click.option("--force", is_flag=True, help="Overwrite the recording of an earlier run in DIR.")
report_option = click.option(
    "--report/--no-report",
    "with_report",
    default=True,
    help="Without it a run takes some seconds less. The report of an earlier run in DIR goes in any case.",
)
params_file_option = path_option(
    "--params-file", metavar="FILE", help="A ROS 2 parameter file that has the last word, with keys such as /ac/fdi."
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of a table.")


def scenario_options(command: Any) -> Any:
    """Give a command what all that runs a scenario takes: SCENARIO, and options for what is run and written."""
    for add in (json_option, report_option, force_option, set_option, passive_option, out_option, scenario_argument):
        command = add(command)
    return command
