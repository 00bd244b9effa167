"""Plots: what is thinned stays true, and both ways of drawing draw the same."""

import base64
import json
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ac_experiments.recording import Recording
from ac_experiments.report.charts import EVERY_POINT, MISS, Chart, Curve, Mark, Points, kept_ticks
from ac_experiments.report.matplotlib_charts import draw, mathtext, save
from ac_experiments.report.moments import around
from ac_experiments.report.panels import STORY, charts_of
from ac_experiments.report.plotly_charts import figure

SVG = "{http://www.w3.org/2000/svg}"
Make = Callable[..., Recording]
FAULT = {"kind": "compressor_speed", "size_rpm": 40.0, "onset_s": 100.0}


def drawn_again(kept: np.ndarray, values: np.ndarray, step: bool) -> np.ndarray:
    """What a plot of the kept points shows at every tick."""
    ticks = np.arange(len(values))
    if step:
        return values[kept][np.searchsorted(kept, ticks, side="right") - 1]
    return np.interp(ticks, kept, values[kept])


PIECES = st.lists(
    st.tuples(st.sampled_from(["rest", "ramp", "noise", "wave", "spike"]), st.integers(1, 3000), st.floats(-1e4, 1e4)),
    min_size=1,
    max_size=6,
)


def as_plotly_reads(charts: list[Chart], columns: int = 2) -> go.Figure:
    """What plotly's own classes, which know every property and what it may be, make of what is written."""
    written = json.loads(json.dumps(figure(charts, columns), allow_nan=False))
    read = go.Figure(written)
    assert json.loads(read.to_json()) == {**written, "layout": {k: v for k, v in written["layout"].items() if v != []}}
    return read


def signal_of(pieces: list[tuple[str, int, float]]) -> np.ndarray:
    rng, parts, level = np.random.default_rng(0), [], 0.0
    for kind, length, size in pieces:
        x = np.arange(length) / length
        shape = {
            "rest": 0.0 * x,
            "ramp": x,
            "noise": rng.normal(size=length) * (length < 500),
            "wave": np.sin(20 * x),
            "spike": 1.0 * (x == x[-1]),
        }[kind]
        parts.append(level + size * shape)
        level = float(parts[-1][-1])
    return np.concatenate(parts)


@settings(max_examples=100, deadline=None)
@given(PIECES, st.booleans())
@example([("rest", 2, 0.0), ("noise", 14, 1.0), ("wave", 1984, 1608.0)], False)  # a point for the mouse in between
def test_a_thinned_plot_shows_every_tick_as_it_was(pieces: list[tuple[str, int, float]], step: bool):
    values = signal_of(pieces)
    kept = kept_ticks(np.arange(len(values)) * 0.1, [(values, step)])
    assert kept[0] == 0
    assert kept[-1] == len(values) - 1
    assert np.abs(drawn_again(kept, values, step) - values).max() <= MISS * np.ptp(values) * (1 + 1e-9)


def test_rest_takes_few_points_and_a_spike_is_kept():
    values = np.zeros(15_000)
    values[7_123] = 1.0
    ramp = np.linspace(0.0, 5.0, len(values))
    kept = kept_ticks(np.arange(len(values)) * 0.1, [(values, False), (ramp, False)])
    assert len(kept) < 1_000
    assert 7_123 in kept


def test_long_noise_keeps_the_extremes_of_every_signal():
    rng = np.random.default_rng(1)
    signals = [rng.normal(size=4 * EVERY_POINT) for _ in range(5)]
    signals[2][100:200] = np.nan
    kept = kept_ticks(np.arange(len(signals[0])) * 0.1, [(values, False) for values in signals])
    assert len(kept) < EVERY_POINT
    for values in signals:
        assert values[kept][np.isfinite(values[kept])].max() == np.nanmax(values)
        assert values[kept][np.isfinite(values[kept])].min() == np.nanmin(values)
    assert np.isnan(signals[2][kept]).any()  # the gap is still one


def test_a_step_is_no_ramp():
    ramp = np.linspace(0.0, 1.0, 10_001)
    assert len(kept_ticks(np.arange(10_001.0), [(ramp, False)])) < 600
    assert len(kept_ticks(np.arange(10_001.0), [(ramp, True)])) > 1 / MISS


@pytest.fixture
def charts(recording_of: Make) -> list[Chart]:
    return charts_of(recording_of(faults=[FAULT], design="paper"))


