r"""What `mkdocs build` does on top.

Formulas become MathML, which browsers draw by themselves, without a network. And `\|` in the code of a table becomes
`|`, as everywhere but in Python's Markdown.
"""

import html
import re
from typing import Any

from latex2mathml.converter import convert

#: What pymdownx.arithmatex leaves of `$...$` and `$$...$$`.
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)
CELL = re.compile(r"<td.*?</td>", re.DOTALL)


def on_page_content(content: str, **_: Any) -> str:
    """Convert the formulas of a page, and mend the code in its tables."""
    return CELL.sub(lambda cell: cell[0].replace("\\|", "|"), FORMULA.sub(_mathml, content))


def _mathml(found: re.Match[str]) -> str:
    formula = html.unescape(found[2])
    if found[1] == "span":
        return convert(formula)
    return f'<div class="formula">{convert(formula, display="block")}</div>'
