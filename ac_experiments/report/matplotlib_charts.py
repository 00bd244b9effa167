"""Plots as still pictures, SVG or PNG, by matplotlib: for files, documents and print."""

import io
import math
import re
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ac_common.files import write_whole
from ac_experiments.report.charts import GREY, Chart, Curve, Mark, Points, Span

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Width and height of one plot with its title and legend, inches.
Size = tuple[float, float]
SIZE_IN: Size = (5.6, 2.55)
_LEFT_IN, _RIGHT_IN, _TOP_IN, _BOTTOM_IN, _HEAD_IN = 0.72, 0.14, 0.56, 0.5, 0.3
#: A plot that is less wide has a second row of legend.
_NARROW_IN, _SECOND_ROW_IN = 4.5, 0.15
_DPI = 150
#: Of so many stretches of a curve a picture shows the lowest and the highest point; each is 0.3 mm wide.
_STRETCHES = 400
#: Where the first is missing, the second has the same widths.
_FONTS = "'DejaVu Sans', Verdana, sans-serif"
_POINT = re.compile(r"^([ML]) (-?\d+\.\d\d)\d* (-?\d+\.\d\d)\d*", re.MULTILINE)
_INDENT = re.compile(r"\s*\n\s*")
_DASHES: dict[str, Any] = {
    "solid": "solid",
    "dash": (0, (5, 2.5)),
    "dot": (0, (1.2, 1.8)),
    "dashdot": (0, (6, 2, 1.4, 2)),
}
_SYMBOLS = {"triangle": ("^", "none", 8.0), "diamond": ("D", "auto", 5.0)}
_STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.edgecolor": GREY,
    "axes.labelsize": 8.5,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.unicode_minus": True,
    "axes.formatter.useoffset": False,
    "grid.color": "#ebedef",
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "svg.fonttype": "none",  # text that can be searched and copied
    "svg.hashsalt": "acftc",  # and is the same text for the same run
}


def draw(charts: Sequence[Chart], columns: int = 2, title: str = "", size_in: Size = SIZE_IN) -> str:
    """Return the SVG text of `charts`, row by row in `columns`.

    Parameters
    ----------
    charts
        What to draw.
    columns
        Plots beside each other.
    title
        Name of the whole picture, for those who hear it read out.
    size_in
        Width and height of each plot with its title and legend, inches.
    """
    from matplotlib import rc_context

    with rc_context(_STYLE):
        return _svg(_figure(charts, columns, size_in), title)


def save(charts: Sequence[Chart], stem: Path, columns: int = 2, title: str = "", size_in: Size = SIZE_IN) -> str:
    """Write the picture as `stem`.svg and `stem`.png, and give the SVG's text."""
    from matplotlib import rc_context

    with rc_context(_STYLE):
        drawn = _figure(charts, columns, size_in)
        text = _svg(drawn, title)
        pixels = BytesIO()
        drawn.savefig(pixels, format="png", dpi=_DPI, metadata={"Title": title})
    write_whole(stem.with_name(stem.name + ".svg"), text)
    write_whole(stem.with_name(stem.name + ".png"), pixels.getvalue())
    return text


def _svg(drawn: "Figure", title: str) -> str:
    stream = io.StringIO()
    drawn.savefig(stream, format="svg", metadata={"Title": title, "Date": None, "Creator": None})
    text = stream.getvalue().replace("'DejaVu Sans'", _FONTS)
    # A hundredth of a point is enough for a curve, and a third of the size.
    return _POINT.sub(r"\1\2 \3", _INDENT.sub("\n", text[text.index("<svg") :]))


def mathtext(text: str) -> str:
    """Return the subscripts as matplotlib wants them."""
    return re.sub(r"<sub>(.*?)</sub>", r"$_{\\mathrm{\1}}$", text.replace("$", r"\$"))


