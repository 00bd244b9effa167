"""Plots for the page: zoom, pan and hover, by plotly.

They are written as plotly.js reads them; plotly's classes for that take a second to load and to check what is known.
"""

import base64
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ac_experiments.report.charts import BLACK, GREY, Chart, Curve, Points

_FONT = '"DejaVu Sans", system-ui, sans-serif'


@dataclass(frozen=True)
class Sizes:
    """Pixels: height of a plot, between two, above all, below all, left of all; font of legends and titles."""

    plot: int
    gap: int
    top: int
    bottom: int
    left: int
    legend: int
    title: int
    title_above: int


#: For a page that is wide enough for two plots beside each other, and for a telephone, where a legend takes two lines.
WIDE = Sizes(plot=170, gap=104, top=96, bottom=50, left=62, legend=11, title=13, title_above=26)
NARROW = Sizes(plot=180, gap=150, top=205, bottom=50, left=50, legend=10, title=13, title_above=64)

_COLUMN_GAP = 0.085
_SYMBOLS = {"triangle": ("triangle-up-open", 14), "diamond": ("diamond", 10)}


def figure(charts: Sequence[Chart], columns: int = 2, sizes: Sizes = WIDE) -> dict[str, Any]:
    """Return all `charts` in one figure, row by row in `columns`; those in a column zoom along x together.

    Returns
    -------
    dict
        ``data`` and ``layout``, ready for JSON. A legend above each plot, and one for the marks of all above the whole.
    """
    rows = math.ceil(len(charts) / columns)
    height = sizes.top + rows * (sizes.plot + sizes.gap) - sizes.gap + sizes.bottom
    area = height - sizes.top - sizes.bottom
    traces: list[dict[str, Any]] = []
    shapes: list[dict[str, Any]] = []
    titles: list[dict[str, Any]] = []
    layout: dict[str, Any] = {}
    for number, chart in enumerate(charts):
        row, column = divmod(number, columns)
        axis = "" if number == 0 else str(number + 1)
        top = 1.0 - row * (sizes.plot + sizes.gap) / area
        bottom = top - sizes.plot / area
        width = (1.0 - (columns - 1) * _COLUMN_GAP) / columns
        left = column * (width + _COLUMN_GAP)
        layout |= _axes(chart, axis, (left, left + width), (max(bottom, 0.0), top))
        layout[f"legend{axis}"] = {
            "orientation": "h",
            "x": left,
            "xanchor": "left",
            "y": top + 4 / area,
            "yanchor": "bottom",
            "font": {"size": sizes.legend},
            "itemsizing": "trace",
        }
        titles.append(
            {
                "text": f"<b>{chart.title}</b>",
                "x": left,
                "y": top + sizes.title_above / area,
                "xref": "paper",
                "yref": "paper",
                "xanchor": "left",
                "yanchor": "bottom",
                "showarrow": False,
                "font": {"size": sizes.title},
            }
        )
        traces += [_line(curve, axis, 30 - rank) for rank, curve in enumerate(chart.curves)]  # the one on top first
        traces += [_markers(points, axis) for points in chart.points]
        for span in chart.spans:
            look = {"type": "rect", "fillcolor": span.colour, "opacity": span.opacity, "line": {"width": 0}}
            shapes.append(_upright(axis, span.start, span.stop) | look | {"y1": span.height})
        for mark in chart.marks:
            line = {"color": mark.colour, "dash": mark.dash, "width": 1.2}
            shapes.append(_upright(axis, mark.at, mark.at) | {"type": "line", "line": line})
    traces += _explained_marks(charts, len(charts) + 1)
    layout[f"legend{len(charts) + 1}"] = {
        "orientation": "h",
        "x": 0.0,
        "xanchor": "left",
        "y": 1.0 - 4 / height,
        "yref": "container",
        "yanchor": "top",
        "font": {"size": 12, "color": BLACK},
        "itemclick": False,
        "itemdoubleclick": False,
    }
    layout |= {
        "height": height,
        "margin": {"l": sizes.left, "r": 12, "t": sizes.top, "b": sizes.bottom},
        "font": {"family": _FONT, "size": 12, "color": "#1a1a1a"},
        "plot_bgcolor": "white",
        "paper_bgcolor": "white",
        "hovermode": "x unified",
        "dragmode": "zoom",
    }
    layout |= {"shapes": shapes, "annotations": titles, "template": _template()}
    return {"data": [{**trace, "type": "scatter"} for trace in traces], "layout": layout}


def library() -> str:
    """Return plotly.js."""
    return _of_plotly("plotly.min.js")


@cache
def _template() -> dict[str, Any]:
    template: dict[str, Any] = json.loads(_of_plotly("templates/plotly.json"))
    return template


def _of_plotly(name: str) -> str:
    """Return a file of plotly's, without loading plotly."""
    spec = find_spec("plotly")
    assert spec is not None
    assert spec.origin is not None
    return (Path(spec.origin).parent / "package_data" / name).read_text(encoding="utf-8")


