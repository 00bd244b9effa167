"""Files that pages show, put into the pages themselves, so that they can be read without building the site.

A page says ``<!-- shows PATH -->`` before a block of code; `reference_pages` writes the file's content into the block.
"""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
_SHOWN = re.compile(r"(<!-- shows (?P<file>\S+) -->\n```(?P<head>[^\n]*)\n)(?P<body>.*?)(?P<end>^```$)", re.M | re.S)


def filled(text: str) -> str:
    """Return the text of a page with every block as its file is.

    Raises
    ------
    OSError
        When there is no such file.
    """
    return _SHOWN.sub(
        lambda found: f"{found[1]}{(ROOT / found['file']).read_text(encoding='utf-8').rstrip()}\n{found['end']}", text
    )


def pages() -> dict[Path, str]:
    """Return every page that shows a file, with its content."""
    found = {page: page.read_text(encoding="utf-8") for page in sorted((ROOT / "docs").rglob("*.md"))}
    return {page: filled(text) for page, text in found.items() if _SHOWN.search(text)}
