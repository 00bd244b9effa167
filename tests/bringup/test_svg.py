"""Still pictures: valid SVG with the curves where they belong."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable

import numpy as np

from bringup.recording import Recording
from bringup.report.svg import HEIGHT, WIDTH, Chart, Curve, charts_of, draw

SVG = "{http://www.w3.org/2000/svg}"
Make = Callable[..., Recording]


def points(path: ET.Element) -> np.ndarray:
    return np.array(re.findall(r"[ML](-?[\d.]+) (-?[\d.]+)", path.attrib["d"]), dtype=float)


def curves(picture: str) -> list[ET.Element]:
    return [path for path in ET.fromstring(picture).iter(SVG + "path") if "clip-path" in path.attrib]


def test_a_straight_line_is_straight_and_fills_the_frame():
    x = np.linspace(0.0, 10.0, 5)
    (curve,) = curves(draw([Chart("a & b", [Curve(x, 3.0 * x, "line <1>")])]))
    drawn = points(curve)
    assert len(drawn) == 5
    assert drawn[0, 0] < 70
    assert drawn[-1, 0] > WIDTH - 20
    assert np.ptp(np.diff(drawn, axis=0), axis=0).max() < 0.2  # even steps
    assert drawn[0, 1] > drawn[-1, 1]  # up is up


def test_no_peak_is_lost_where_there_are_more_points_than_pixels():
    x = np.arange(100_000.0)
    y = np.zeros_like(x)
    y[31_416] = 1.0
    (curve,) = curves(draw([Chart("", [Curve(x, y, "spike")])]))
    drawn = points(curve)
    assert len(drawn) < 4 * WIDTH
    assert drawn[:, 1].min() == points(curves(draw([Chart("", [Curve(x[:2], np.array([0.0, 1.0]), "")])]))[0])[1, 1]


def test_a_missing_value_is_a_gap():
    y = np.array([1.0, 2.0, np.nan, 3.0, 2.0])
    (curve,) = curves(draw([Chart("", [Curve(np.arange(5.0), y, "gap")])]))
    assert curve.attrib["d"].count("M") == 2
    assert "nan" not in curve.attrib["d"]


def test_logarithmic_axes():
    x = np.logspace(-3, 2, 6)
    (curve,) = curves(draw([Chart("", [Curve(x, x**2, "power")], log="xy")]))
    drawn = points(curve)
    assert np.allclose(np.diff(drawn[:, 0]), np.diff(drawn[:, 0])[0], atol=0.2)
    assert np.allclose(np.diff(drawn[:, 1]), np.diff(drawn[:, 1])[0], atol=0.2)


def test_a_run_is_drawn_in_the_papers_layout(recording_of: Make):
    run = recording_of(faults=[{"kind": "compressor_speed", "size_rpm": 40.0, "onset_s": 100.0}])
    charts = charts_of(run, None, ("Compressor speed", "Evaporator pressure", "Expansion valve", "Superheat"))
    assert [chart.title.split()[0] for chart in charts] == ["Compressor", "Evaporator", "Expansion", "Superheat"]
    root = ET.fromstring(draw(charts, 2, "E5"))
    assert root.attrib["viewBox"] == f"0 0 {2 * WIDTH} {2 * HEIGHT}"
    assert root.find(SVG + "title").text == "E5"
