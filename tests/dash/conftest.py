"""A browser for each file of tests."""

from collections.abc import Iterator

import pytest
from live_browser import started_browser
from playwright.sync_api import Browser


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with started_browser() as browser:
        yield browser
