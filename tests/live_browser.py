"""A real headless Chromium, and a page to look at with it: for the tests, and for `leak.py`."""

import math
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from playwright.sync_api import Browser, Locator, Page, expect, sync_playwright

from bringup.dash.rows import ROW_PERIOD_S

NAMES = ("chromium", "chromium-browser", "google-chrome")
#: Nothing that the browser does of its own accord is to go out, or into the log of requests.
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
#: How long anything may take on a busy machine, s; nothing is judged by it.
PATIENCE_S = 180.0
#: How long compiling the plant, or a point's synthesis, may take where neither is in the cache yet, s.
FIRST_TIME_S = 500.0
#: Nothing is looked for while the observer settles, nor taken for a fault for a while after, s.
SETTLED_S = 28.0
#: How long the page may show no row.
BETWEEN_S = 2.0


def chromium() -> str:
    """Path of the browser; without one the test is skipped, in CI it fails."""
    path = next((found for name in NAMES if (found := shutil.which(name))), None)
    if path is None:
        reason = f"no browser: none of {', '.join(NAMES)} is installed (Debian: apt install chromium)"
        if os.environ.get("CI") == "true":
            pytest.fail(reason)
        pytest.skip(reason)
    return path


@contextmanager
def started_browser() -> Iterator[Browser]:
    """Give a browser."""
    path = chromium()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
        try:
            yield browser
        finally:
            browser.close()


def new_page(browser: Browser, width: int = 1400, height: int = 900) -> Page:
    """Make an empty page; to be closed before its server ends: it would go on with the next one at that port."""
    page = browser.new_page(viewport={"width": width, "height": height})
    page.set_default_timeout(PATIENCE_S * 1e3)
    expect.set_options(timeout=PATIENCE_S * 1e3)  # five seconds otherwise
    return page


@contextmanager
def acftc(*arguments: str, domain: int) -> Iterator[tuple[str, "subprocess.Popen[str]"]]:
    """Start `acftc ...`, give the address that it prints and the process; it is gone afterwards."""
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain), "BROWSER": "true"}
    process = subprocess.Popen(
        [sys.executable, "-m", "bringup.cli", *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
    )
    try:
        assert process.stderr is not None
        line = process.stderr.readline()
        assert line.startswith("http://"), line + process.stderr.read()
        yield line.split()[0], process
    finally:
        process.terminate()
        process.wait(PATIENCE_S)
        assert process.stderr is not None
        process.stderr.close()


def newest(page: Page, column: str) -> float:
    """Newest value of a column that the page shows; nan where there is none for a while (a page may be changing it)."""
    until_s = time.monotonic() + BETWEEN_S
    while math.isnan(value := newest_row(page).get(column, math.nan)) and time.monotonic() < until_s:
        page.wait_for_timeout(50)
    return value


def newest_row(page: Page) -> dict[str, float]:
    """Newest row that the page shows, by column; empty when there is none."""
    script = """() => {
        const source = window.Bokeh?.documents[0]?.get_model_by_name("rows")
        const columns = source ? Object.fromEntries(source.data.entries?.() ?? Object.entries(source.data)) : {}
        return Object.entries(columns).map(([name, values]) => [name, values[values.length - 1] ?? null])
    }"""
    return {name: math.nan if value is None else float(value) for name, value in page.evaluate(script)}


def observed_s(page: Page, since_s: float = 0.0) -> float:
    """How long the detector has observed since a time: of the ticks that a busy machine has missed it knows nothing."""
    script = """since => {
        const source = window.Bokeh?.documents[0]?.get_model_by_name("rows")
        const columns = source ? Object.fromEntries(source.data.entries?.() ?? Object.entries(source.data)) : {}
        return Array.from(columns.r_N ?? []).filter((value, i) => Number.isFinite(value) && columns.t[i] > since).length
    }"""
    return ROW_PERIOD_S * int(page.evaluate(script, since_s))


def until(condition: Callable[[], Any], what: str, patience_s: float = PATIENCE_S) -> None:
    """Wait for a condition of the page."""
    deadline = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < deadline, what
        time.sleep(0.05)


def lamp(page: Page, name: str) -> Locator:
    """One of the lamps at the head of the page."""
    return page.locator(f"[data-lamp={name}]")


def is_lit(page: Page, name: str) -> None:
    """Wait until a lamp is lit."""
    expect(lamp(page, name)).to_have_class(re.compile(r"\bon\b"))


def is_out(page: Page, name: str) -> None:
    """Wait until a lamp is out."""
    expect(lamp(page, name)).not_to_have_class(re.compile(r"\bon\b"))


def click(page: Page, name: str) -> None:
    """Click a button by its label."""
    page.get_by_role("button", name=name, exact=True).click()