def test_a_run_is_drawn_with_axes_units_and_what_the_marks_mean(charts: list[Chart]):
    assert [chart.y_title for chart in charts[:6]] == [
        "p<sub>e</sub>, kPa",
        "SH, K",
        "N, rpm",
        "opening, %",
        "r<sub>N</sub>, rpm",
        "r<sub>p</sub>, kPa",
    ]
    assert {chart.x_title for chart in charts} == {"Time, s"}
    assert charts[0].x_range == (0.0, 200.0)
    assert [(mark.name, mark.at) for mark in charts[0].marks] == [
        ("fault begins", 100.0),
        ("detected", 103.0),
        ("f<sub>N</sub> isolated: Q<sub>act</sub> takes over", 107.0),
        ("p<sub>e</sub> back at its reference", pytest.approx(118.4)),
    ]
    residual = next(chart for chart in charts if chart.y_title == "r<sub>N</sub>, rpm")
    assert [(points.name, list(points.x)) for points in residual.points] == [
        ("detected", [103.0]),
        ("isolated", [107.0]),
    ]
    names = [curve.name for chart in charts for curve in chart.curves]
    for name in ("reference", "actual", "measured", "commanded", "at the plant", "residual", "fault injected"):
        assert name in names
    truth = next(curve for curve in residual.curves if curve.name == "fault injected")
    assert truth.y[-1] == pytest.approx(40.0)  # rpm, not rad/s


def test_a_window_shows_every_tick_of_it(recording_of: Make):
    (chart,) = charts_of(recording_of(faults=[FAULT]), None, ("N",), around(100.0))
    assert chart.x_range == (80.0, 200.0)
    assert np.diff(chart.curves[0].x).max() == pytest.approx(0.1)


def test_both_runs_are_told_apart_without_colour(recording_of: Make):
    charts = charts_of(recording_of(faults=[FAULT]), recording_of(passive=True, faults=[FAULT]), STORY)
    for chart in charts:
        looks = [(curve.dash, curve.width) for curve in chart.curves if curve.name]
        assert len(set(looks)) == len(looks), chart.title


def test_the_page_and_the_picture_show_the_same(charts: list[Chart]):
    moving = as_plotly_reads(charts)
    shown = {trace.name for trace in moving.data if trace.name}
    picture = ET.fromstring(draw(charts, 2, "a <title>"))
    written = {"".join(text.itertext()).strip() for text in picture.iter(SVG + "text")}
    for chart in charts:
        assert chart.title in written
        assert any(chart.title in note.text for note in moving.layout.annotations)
        for curve in chart.curves:
            if curve.name:
                assert curve.name in written
                assert curve.name in shown
    assert "fault begins" in written
    assert "fault begins" in shown
    assert sum(len(chart.marks) + len(chart.spans) for chart in charts) == len(moving.layout.shapes)


def test_the_pictures_curve_is_where_it_belongs():
    x = np.linspace(0.0, 10.0, 5)
    picture = draw([Chart("a & b", [Curve(x, 3.0 * x, "line <1>", "#123456")])])
    (path,) = (
        path.attrib["d"]
        for path in ET.fromstring(picture).iter(SVG + "path")
        if "#123456" in path.attrib.get("style", "") and "clip-path" in path.attrib
    )
    points = np.array(re.findall(r"[ML] ?(-?[\d.]+) (-?[\d.]+)", path), dtype=float)
    assert len(points) >= 2
    slopes = np.diff(points, axis=0)
    assert (slopes[:, 1] < 0).all()  # up is up
    assert np.ptp(slopes[:, 1] / slopes[:, 0]) < 0.01


def test_missing_values_logarithms_and_marks_are_drawn_both_ways(tmp_path: Path):
    x = np.array([1e-3, 1e-2, 1e-1, 1.0])
    y = np.array([1.0, np.nan, 10.0, 100.0])
    marks = [Mark(0.01, "here", "#000000", "dash")]
    points = [Points([0.1], [10.0], "there", "triangle", "#000000")]
    charts = [Chart("log", [Curve(x, y, "gap", step=True)], "y", "x", marks=marks, points=points, log="xy")]
    text = save(charts, tmp_path / "picture", 1, "picture")
    assert ET.fromstring(text) is not None
    assert (tmp_path / "picture.svg").read_text() == text
    assert (tmp_path / "picture.png").read_bytes().startswith(b"\x89PNG")
    assert draw(charts, 1, "picture") == text  # the same twice
    assert as_plotly_reads(charts, 1).layout.xaxis.type == "log"


@pytest.mark.parametrize("x", [np.ones(9), np.arange(9) / 10.0, np.geomspace(1e-9, 1e-7, 9)])
def test_the_abscissa_is_what_it_is(x: np.ndarray):
    """However it is written: in full, or by start and step; plotly.js takes no step for one."""
    curve = Curve(x, np.arange(9.0), "a", "#123456")
    trace = figure([Chart("one", [curve])], 1)["data"][0]
    if "x" in trace:
        read = np.frombuffer(base64.b64decode(trace["x"]["bdata"]), trace["x"]["dtype"])
    else:
        read = trace["x0"] + (trace["dx"] or 1.0) * np.arange(9)
    assert read == pytest.approx(x, rel=1e-5)


def test_subscripts():
    assert mathtext("p<sub>e</sub>, kPa") == r"p$_{\mathrm{e}}$, kPa"
    assert mathtext("5 $") == r"5 \$"
