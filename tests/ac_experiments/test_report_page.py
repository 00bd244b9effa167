"""The report in a real browser, from a file and without a network: the mouse points, drags and double-clicks."""

import re

import numpy as np
import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from ac_experiments.recording import Recording
from ac_experiments.report.page import write_report
from ac_experiments.scenario import load
from ac_experiments.simulate import simulate
from bringup.commands.outcome import companion
from tests.live_browser import new_page, until

pytestmark = pytest.mark.slow

ONSET_S, DURATION_S = 60.0, 120.0


@pytest.fixture(scope="module")
def run() -> Recording:
    return simulate(load("actuator_fault", [f"duration_s={DURATION_S}", f"faults.0.onset_s={ONSET_S}"]))


@pytest.fixture(scope="module")
def report(browser: Browser, run: Recording, tmp_path_factory: pytest.TempPathFactory) -> Page:
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(path, run, *companion(run))
    page = new_page(browser)
    page.asked = []
    page.on("request", lambda request: page.asked.append(request.url))
    page.goto(path.as_uri())
    expect(page.locator("#plots .main-svg").first).to_be_visible()
    return page


@pytest.fixture
def plot(report: Page) -> Locator:
    """The first plot of the whole run: the evaporator pressure."""
    plot = report.locator("#plots .nsewdrag").first
    plot.scroll_into_view_if_needed()
    return plot


def shown_s(page: Page, axis: str) -> list[float]:
    """What an axis of time of the whole run shows, s."""
    return [float(limit) for limit in page.evaluate(f"document.getElementById('plots').layout.{axis}.range")]


def at(plot: Locator, share: float) -> tuple[float, float]:
    """A place on the page: so far along a plot, halfway up."""
    box = plot.bounding_box()
    assert box is not None
    return box["x"] + share * box["width"], box["y"] + 0.5 * box["height"]


def test_pointing_at_a_curve_tells_its_values(report: Page, plot: Locator, run: Recording) -> None:
    low, high = shown_s(report, "xaxis")
    report.mouse.move(*at(plot, 0.45))
    report.mouse.move(*at(plot, 0.5))
    hint = report.locator("#plots .hoverlayer .legend")
    expect(hint).to_be_visible()
    middle = pytest.approx(0.5 * (low + high), abs=0.02 * (high - low))
    # The page may still tell of where the mouse was before.
    until(lambda: float(hint.locator("text").all_text_contents()[0]) == middle, "it tells of another time")
    words = hint.locator("text").all_text_contents()
    time_s = float(words[0])
    actual = run.series["plant/evaporator_pressure"][int(np.argmin(abs(run.time_s - time_s)))] / 1e3
    (told,) = [word for word in words if re.match(r"Actual\b(?!.*passive)", word, re.IGNORECASE)]
    assert float(told.rpartition(":")[2].strip().split()[0]) == pytest.approx(actual, rel=1e-3)


def test_dragging_zooms_all_plots_of_the_column_and_a_double_click_shows_all_again(report: Page, plot: Locator) -> None:
    low, high = whole = shown_s(report, "xaxis")
    report.mouse.move(*at(plot, 0.4))
    report.mouse.down()
    report.mouse.move(*at(plot, 0.6), steps=5)
    report.mouse.up()
    until(lambda: shown_s(report, "xaxis") != whole, "it does not zoom")
    expected = [low + share * (high - low) for share in (0.4, 0.6)]
    assert shown_s(report, "xaxis") == pytest.approx(expected, abs=0.02 * (high - low))
    assert shown_s(report, "xaxis3") == shown_s(report, "xaxis")  # the plot below
    report.mouse.dblclick(*at(plot, 0.5))
    until(lambda: shown_s(report, "xaxis") == pytest.approx(whole), "it does not come back")


def test_it_asked_nobody(report: Page) -> None:
    assert [url for url in report.asked if not url.startswith(("file:", "data:", "blob:"))] == []


def test_a_telephone_shows_one_plot_beside_nothing_else(browser: Browser, report: Page) -> None:
    narrow = new_page(browser, width=400, height=800)
    narrow.goto(report.url)
    expect(narrow.locator("#plots .main-svg").first).to_be_visible()
    assert narrow.evaluate("document.documentElement.scrollWidth") <= 400
    domains = "['xaxis', 'xaxis2'].map(axis => document.getElementById('plots').layout[axis].domain)"
    assert narrow.evaluate(domains) == [[0, 1], [0, 1]]
    narrow.set_viewport_size({"width": 1200, "height": 800})
    until(lambda: narrow.evaluate(domains)[0][1] < 0.5, "a wide window keeps the narrow plots")
    narrow.close()


def test_it_takes_three_pages_of_paper(report: Page) -> None:
    paper = report.pdf(prefer_css_page_size=True)
    assert len(re.findall(rb"/Type\s*/Page[^s]", paper)) <= 3
