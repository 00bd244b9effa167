"""What a section of a page is made of: tables, notes, plots, as data; `macros.html` turns them into HTML."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

#: A cell of a table: text, which is escaped, or markup, which is not.
Cell = str | Markup


@dataclass(frozen=True)
class Table:
    """A table; without heads when all of them are empty."""

    heads: Sequence[Cell]
    rows: Sequence[Sequence[Cell]]
    kind: str = "table"


@dataclass(frozen=True)
class Words:
    """A paragraph ("text", "note", or "hint": a note for the screen alone), a "heading", "code", or a "listing"."""

    text: Cell
    kind: str = "text"


@dataclass(frozen=True)
class Plot:
    """A plot to zoom, in the page's own script under `name`, and a still picture of it: SVG in base64."""

    name: str
    title: str
    height: float
    picture: str
    kind: str = "plot"


Part = Table | Words | Plot


@dataclass(frozen=True)
class Section:
    """A section of a page; what is not `on_paper` is left away in print."""

    name: str
    heading: Cell
    parts: Sequence[Part]
    on_paper: bool = True


def code(text: object) -> Markup:
    """Return a name that is set like code, escaped."""
    return Markup("<code>{}</code>").format(text)


def cell(value: float | None, digits: str) -> str:
    """Format a number for a table: a dash where there is none, a true minus, and no sign on what rounds to zero."""
    if value is None or not math.isfinite(value):
        return "–"
    text = format(value, digits)
    return (text if float(text) else text.lstrip("+-")).replace("-", "\N{MINUS SIGN}")


def render_page(template: Path, **content: Any) -> str:
    """Return a template filled in; it may take macros from the folder of the report."""
    folders = [template.parent, Path(__file__).parent]
    environment = Environment(
        loader=FileSystemLoader(folders),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template.name).render(**content)
