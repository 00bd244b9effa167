"""What the command line prints: tables and JSON on stdout, remarks and progress on stderr."""

import json
import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from typing import Any, Protocol

import click


def print_table(heads: list[str], rows: list[list[str]]) -> None:
    """Print a table on stdout, in colour only on a terminal."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    for head in heads:
        table.add_column(head, overflow="fold")
    for row in rows:
        table.add_row(*row)
    # In a pipe there is no width to keep to, and a wrapped line is no use to a script.
    Console(width=None if sys.stdout.isatty() else 200, highlight=False).print(table)


def print_json(content: Any) -> None:
    """Print `content` as strict JSON on stdout."""
    click.echo(json.dumps(content, indent=2, allow_nan=False))


def say(line: str) -> None:
    """Tell the user where things are, on stderr so that stdout stays what a script reads."""
    print(line, file=sys.stderr, flush=True)  # not by click, which would write past a progress bar into its line


class Progress(Protocol):
    """What moves a progress bar: how much is done of how much, and what is being done when that changes."""

    def __call__(self, done: int, total: int, what: str | None = None, /) -> None:
        """Move it."""


@contextmanager
def progress_bar(what: str) -> Iterator[Progress | None]:
    """Give a progress function that draws a bar on stderr, or None when stderr is no terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:3.0f} %"))
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=None)
        yield lambda done, total, name=None: bar.update(task, completed=done, total=total, description=name)


def steps_of(progress: Progress, total: int) -> Callable[[str], None]:
    """Give a function that is told the name of each of `total` steps as it begins, and moves the bar."""
    numbers = count()
    return lambda name: progress(next(numbers), total, name)


def digits(value: float | None) -> str:
    """Format a number in four digits, or a dash where there is none."""
    return "–" if value is None or not math.isfinite(value) else f"{value:.4g}"


def without_nan(value: Any) -> Any:
    """Put None where JSON has no number."""
    if isinstance(value, dict):
        return {key: without_nan(item) for key, item in value.items()}
    if isinstance(value, list):
        return [without_nan(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
