"""Pages that are written from the code are those that are committed."""

from pathlib import Path

import pytest

from docs.tools import reference_pages

PAGES = reference_pages.pages()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_page_is_up_to_date(page: Path) -> None:
    assert page.read_text(encoding="utf-8") == PAGES[page], "run `python -m docs.tools.reference_pages`"
