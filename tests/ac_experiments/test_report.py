"""The report: whole in itself, and it shows what it should."""

import json
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from ac_experiments.metrics import summarise
from ac_experiments.recording import Recording
from ac_experiments.report.narrative import BAD, GOOD, narrative
from ac_experiments.report.nodes import Report, events_of, health_charts
from ac_experiments.report.page import render, write_report
from ac_experiments.scenario import load
from ac_experiments.simulate import simulate
from ac_experiments.versions import versions
from ac_plant_node.parameters.file import PLANT_VARIABLE
from bringup.commands.outcome import companion

Make = Callable[..., Recording]
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
SENSOR = {"kind": "evaporator_pressure", "size_kpa": 5.0, "onset_s": 100.0}


@pytest.fixture(scope="module")
def page(recording_of: Make) -> str:
    e5 = load("actuator_fault").model_dump(mode="json", exclude={"passive"})
    return render(recording_of(**e5), recording_of(passive=True, **e5), "The passive run beside it is <made up>.")


class _Links(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.links: list[str] = []
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "link", "br", "hr", "img"):
            self.open.append(tag)
        self.links += [value or "" for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def text_of(page: str) -> str:
    return re.sub(r"<script.*?</script>|data:[^\"]*", "", page, flags=re.S)


def test_it_needs_nothing_from_outside(page: str):
    parser = _Links()
    parser.feed(page)
    assert parser.open == []  # well-formed
    assert all(link.startswith(("#", "data:")) for link in parser.links)
    targets = {link[1:] for link in parser.links if link.startswith("#")}
    assert targets <= set(re.findall(r"<h2 id=([\w-]+)>", page))
    assert "@import" not in text_of(page)
    assert len(page) < 4_000_000  # a run of 1000 s, active and passive


def test_it_says_what_was_run_and_what_came_of_it(page: str):
    text = text_of(page)
    assert "actuator_fault (active)" in text
    assert "At 500 s the compressor begins to turn 40 rpm faster than commanded." in text
    assert "isolated as a fault of the compressor speed after 7.0 s" in text
    assert "No false alarm." in text
    assert "acftc simulate actuator_fault --out results" in text  # a built-in one needs no file
    assert "onset_s: 500" in text
    assert "&lt;made up&gt;" in text  # notes are escaped
    # The paper's numbers stand beside ours: -40 active and -20 passive.
    row = re.search(r"<tr><td>Change of the commanded.*?</tr>", text).group()
    cells = re.findall(r"<td>(.*?)</td>", row)
    assert cells[1:] == ["rpm", "−40.00", "−40", "−40.00", "−20"]


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")
def test_a_browser_draws_the_plots_without_a_network(page: str, tmp_path: Path):
    (tmp_path / "report.html").write_text(page)
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--host-resolver-rules=MAP * ~NOTFOUND"]
    options += [
        f"--user-data-dir={tmp_path / 'profile'}",
        "--virtual-time-budget=10000",
        "--no-first-run",
        "--dump-dom",
    ]
    command = [str(CHROMIUM), *options, (tmp_path / "report.html").as_uri()]
    shown = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120).stdout
    body = re.search(r"<body.*?>", shown).group()
    assert "still" not in body  # what could not be drawn would show as a still picture
    plots = re.findall(r'<div id="(plots\w*)"[^>]*class="js-plotly-plot"', shown)
    assert plots == ["plots_fault_1", "plots"]
    # Curves of both plots: each panel has its own, and thresholds and marks besides.
    assert len(re.findall(r'class="js-line"', shown)) > 2 * 8


def test_there_are_pictures_for_print_of_every_plot(page: str):
    assert page.count("class=print") == page.count("class=screen>") == 2
    assert "around 500 s" in page


def test_the_papers_numbers_are_left_out_for_another_experiment(recording_of: Make):
    another = load("actuator_fault", ["faults.0.size_rpm=60", "duration_s=540"])
    text = text_of(render(recording_of(**another.model_dump(mode="json", exclude={"passive"}))))
    assert "Paper" not in text
    assert "acftc simulate scenario.yaml" in text


def test_it_works_for_a_recording_cut_short_and_without_a_fault(recording_of: Make):
    whole = recording_of(noise={"seed": 1})
    for ticks in (1, 50):
        cut = Recording(
            whole.time_s[:ticks],
            {key: values[:ticks] for key, values in whole.series.items()},
            [],
            {**whole.metadata, "complete": False, "wall_seconds": None},
        )
        text = text_of(render(cut))
        assert "cut short" in text
        assert "No fault was injected" in text


