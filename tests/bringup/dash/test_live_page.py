"""The live page in a real browser beside a real graph: click, and see what comes of it."""

import math
import re
from collections.abc import Iterator
from urllib.parse import urlsplit

import psutil
import pytest
from playwright.sync_api import Browser, Page, expect

from ac_common.faults import BY_KIND, UNFILTERED
from ac_common.units import KPA
from ac_plant_node.rest import rest_at
from bringup.dash.rows import ROW_PERIOD_S
from tests.domains import OWN
from tests.live_browser import (
    FIRST_TIME_S,
    PATIENCE_S,
    SETTLED_S,
    acftc,
    click,
    is_lit,
    is_out,
    lamp,
    new_page,
    newest,
    newest_row,
    observed_s,
    until,
)

expect.set_options(timeout=PATIENCE_S * 1e3)

pytestmark = [pytest.mark.ros, pytest.mark.clock, pytest.mark.slow, pytest.mark.timeout(2 * FIRST_TIME_S)]


@pytest.fixture(scope="module")
def page(browser: Browser) -> Iterator[Page]:
    """One page with a private graph, and all that the browser asked anybody for."""
    with acftc("dash", "--no-browser", domain=OWN) as (url, process), new_page(browser) as page:
        page.server = process.pid
        page.asked = []
        page.complaints = []
        page.on("request", lambda request: page.asked.append(request.url))
        page.on("websocket", lambda opened: page.asked.append(opened.url))
        page.on("pageerror", lambda error: page.complaints.append(str(error)))
        page.on("console", lambda said: page.complaints.append(said.text) if said.type == "error" else None)
        # On a machine that has never been there, code has to be compiled and designs to be made first.
        page.goto(url, timeout=FIRST_TIME_S * 1e3)
        expect(lamp(page, "phase")).to_have_text("running", timeout=FIRST_TIME_S * 1e3)
        until(lambda: observed_s(page) > SETTLED_S, "no row has come")
        yield page
        assert process.poll() is None


def stands_still(page: Page) -> bool:
    before = newest(page, "t")
    page.wait_for_timeout(1000)
    return newest(page, "t") == before


def test_a_fault_injected_by_a_click_lights_the_lamps_and_shows_in_the_residual(page: Page) -> None:
    is_out(page, "detected")
    is_out(page, "isolated_f_N")
    threshold = newest(page, "threshold_r_N")
    until(lambda: abs(newest(page, "r_N")) < threshold, "the residual does not rest")
    page.get_by_label("size, rpm").fill("60")
    page.get_by_label("size, rpm").press("Enter")
    click(page, "Inject f_N")
    is_lit(page, "detected")
    is_lit(page, "isolated_f_N")
    is_out(page, "isolated_f_p")
    assert math.isclose(newest(page, "f_N"), 60.0)
    until(lambda: newest(page, "r_N") > 30.0, "the residual does not grow")
    expect(page.get_by_role("button", name="Stop f_N")).to_be_visible()
    row = newest_row(page)
    assert row["speed_actual"] - row["speed"] == pytest.approx(60.0, abs=1e-6)
    click(page, "Stop f_N")
    until(lambda: newest(page, "f_N") == 0.0, "the fault does not end")


def test_all_other_faults_are_offered_and_a_sensor_sticks(page: Page) -> None:
    kind, profile = (page.locator(f"select[name={name}_other]") for name in ("kind", "profile"))
    assert kind.locator("option").all_inner_texts() == [f"{fault.symbol}: {fault.name}" for fault in UNFILTERED]
    fault = BY_KIND["condenser_pressure_sensor"]
    kind.select_option(label=f"{fault.symbol}: {fault.name}")
    click(page, "Inject f_pc")
    share = 100.0 * fault.typical / fault.largest
    until(lambda: math.isclose(newest(page, "f_pc"), share), "the fault does not come")
    click(page, "Stop f_pc")
    until(lambda: newest(page, "f_pc") == 0.0, "the fault does not end")
    profile.select_option(label="stuck")
    expect(page.locator("input[name=size_other]")).to_be_hidden()
    click(page, "Inject f_pc")
    expect(page.locator(".said")).to_have_text("f_pc: stuck starts with the next tick")
    click(page, "Stop f_pc")
    kind.select_option(label=f"f_leak: {BY_KIND['refrigerant_leak'].name}")  # no sensor's
    expect(profile.locator("option", has_text="stuck")).to_have_count(0)
    expect(profile).to_have_value("step")


