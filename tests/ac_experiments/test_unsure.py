"""A fault whose name is not sure is told as such, wherever it is told: nothing is done about it."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ac_common.fdi_status import NEVER_SURE, NO_LONGER, NOT_SURE, SURE, StatusRow
from ac_experiments.bags.export import table_of
from ac_experiments.bags.reader import read_bag
from ac_experiments.bags.simulated import write_bag
from ac_experiments.decisions import spells_of, unsure_of
from ac_experiments.designs import designs_of
from ac_experiments.metrics import summarise
from ac_experiments.recording import Recording
from ac_experiments.report.comparison import named, write_comparison
from ac_experiments.report.moments import UNSURE, marks_of, spans_of
from ac_experiments.report.narrative import narrative
from ac_experiments.report.page import render
from tests.small_faults import ONSET_S, SENSOR, lost_between, never_sure, sure_later, with_small

NAN = float("nan")


def text_of(page: str) -> str:
    return re.sub(r"<script.*?</script>|data:[^\"]*", "", page, flags=re.S)


def acts_from(run: Recording) -> float | None:
    """When q leaves zero, s: what the compensator did, whatever was told."""
    acts = np.flatnonzero(run.series["compensator/q:compressor"])
    return float(run.time_s[acts[0]]) if len(acts) else None


def test_the_summary_says_from_when_on_a_name_is_acted_on(tmp_path: Path) -> None:
    run = sure_later()
    summary = summarise(run)
    (fault,), (isolation,) = summary["faults"], summary["isolations"]
    assert fault["isolated_as"] == isolation["kind"] == "evaporator_pressure"
    assert fault["isolated_s"] == isolation["time_s"]
    assert fault["isolated_s"] + 1.0 < fault["sure_s"] == isolation["sure_s"]
    assert acts_from(run) == pytest.approx(fault["sure_s"] + run.metadata["sample_time_s"])  # q begins at zero
    write_bag(tmp_path / "bag", run, designs_of(with_small(SENSOR)))
    again = summarise(read_bag(tmp_path / "bag"))
    assert [again[key] for key in ("faults", "isolations")] == [summary[key] for key in ("faults", "isolations")]


def test_a_name_that_is_never_sure_is_never_acted_on() -> None:
    run = never_sure()
    summary = summarise(run)
    (fault,), (alarm,) = summary["faults"], summary["false_alarm_list"]
    assert fault["isolated_as"] == alarm["kind"] == "evaporator_pressure"
    assert fault["sure_s"] is alarm["sure_s"] is acts_from(run) is None
    told = [sentence.text for sentence in narrative(summary)]
    assert sum(NEVER_SURE in text for text in told) == 2  # of the fault, and of the false alarm
    assert [(span.start, span.stop) for span in spans_of(run, 0.0, 150.0) if span.name == UNSURE] == [
        (fault["isolated_s"], 150.0)
    ]
    assert not any("sure" in mark.name for mark in marks_of(run))


def test_the_report_shows_and_says_it() -> None:
    run = sure_later()
    (fault,) = summarise(run)["faults"]
    found_s, sure_s = fault["isolated_s"], fault["sure_s"]
    (strip,) = (span for span in spans_of(run, 0.0, 150.0) if span.name == UNSURE)
    assert (strip.start, strip.stop) == (found_s, sure_s)
    assert strip.height < 0.5 < strip.opacity  # no other shade of the time with a fault
    acts = "its estimate is taken off the reading"
    assert (f"f<sub>p</sub> is sure: {acts}", sure_s) in [(mark.name, mark.at) for mark in marks_of(run)]
    text = text_of(render(run))
    assert f"<td>{found_s:.1f}, sure {sure_s:.1f}</td>" in text
    assert "“Sure”: until then" in text
    assert f"after {found_s - ONSET_S:.1f} s, sure after {sure_s - ONSET_S:.1f} s; its size" in text
    rows = re.findall(r"<tr><td>([\d.]+)</td><td><code>fdi</code></td><td>([^<]+)</td>", text)
    assert rows[-2:] == [
        (f"{found_s:.1f}", f"a fault of the pressure sensor isolated: {NOT_SURE}"),
        (f"{sure_s:.1f}", f"a fault of the pressure sensor is sure: {acts}"),
    ]


def test_runs_beside_each_other_and_tables_say_it(tmp_path: Path) -> None:
    write_comparison(tmp_path / "two.html", named([("later", sure_later()), ("never", never_sure())]))
    text = text_of((tmp_path / "two.html").read_text())
    assert re.search(r"<td>\d+\.\d, sure \d+\.\d</td>", text)
    assert re.search(rf"<td>\d+\.\d, {NEVER_SURE}</td>", text)
    table, (fault,) = table_of(sure_later()), summarise(sure_later())["faults"]
    unsure_s = [time_s for time_s, name in zip(table["time_s"], table["fdi_unsure"], strict=True) if name]
    assert unsure_s[0] == fault["isolated_s"]
    assert unsure_s[-1] < fault["sure_s"]


@pytest.mark.parametrize("later", [None, "compressor_speed"])
def test_a_name_that_is_given_again_is_unsure_again(later: str | None) -> None:
    """Also beside another one that is sure."""
    said = [("evaporator_pressure", None), ("evaporator_pressure", "evaporator_pressure"), (later, None)]
    said += [("evaporator_pressure", "evaporator_pressure"), ("evaporator_pressure", None)]
    rows = [
        StatusRow(float(at), True, name, NAN, NAN, NAN, (1.0, 1.0), later if name != later else None, unsure)
        for at, (name, unsure) in enumerate(said)
    ]
    names = [spell for spell in spells_of(rows) if spell.kind == "evaporator_pressure"]
    assert [(one.start_s, one.sure_s) for one in names] == [(0.0, 0.0), (3.0, 4.0)]
    unsure = [(one.kind, one.start_s, one.end_s) for one in unsure_of(rows)]
    assert unsure == [("evaporator_pressure", 1.0, 2.0), ("evaporator_pressure", 3.0, 4.0)]


def test_a_name_that_is_sure_no_longer_is_told_and_when_it_is_again() -> None:
    run = sure_later()
    (fault,) = summarise(run)["faults"]
    lost_s, again_s = (round(fault["sure_s"] + later_s, 1) for later_s in (5.0, 10.0))
    run = replace(run, status=lost_between(run.status, lost_s, again_s))
    spans = [(span.start, span.stop) for span in spans_of(run, 0.0, 150.0) if span.name == UNSURE]
    assert spans == [(fault["isolated_s"], fault["sure_s"]), pytest.approx((lost_s, again_s))]
    told = re.findall(r"<tr><td>([\d.]+)</td><td><code>fdi</code></td><td>([^<]+)</td>", text_of(render(run)))
    assert told[-2][0] == f"{lost_s:.1f}"
    assert told[-2][1].endswith(NO_LONGER)
    assert told[-1][0] == f"{again_s:.1f}"
    assert f" {SURE}: " in told[-1][1]
