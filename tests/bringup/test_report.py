"""The report: whole in itself, and it shows what it should."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import pytest

from bringup.recording import Recording
from bringup.report.page import render, write_report
from bringup.report.plots import time_plots
from bringup.ros.health import health_of
from bringup.scenario import load

Make = Callable[..., Recording]


@pytest.fixture
def actuator_run(recording_of: Make) -> Recording:
    return recording_of(**load("actuator_fault").model_dump(mode="json", exclude={"passive"}))


@pytest.fixture
def page(actuator_run: Recording, recording_of: Make) -> str:
    beside = recording_of(passive=True, **load("actuator_fault").model_dump(mode="json", exclude={"passive"}))
    return render(actuator_run, beside, "The passive run beside it is <made up>.")


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


def test_it_needs_nothing_from_outside(page: str):
    parser = _Links()
    parser.feed(page)
    assert parser.links == []
    assert parser.open == []  # well-formed
    assert "@import" not in re.sub(r"<script.*?</script>", "", page, flags=re.S)


def test_it_says_what_was_run_and_what_came_of_it(page: str):
    text = re.sub(r"<script.*?</script>", "", page, flags=re.S)
    assert "actuator_fault (active)" in text
    assert "isolated as compressor speed after 7.0 s" in text
    assert "no false alarm" in text
    assert "onset_s: 500" in text  # how to run it again
    assert "&lt;made up&gt;" in text  # notes are escaped
    # The paper's numbers stand beside ours: -40 active and -20 passive.
    row = re.search(r"<tr><td>Change of the commanded.*?</tr>", text).group()
    cells = re.findall(r"<td>(.*?)</td>", row)
    assert cells[1:] == ["rpm", "−40.00", "−40", "−40.00", "−20"]


def test_the_papers_numbers_are_left_out_for_another_experiment(recording_of: Make):
    content = load("actuator_fault", ["faults.0.size_rpm=60"]).model_dump(mode="json", exclude={"passive"})
    assert "Paper" not in re.sub(r"<script.*?</script>", "", render(recording_of(**content)), flags=re.S)


def test_the_plots_are_the_papers(actuator_run: Recording):
    figure = time_plots(actuator_run, None)
    titles = [note.text for note in figure.layout.annotations]
    for quantity in ("Evaporator pressure", "Superheat", "Compressor speed", "Expansion valve", "r<sub>N</sub>"):
        assert any(quantity in title for title in titles)
    names = [trace.name for trace in figure.data]
    for name in ("reference", "actual", "measured", "commanded", "reached the plant", "residual", "fault injected"):
        assert name in names
    marks = {trace.name: list(trace.x) for trace in figure.data if trace.mode == "markers"}
    assert marks == {"detected": [503.0], "isolated": [507.0]}
    truth = next(trace for trace in figure.data if trace.name == "fault injected")
    assert truth.y[-1] == pytest.approx(40.0)  # rpm, not rad/s


def test_it_works_for_a_recording_cut_short_and_without_a_fault(recording_of: Make):
    whole = recording_of(noise={"seed": 1})
    cut = Recording(
        whole.time_s[:50],
        {key: values[:50] for key, values in whole.series.items()},
        [],
        {**whole.metadata, "complete": False},
    )
    text = render(cut)
    assert "cut short" in text
    assert "No fault was injected" in text


def test_nodes_and_a_picture_beside_it(recording_of: Make, tmp_path: Path):
    reports = [
        ("fdi", {"state": "active", "latency_p50_ms": "0.2", "latency_max_ms": "1.0", "rejected_inputs": "0"}),
        ("fdi", {"state": "active", "latency_p50_ms": "0.4", "latency_max_ms": "nan", "rejected_inputs": "2"}),
    ]
    (health,) = health_of(reports)
    assert (health.latency_p50_ms, health.latency_max_ms, health.rejected_inputs) == (pytest.approx(0.3), 1.0, 2)
    recording = recording_of(faults=[{"kind": "evaporator_pressure", "size_kpa": 5.0, "onset_s": 100.0}])
    write_report(tmp_path / "report.html", recording, health=[health])
    assert "<code>fdi</code>" in (tmp_path / "report.html").read_text()
    assert "Around the fault" in (tmp_path / "report.html").read_text()
    ET.parse(tmp_path / "report.svg")