def test_a_dead_node_is_started_again_and_the_page_says_so(page: Page) -> None:
    click(page, "Pause")  # from then on the run counts from another first tick
    expect(lamp(page, "phase")).to_have_text("paused")
    click(page, "Resume")
    expect(lamp(page, "phase")).to_have_text("running")
    kill(page, "fdi_node")
    until(lambda: page.locator(".said").inner_text().startswith("fdi died (SIGKILL"), "nobody tells of it")
    expect(page.locator(".said")).to_have_text(re.compile(r"was started again; back in service \d+\.\d s later$"))
    expect(lamp(page, "phase")).to_have_text("running")
    until(lambda: math.isfinite(newest(page, "r_N")), "no residual comes")


def test_references_and_air_follow_what_is_typed(page: Page) -> None:
    rest = newest(page, "superheat_reference"), newest(page, "air_flow")
    page.get_by_label("within, s").fill("5")
    page.get_by_label("SH reference, K").fill("-2.5")
    page.get_by_label("blower, %").fill("10")
    page.get_by_label("blower, %").press("Enter")
    click(page, "Apply")
    expect(page.locator(".said")).to_have_text("SH reference -2.5 K; blower +10 %")
    until(lambda: math.isclose(newest(page, "superheat_reference"), rest[0] - 2.5), "the reference stays")
    until(lambda: math.isclose(newest(page, "air_flow"), 1.1 * rest[1]), "the air stays")
    click(page, "Back to zero")
    until(lambda: (newest(page, "superheat_reference"), newest(page, "air_flow")) == rest, "they do not come back")
    page.get_by_label("within, s").fill("20")


def test_a_number_out_of_range_is_not_sent(page: Page) -> None:
    before = newest(page, "superheat_reference")
    page.get_by_label("blower, %").fill("5")
    field = page.get_by_label("SH reference, K")
    field.fill("500")
    field.press("Enter")
    click(page, "Apply")
    expect(field).to_have_value("500")  # it stays as it was typed
    expect(page.locator(".said.failed")).to_have_text("SH reference, K: given 500; allowed: -18 to 30")
    field.fill("")
    field.press("Enter")
    click(page, "Apply")
    expect(page.locator(".said.failed")).to_have_text("SH reference, K: given nothing; allowed: -18 to 30")
    until(lambda: newest(page, "superheat_reference") == before, "the reference has moved")
    click(page, "Back to zero")
    expect(page.locator(".said.failed")).to_have_count(0)


def test_accommodation_is_switched_off_and_on(page: Page) -> None:
    is_lit(page, "accommodating")
    click(page, "Switch accommodation off")
    is_out(page, "accommodating")
    expect(lamp(page, "accommodating")).to_have_text("accommodation off")
    click(page, "Switch accommodation on")
    is_lit(page, "accommodating")


def test_only_the_chosen_time_is_sent_and_drawn(page: Page) -> None:
    """What is not shown costs the browser nothing; it comes back when it is asked for."""

    def times_s() -> list[float]:
        script = "(({ data }) => Array.from(data.get?.('t') ?? data.t))(Bokeh.documents[0].get_model_by_name('rows'))"
        return [float(at_s) for at_s in page.evaluate(script)]

    until(lambda: newest(page, "t") > 35.0, "the loop stands still")
    first_s = times_s()[0]
    click(page, "30 s")
    # On a machine that is too busy for the loop ticks are missed, and so are their rows.
    until(lambda: len(times_s()) <= round(30.0 / ROW_PERIOD_S) + 1, "it holds more than it shows")
    click(page, "300 s")
    until(lambda: times_s()[0] <= first_s, "what had been left out does not come back")
    click(page, "120 s")


def test_a_paused_loop_stands_still_and_goes_on(page: Page) -> None:
    click(page, "Pause")
    expect(lamp(page, "phase")).to_have_text("paused")
    until(lambda: stands_still(page), "it moves")  # what was on its way has come
    stopped = newest(page, "t")
    click(page, "Resume")
    expect(lamp(page, "phase")).to_have_text("running")
    until(lambda: newest(page, "t") > stopped, "it does not go on")


