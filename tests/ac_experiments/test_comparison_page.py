"""Several runs beside each other on a page."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ac_experiments.recording import Recording
from ac_experiments.report.comparison import named, write_comparison

Make = Callable[..., Recording]
FAULT = {"kind": "evaporator_pressure", "size_kpa": 5.0, "onset_s": 100.0}


def test_runs_are_compared_whatever_they_are(recording_of: Make, tmp_path: Path) -> None:
    weak, short = {**FAULT, "size_kpa": 3.0}, recording_of(duration_s=60.0)
    runs = named(
        [
            ("results/a", recording_of(faults=[FAULT])),
            ("results/b", recording_of(passive=True, faults=[weak])),
            ("elsewhere/a", short),
        ]
    )
    assert [run.name for run in runs] == ["results/a", "results/b", "elsewhere/a"]
    write_comparison(tmp_path / "comparison.html", runs)
    text = re.sub(r"<script.*?</script>|data:[^\"]*", "", (tmp_path / "comparison.html").read_text(), flags=re.S)
    assert "3 runs compared" in text
    assert "<td>faults.0.size_kpa</td><td>5.0</td><td>3.0</td><td>–</td>" in text
    assert "<td>K0 alone</td>" in text
    assert "results/b: 1 of 1 faults isolated, no false alarm" in text
    row = re.search(r"<tr><td>Peak of actual p<sub>e</sub>.*?</tr>", text)
    assert row is not None
    assert re.findall(r"<td>([\d.]+)</td>", row[0]) == ["1.000", "1.000", "0.000"]
    for name in ("comparison", "comparison_fault_1"):
        picture = ET.parse(tmp_path / f"{name}.svg")
        written = {"".join(node.itertext()).strip() for node in picture.iter("{http://www.w3.org/2000/svg}text")}
        assert {"results/a", "results/b", "reference"} <= written


def test_names_are_short_where_that_tells_runs_apart(recording_of: Make) -> None:
    run = recording_of(duration_s=10.0)
    assert [one.name for one in named([("results/a", run), ("results/b", run)])] == ["a", "b"]
    assert [one.name for one in named([("results/a", run), ("results/a", run)])] == ["results/a (1)", "results/a (2)"]


def test_the_same_run_twice_differs_in_nothing(recording_of: Make, tmp_path: Path) -> None:
    run = recording_of(duration_s=30.0)
    for key in run.series:
        run.series[key] = np.full_like(run.time_s, np.nan)
    write_comparison(tmp_path / "same.html", named([("a", run), ("b", run)]))
    assert "The scenarios are the same." in (tmp_path / "same.html").read_text()