def test_a_recording_of_nothing_but_gaps_still_has_a_report(recording_of: Make):
    run = recording_of(faults=[SENSOR])
    for key in run.series:
        run.series[key] = np.full_like(run.time_s, np.nan)
    assert "cannot" not in text_of(render(run))


def test_a_run_beside_is_compared_as_far_as_the_run_goes(recording_of: Make):
    whole, other = recording_of(faults=[SENSOR]), recording_of(passive=True, faults=[SENSOR])
    other.series["plant/evaporator_pressure"][1900:] += 5e4
    part = Recording(
        whole.time_s[:1500],
        {key: values[:1500] for key, values in whole.series.items()},
        whole.status[:1500],
        {**whole.metadata, "complete": False},
    )
    row = re.search(r"<tr><td>Peak of actual p<sub>e</sub>.*?</tr>", text_of(render(part, other))).group()
    assert re.findall(r"<td>([\d.]+)</td>", row) == ["1.000", "1.000"]


def test_nodes_and_pictures_beside_it(recording_of: Make, tmp_path: Path):
    figures = {"state": "active", "latency_p50_ms": "0.2", "latency_max_ms": "1.0", "rejected_inputs": "0"}
    reports = [
        Report(float(k), "fdi", "active", {**figures, "rejected_inputs": str(k // 2), "last_rejected": "<NaN>"})
        for k in range(3)
    ]
    recording = recording_of(faults=[SENSOR])
    recording.metadata["parameters"] = {"fdi": {"sensors": 3}}
    recording.metadata["software"] = {"acftc": "1.2.3"}
    write_report(tmp_path / "report.html", recording, reports=reports)
    text = text_of((tmp_path / "report.html").read_text())
    assert "<td><code>fdi</code></td><td>active</td><td>0.20</td><td>1.00</td><td>0</td><td>1 &lt;NaN&gt;</td>" in text
    assert "1 input refused (the last: &lt;NaN&gt;)" in text
    assert "sensors: 3" in text
    assert "1.2.3" in text
    for name in ("report", "report_fault_1", "report_nodes"):
        ET.parse(tmp_path / f"{name}.svg")
        assert (tmp_path / f"{name}.png").stat().st_size > 10_000


def test_no_passive_run_of_another_plant_beside_it(
    recording_of: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The companion would be simulated with the plant in use now; it is left out when the recording had another."""
    run = recording_of(duration_s=12.0, faults=[{**SENSOR, "onset_s": 5.0}])
    run.metadata["software"] = versions()
    beside, _ = companion(run)
    assert beside is not None
    other = tmp_path / "heavy.yaml"
    other.write_text("charge_kg: 0.52\n")
    monkeypatch.setenv(PLANT_VARIABLE, str(other))
    beside, note = companion(run)
    assert beside is None
    assert "recorded with another plant, which `acftc --plant FILE` names" in note
    run.metadata["software"] = versions()
    assert run.metadata["software"]["plant"].startswith("heavy.yaml ")
    monkeypatch.delenv(PLANT_VARIABLE)
    assert companion(run) == (None, note)


# ----------------------------------------------------------------------------------------------- the narrative


def kinds(summary: dict) -> dict[str, str]:
    return {sentence.text: sentence.kind for sentence in narrative(summary)}


def test_the_story_of_a_fault_that_was_missed_or_taken_for_another(recording_of: Make):
    run = recording_of(faults=[SENSOR])
    told = kinds(summarise(run))
    named = "Detected 3.0 s later, isolated as a fault of the pressure sensor after 7.0 s"
    assert told[f"{named}; its size was estimated as 5.0 kPa."] == GOOD
    missed = kinds(summarise(replace(run, status=[])))
    assert missed["It was not detected."] == BAD
    wrong = [row._replace(isolated=row.isolated and "compressor_speed") for row in run.status]
    told = kinds(summarise(replace(run, status=wrong)))
    assert any(text.startswith("Detected 3.0 s later, but isolated wrongly") and told[text] == BAD for text in told)
    alarm = "1 false alarm: at 107.0 s a fault of the compressor speed was named, to the end."
    assert told[alarm] == BAD


def test_the_story_tells_how_the_pressure_fared_with_and_without(recording_of: Make):
    run, other = recording_of(faults=[SENSOR]), recording_of(passive=True, faults=[SENSOR])
    other.series["plant/evaporator_pressure"][1000:] -= 5e3
    (sentence,) = (
        one.text for one in narrative(summarise(run), summarise(other)) if one.text.startswith("The actual evaporator")
    )
    own, without = sentence.split(". ")
    assert own == (
        "The actual evaporator pressure left its reference by up to 1.00 kPa "
        "and was back within 0.25 kPa for good after 18.4 s"
    )
    assert without == (
        "Without accommodation it left its reference by up to 5.00 kPa and did not come back to within 0.25 kPa."
    )


# ---------------------------------------------------------------------------------------------------- the events


def report(time_s: float, message: str = "active", node: str = "fdi", **values: str) -> Report:
    return Report(time_s, node, message, {"state": "active", **values})


def test_business_as_usual_is_no_event():
    reports = [Report(0.0, "fdi", "inactive", {"state": "inactive"}), report(1.0, rejected_inputs="0"), report(2.0)]
    assert events_of(reports) == []


def test_what_is_out_of_the_ordinary_is_an_event():
    reports = [
        report(0.0, node="gimc_controller"),
        report(1.0, node="fdi", rejected_inputs="2", **{"rejected/not finite": "2"}, last_rejected="p_e is nan"),
        report(2.0, node="ac_plant", missed_ticks="3"),
        report(3.0, "no q: K0 alone", node="gimc_controller", announced=json.dumps([[102.5, "no q: K0 alone"]])),
        report(3.5, "no q: K0 alone", node="gimc_controller", announced=json.dumps([[102.5, "no q: K0 alone"]])),
        report(4.0, "disk full", node="recorder"),
        report(4.5, "no design", node="gimc_controller", announced=json.dumps([[102.5, "no q: K0 alone"]])),
        report(5.0, node="gimc_controller", announced="not JSON"),
        report(6.0, node="fdi", rejected_inputs="2"),
    ]
    assert [(event.time_s, event.node, event.what) for event in events_of(reports, first_tick_s=100.0)] == [
        (1.0, "fdi", "2 inputs refused (2 not finite; the last: p_e is nan)"),
        (2.0, "ac_plant", "3 ticks missed (command late, the last one held)"),
        (2.5, "gimc_controller", "no q: K0 alone"),
        (4.0, "recorder", "disk full"),
        (4.5, "gimc_controller", "no design"),
    ]


def test_a_node_that_was_started_again_is_an_event():
    restarts = [
        {"node": "fdi", "died_s": 12.5, "reason": "killed by SIGKILL: ", "back_s": 14.0},
        {"node": "recorder", "died_s": 20.0, "reason": "exit code 1: disk full", "back_s": float("nan")},
    ]
    reports = [
        Report(13.0, "bringup", "restarting fdi", {"restarts": json.dumps(restarts[:1])}),
        Report(21.0, "bringup", "restarting recorder", {"restarts": json.dumps(restarts)}),
    ]
    assert [(event.time_s, event.node, event.what) for event in events_of(reports)] == [
        (12.5, "fdi", "died (killed by SIGKILL: ) and was started again; back in service 1.5 s later"),
        (20.0, "recorder", "died (exit code 1: disk full) and was started again; not back in service"),
    ]


def test_a_simulated_run_has_its_events_too():
    """Air flow far beyond the design range: compensator and protection act, and say so."""
    far = load("nominal", ["duration_s=40", "air.mass_flow_percent=[{at_s: 5, to: -80}]"])
    text = text_of(render(simulate(far)))
    rows = re.findall(r"<tr><td>([\d.]+)</td><td><code>(\w+)</code></td><td>([^<]+)</td><td>([\d.–]+)</td></tr>", text)
    named = [row for row in rows if row[1] == "fdi"]
    assert [what.partition(":")[0] for _, _, what, _ in named][:1] == ["fault detected"]
    rows = [row[:3] for row in rows if row[1] != "fdi"]
    assert {(node, what.partition(":")[0]) for _, node, what in rows} == {
        ("compensator", "outside the design range"),
        ("gimc_controller", "superheat too low (liquid to the compressor)"),
    }
    assert all(5.0 <= float(time_s) < 40.0 for time_s, _, _ in rows)
    assert f"{len(rows)} events reported by compensator, gimc_controller: see Events." in text
    assert "None: no node refused an input" in text_of(render(simulate(load("nominal", ["duration_s=1"]))))


def test_timing_over_the_run_is_drawn_node_by_node():
    reports = [report(float(k), latency_p50_ms="0.2", latency_max_ms="nan", rate_hz="10") for k in range(3)]
    figures = {"latency_p50_ms": "1", "latency_max_ms": "2", "rate_hz": "9"}
    reports += [report(float(k), node="gimc_controller", **figures) for k in range(3)]
    curves = [[curve.name for curve in chart.curves] for chart in health_charts(reports)]
    assert curves == [["gimc_controller", "fdi"], ["gimc_controller"], ["gimc_controller"]]
    assert health_charts([]) == []