def _upright(axis: str, start: float, stop: float) -> dict[str, Any]:
    """Return where a shape is that goes from the bottom of a plot to its top."""
    at = {"x0": start, "x1": stop, "y0": 0, "y1": 1}
    return {**at, "xref": f"x{axis}", "yref": f"y{axis} domain", "layer": "below"}


def _axes(
    chart: Chart, axis: str, across: tuple[float, float], upward: tuple[float, float]
) -> dict[str, dict[str, Any]]:
    look = {"showline": True, "linecolor": GREY, "gridcolor": "#ebedef", "zeroline": False, "ticks": "outside"}
    x = {**look, "domain": across, "anchor": f"y{axis}", "title": {"text": chart.x_title, "standoff": 4}}
    y = {**look, "domain": upward, "anchor": f"x{axis}", "title": {"text": chart.y_title, "standoff": 4}}
    x |= {"showspikes": True, "spikemode": "across", "spikecolor": GREY, "spikethickness": 1, "spikedash": "dot"}
    y |= {"tickformat": ".6~g"}
    if axis and "x" not in chart.log and not chart.alone:
        x["matches"] = "x"
    for name, described, limits in (("x", x, chart.x_range), ("y", y, chart.y_range)):
        if name in chart.log:
            described |= {"type": "log", "exponentformat": "power", "dtick": 1}
        if limits is not None:
            described["range"] = [math.log10(limit) for limit in limits] if name in chart.log else list(limits)
    return {f"xaxis{axis}": x, f"yaxis{axis}": y}


def _line(curve: Curve, axis: str, rank: int) -> dict[str, Any]:
    shape = "hv" if curve.step else "linear"
    return {
        **_abscissa(curve.x),
        "y": _array(curve.y.astype(np.float32)),
        "name": curve.name,
        "mode": "lines",
        "line": {"color": curve.colour, "dash": curve.dash, "width": curve.width, "shape": shape},
        "xaxis": f"x{axis}",
        "yaxis": f"y{axis}",
        "legend": f"legend{axis}",
        "legendrank": rank,
        "showlegend": bool(curve.name),
        "hovertemplate": f"%{{y:{curve.digits}}} {curve.unit}".rstrip(),
        **({} if curve.name and len(curve.x) > 2 else {"hoverinfo": "skip"}),
    }


def _array(values: NDArray[np.float32 | np.float64]) -> dict[str, str] | list[float]:
    """Return numbers as plotly.js unpacks them."""
    if not len(values):
        return []
    little = values.astype(values.dtype.newbyteorder("<"), copy=False)
    return {"dtype": f"f{values.dtype.itemsize}", "bdata": base64.b64encode(little.tobytes()).decode()}


def _abscissa(x: NDArray[np.float64]) -> dict[str, Any]:
    """Return the x by start and step where it is evenly spaced, a third of the size; else in full.

    A step of zero means one to plotly.js.
    """
    steps = np.diff(x)
    if len(x) > 2 and steps[0] > 0.0 and np.allclose(steps, steps[0], rtol=1e-5, atol=0.0):
        return {"x0": float(x[0]), "dx": float(steps[0])}
    # A float of four bytes tells milliseconds apart up to four and a half hours.
    return {"x": _array(x.astype(np.float32) if abs(x).max(initial=0.0) < 2**14 else x)}


def _markers(points: Points, axis: str) -> dict[str, Any]:
    symbol, size = _SYMBOLS[points.symbol]
    edge = {"width": 1.5, "color": points.colour}
    return {
        "x": [float(x) for x in points.x],
        "y": [float(y) if math.isfinite(y) else None for y in points.y],
        "name": points.name,
        "mode": "markers",
        "marker": {"symbol": symbol, "size": size, "color": points.colour, "line": edge},
        "xaxis": f"x{axis}",
        "yaxis": f"y{axis}",
        "legend": f"legend{axis}",
        "legendrank": 40,
        "hovertemplate": f"{points.name} {points.hover}<extra></extra>",
    }


def _explained_marks(charts: Sequence[Chart], number: int) -> list[dict[str, Any]]:
    """Return the traces of one legend above the whole: what the vertical lines and the shaded times are."""
    look = {"x": [None], "y": [None], "legend": f"legend{number}", "hoverinfo": "skip"}
    spans = {span.name: span for chart in charts for span in chart.spans}
    marks = {mark.name: mark for chart in charts for mark in chart.marks}
    squares = {
        name: {"symbol": "square", "size": 12, "color": span.colour, "opacity": min(2 * span.opacity, 1.0)}
        for name, span in spans.items()
    }
    lines = {name: {"color": mark.colour, "dash": mark.dash, "width": 1.6} for name, mark in marks.items()}
    return [
        *({"name": name, "mode": "markers", "marker": square, **look} for name, square in squares.items()),
        *({"name": name, "mode": "lines", "line": line, **look} for name, line in lines.items()),
    ]