def _figure(charts: Sequence[Chart], columns: int, size_in: Size) -> "Figure":
    """Lay the plots out by hand: every frame of the same size, and several times faster than a layout engine."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = max(1, min(columns, len(charts)))
    rows = max(1, math.ceil(len(charts) / columns))
    marks = {mark.name: mark for chart in charts for mark in chart.marks}
    spans = {span.name: span for chart in charts for span in chart.spans}
    (wide, high), head = size_in, (_HEAD_IN if marks or spans else 0.0)
    width, height = columns * wide, rows * high + head
    drawn = Figure(figsize=(width, height))
    FigureCanvasAgg(drawn)
    for number, chart in enumerate(charts):
        row, column = divmod(number, columns)
        left, bottom = column * wide + _LEFT_IN, (rows - 1 - row) * high + _BOTTOM_IN
        top_in = _TOP_IN + (_SECOND_ROW_IN if wide < _NARROW_IN else 0.0)
        size = (wide - _LEFT_IN - _RIGHT_IN) / width, (high - top_in - _BOTTOM_IN) / height
        _chart(drawn.add_axes((left / width, bottom / height, *size)), chart, wide < _NARROW_IN)
    if marks or spans:
        _explain(drawn, list(spans.values()), list(marks.values()), _LEFT_IN / width)
    return drawn


def _chart(axes: "Axes", chart: Chart, is_narrow: bool) -> None:
    """Draw a chart; the legend of a narrow one takes two rows."""
    if "x" in chart.log:
        axes.set_xscale("log")
        axes.xaxis.set_minor_formatter("")  # only the powers of ten have room for a number
    if "y" in chart.log:
        axes.set_yscale("log")
    for span in chart.spans:
        look: dict[str, Any] = {"color": span.colour, "alpha": span.opacity, "linewidth": 0, "zorder": 1.0}
        axes.axvspan(span.start, span.stop, 0.0, span.height, **look)
    for mark in chart.marks:
        axes.axvline(mark.at, color=mark.colour, linestyle=_DASHES[mark.dash], linewidth=0.9, zorder=1.5)
    for curve in chart.curves:
        axes.plot(
            *_thinned(curve),
            color=curve.colour,
            linestyle=_DASHES[curve.dash],
            linewidth=0.75 * curve.width,
            drawstyle="steps-post" if curve.step else "default",
            label=mathtext(curve.name) or "_",
        )
    for points in chart.points:
        _points(axes, points)
    axes.set_title(
        mathtext(chart.title), loc="left", fontsize=9.5, fontweight="bold", y=1.0, pad=31 if is_narrow else 20
    )
    axes.set_xlabel(mathtext(chart.x_title))
    axes.set_ylabel(mathtext(chart.y_title))
    axes.grid(True)
    axes.set_axisbelow(True)
    if chart.x_range is not None:
        axes.set_xlim(*chart.x_range)
    else:
        axes.margins(x=0)
    if chart.y_range is not None:
        axes.set_ylim(*chart.y_range)
    lines = [line for line in axes.lines if not str(line.get_label()).startswith("_")]
    if lines:
        kinds = len(lines) - len(chart.points)
        axes.legend(
            handles=[*lines[:kinds][::-1], *lines[kinds:]],  # from the one on top down
            loc="lower left",
            bbox_to_anchor=(-0.012, 0.985),
            ncols=(len(lines) + 1) // 2 if is_narrow else len(lines),
            handlelength=2.2,
            columnspacing=1.2,
            borderaxespad=0.1,
        )


def _thinned(curve: Curve) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """As many points as a picture can show: of each stretch of a longer curve the lowest and the highest."""
    stretch = len(curve.x) // _STRETCHES
    if stretch < 3:
        return curve.x, curve.y
    whole = curve.y[: stretch * (len(curve.y) // stretch)].reshape(-1, stretch)
    low = np.where(np.isnan(whole), np.inf, whole).argmin(axis=1)  # of nothing but gaps: the first
    high = np.where(np.isnan(whole), -np.inf, whole).argmax(axis=1)
    starts = np.arange(len(whole)) * stretch
    keep = np.unique(np.concatenate([starts + low, starts + high, np.arange(whole.size, len(curve.y)), [0]]))
    return curve.x[keep], curve.y[keep]


def _points(axes: "Axes", points: Points) -> None:
    marker, face, size = _SYMBOLS[points.symbol]
    axes.plot(
        points.x,
        points.y,
        linestyle="none",
        marker=marker,
        color=points.colour,
        markerfacecolor=face,
        markersize=size,
        label=points.name,
        zorder=5,
    )


def _explain(drawn: "Figure", spans: Sequence[Span], marks: Sequence[Mark], left: float) -> None:
    """One line of legend above the whole: what the shaded times and the vertical lines are."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Any] = [
        Patch(facecolor=span.colour, alpha=min(2 * span.opacity, 1.0), label=mathtext(span.name)) for span in spans
    ]
    handles += [
        Line2D([], [], color=mark.colour, linestyle=_DASHES[mark.dash], linewidth=1.1, label=mathtext(mark.name))
        for mark in marks
    ]
    drawn.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(left - 0.035, 1.0),
        ncols=len(handles),
        fontsize=8,
        borderaxespad=0.3,
    )
