"""What several commands share: options, arguments that complete in the shell, the examples at the end of help."""

import difflib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem


def examples(*lines: str) -> str:
    """Give the end of a help text: examples, which click must not fill into a paragraph."""
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in lines)


def nearest(word: str, known: Iterable[str]) -> str:
    """Give ``, did you mean 'x'?`` for the nearest of the `known` words, or ``;`` when none is near."""
    near = difflib.get_close_matches(word, list(known), n=1)
    return f", did you mean {near[0]!r}?" if near else ";"


class OneOf(click.Choice[str]):
    """One of a few words; a misspelt one gets the nearest as a suggestion."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Check one word."""
        if value not in self.choices:
            hint = nearest(str(value), self.choices)
            self.fail(f"unknown {value!r}{hint} allowed: {', '.join(self.choices)}", param, ctx)
        return str(value)


class ScenarioType(click.Path):
    """A scenario: the shell completes built-in names, then files."""

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Complete a name or a path."""
        from bringup.scenario import built_in_scenarios

        names = [CompletionItem(name) for name in built_in_scenarios() if name.startswith(incomplete)]
        return names or super().shell_complete(ctx, param, incomplete)


scenario_argument = click.argument("scenario", metavar="SCENARIO", type=ScenarioType())
bag_argument = click.argument("bag", metavar="BAG", type=click.Path(path_type=Path))
passive_option = click.option("--passive", is_flag=True, help="K0 alone: the compensator stays silent.")
set_option = click.option(
    "--set",
    "overrides",
    metavar="KEY=VALUE",
    multiple=True,
    help="Change one value of the scenario, for instance faults.0.size_rpm=60. May be given again.",
)
out_option = click.option(
    "--out",
    metavar="DIR",
    type=click.Path(path_type=Path),
    help="Folder for the results; made when missing. Default: results/SCENARIO.",
)
force_option = click.option("--force", is_flag=True, help="Overwrite the recording of an earlier run in DIR.")
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of a table.")