def kill(page: Page, module: str) -> None:
    """End a node of the page's private graph as the out-of-memory killer would."""
    (child,) = [child for child in psutil.Process(page.server).children() if module in child.cmdline()]
    child.kill()


def started_anew(page: Page) -> None:
    """Reset the loop, whatever the tests before have left of faults, and of what is told of them."""
    click(page, "Reset")
    expect(page.locator(".said")).to_have_text("started anew, at rest", timeout=FIRST_TIME_S * 1e3)
    expect(lamp(page, "phase")).to_have_text("running")


def test_the_load_moves_with_a_click_without_a_false_alarm_and_reset_puts_all_back(page: Page) -> None:
    rest = rest_at("med")["outputs"]
    started_anew(page)
    began_s = newest(page, "t")
    until(lambda: observed_s(page, began_s) > SETTLED_S, "the loop stands still")
    click(page, "traffic")
    expect(page.locator(".said")).to_contain_text("blower +30 %; air inlet +5 K")
    until(lambda: newest(page, "condenser_inlet") > 37.9, "the load stays")
    is_out(page, "detected")
    click(page, "Inject f_p")
    until(lambda: newest(page, "f_p") == 5.0, "no fault")
    is_lit(page, "isolated_f_p")
    started_anew(page)
    until(lambda: newest(page, "f_p") == 0.0, "the fault is still there")
    expect(page.get_by_role("button", name="Inject f_p")).to_be_visible()
    until(lambda: math.isclose(newest(page, "p_e"), rest[0] / KPA, rel_tol=1e-4), "not at rest")
    is_out(page, "detected")


def test_the_browser_asked_nobody_else_and_had_nothing_to_complain_of(page: Page) -> None:
    here = urlsplit(page.url).netloc
    assert {urlsplit(url).netloc for url in page.asked if not url.startswith(("data:", "blob:"))} == {here}
    assert any(url.startswith("ws://") for url in page.asked)
    assert page.complaints == []


def test_two_browsers_see_the_same_graph_and_a_page_can_be_loaded_again(page: Page, browser: Browser) -> None:
    with new_page(browser) as other:
        other.goto(page.url)
        until(lambda: newest(other, "t") > 0.0, "no row has come to the second page")
        click(other, "Inject f_p")
        expect(page.get_by_role("button", name="Stop f_p")).to_be_visible()
        click(page, "Stop f_p")
        expect(other.get_by_role("button", name="Inject f_p")).to_be_visible()
    page.reload()
    until(lambda: newest(page, "t") > 0.0, "no row has come after loading again")
    expect(lamp(page, "phase")).to_have_text("running")


#: Boxes (x, y, width, height) of all plots and panels that lie upon one another.
OVERLAPS = """() => {
    const boxes = [...document.querySelectorAll(".cell, .figures, aside > div")].map((e) => e.getBoundingClientRect())
    const meet = (a, b) => a.left < b.right - 1 && b.left < a.right - 1 && a.top < b.bottom - 1 && b.top < a.bottom - 1
    const drawn = [...document.querySelectorAll(".canvas")].map((e) => e.getBoundingClientRect().height)
    return [boxes.flatMap((a, i) => boxes.slice(i + 1).filter((b) => meet(a, b))).length, Math.min(...drawn)]
}"""


#: How far the plots reach beyond the box that they are in, px.
BEYOND = """() => {
    const reach = (e) => e.scrollHeight - e.clientHeight
    return Math.max(...[...document.querySelectorAll(".plots, .plots .cell")].map(reach))
}"""


@pytest.mark.parametrize(("width", "height"), [(1400, 900), (1920, 1080), (1400, 600), (1000, 800), (390, 844)])
def test_nothing_sticks_out_of_the_page_or_lies_upon_another(page: Page, width: int, height: int) -> None:
    page.set_viewport_size({"width": width, "height": height})
    until(lambda: page.evaluate("document.documentElement.scrollWidth") <= width, "it sticks out")
    until(lambda: page.evaluate(OVERLAPS)[0] == 0, "panels lie upon one another")
    until(lambda: page.evaluate(OVERLAPS)[1] >= 60.0, "a plot is too flat to be read")
    until(lambda: page.evaluate(BEYOND) <= 1, "a plot sticks out of its box")
    page.set_viewport_size({"width": 1400, "height": 900})
