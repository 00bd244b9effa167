"""The live page of another plant, and beside a run that is recorded: each has a private graph."""

import math
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from ac_experiments.bags.reader import read_bag
from tests.domains import OWN
from tests.live_browser import (
    FIRST_TIME_S,
    PATIENCE_S,
    SETTLED_S,
    acftc,
    click,
    is_lit,
    lamp,
    new_page,
    newest,
    observed_s,
    until,
)

pytestmark = [pytest.mark.ros, pytest.mark.clock, pytest.mark.slow, pytest.mark.timeout(2 * FIRST_TIME_S)]

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def own_plant(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The car of docs/how-to/own-car.md: another refrigerant, other points."""
    target = tmp_path_factory.mktemp("car") / "own_car.yaml"
    examples = ["--points", "examples/own_points.yaml", "--parameters", "examples/own_car.yaml"]
    command = [sys.executable, "-m", "bringup.cli", "calibrate", *examples, "--out", str(target)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    return target


def test_a_plant_of_your_own(browser: Browser, own_plant: Path) -> None:
    """Plant, designs and the page's diagram are those of the file that `--plant` names."""
    with (
        acftc("--plant", str(own_plant), "dash", "--no-browser", domain=OWN + 2) as (url, _),
        new_page(browser) as page,
    ):
        page.goto(url, timeout=FIRST_TIME_S * 1e3)
        expect(lamp(page, "phase")).to_have_text("running", timeout=FIRST_TIME_S * 1e3)
        until(lambda: math.isclose(newest(page, "p_e"), 265.0, abs_tol=0.5), "not at rest at the car's medium point")
        assert newest(page, "p_e_reference") == pytest.approx(265.0)
        assert newest(page, "superheat_reference") == pytest.approx(15.0)
        until(lambda: observed_s(page) > SETTLED_S, "the loop stands still")
        click(page, "Inject f_N")
        is_lit(page, "isolated_f_N")
        click(page, "Reset")
        expect(page.locator(".said")).to_have_text("started anew, at rest")
        until(lambda: newest(page, "f_N") == 0.0, "the fault is still there")
        until(lambda: math.isclose(newest(page, "p_e"), 265.0, abs_tol=0.5), "not the car's medium point any more")


def test_run_with_a_page_beside_it(browser: Browser, tmp_path: Path) -> None:
    arguments = ("run", "nominal", "--set", "duration_s=3600", "--mode", "realtime", "--dash", "--out", str(tmp_path))
    with acftc(*arguments, domain=OWN + 1) as (url, process), new_page(browser) as page:
        page.goto(url)
        until(lambda: newest(page, "t") > 0.0, "no row has come", FIRST_TIME_S)
        expect(page.locator(".said")).to_have_text("A run that is recorded cannot be reset.")
        expect(page.get_by_role("button", name="Reset")).to_be_disabled()
        process.send_signal(signal.SIGINT)
        expect(page.get_by_role("alert")).to_be_visible()  # the server is gone, and the page says so
        assert process.wait(PATIENCE_S) == 130
    recording = read_bag(tmp_path / "bag")
    assert recording.metadata["mode"] == "realtime"
    assert len(recording.time_s) > 1
