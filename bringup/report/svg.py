"""Still pictures of a run as SVG, for documents and print, drawn without a browser or a plotting library."""

import html
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bringup.recording import Recording
from bringup.report.panels import BLACK, GREEN, GREY, Line, Panel, instants, panels_of, readable_range
from bringup.summary import injected_faults
from bringup.topics import FAULTS

WIDTH, HEIGHT = 560, 250
_LEFT, _RIGHT, _TOP, _BOTTOM = 62, 14, 46, 40
_DASHES = {"solid": "", "dash": "7 4", "dot": "2 3", "dashdot": "9 3 2 3"}


@dataclass(frozen=True)
class Curve:
    """One line: points (x, y), how it is called and how it looks."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    name: str
    colour: str = BLACK
    dash: str = "solid"
    width: float = 1.6


@dataclass(frozen=True)
class Chart:
    """One plot; `marks` are vertical lines (x, colour, dash); `log` are the names of logarithmic axes ("x", "y")."""

    title: str
    curves: Sequence[Curve]
    x_title: str = "Time, s"
    y_range: tuple[float, float] | None = None
    x_range: tuple[float, float] | None = None
    marks: Sequence[tuple[float, str, str]] = ()
    log: str = ""


@dataclass(frozen=True)
class _Axis:
    """One axis in the picture: data range, pixel range, linear or logarithmic."""

    low: float
    high: float
    start: float
    stop: float
    log: bool = False
    ticks: list[float] = field(default_factory=list)

    def at(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        share = (self.scaled(values) - self.scaled(self.low)) / (self.scaled(self.high) - self.scaled(self.low))
        return self.start + share * (self.stop - self.start)

    def scaled(self, values: NDArray[np.float64] | float) -> NDArray[np.float64]:
        array = np.asarray(values, dtype=np.float64)
        return np.log10(np.maximum(array, 1e-300)) if self.log else array


def draw(charts: Sequence[Chart], columns: int = 2, title: str = "") -> str:
    """SVG text of `charts`, row by row in `columns`.

    Parameters
    ----------
    charts
        What to draw; each gets a legend above its frame.
    columns
        Plots beside each other.
    title
        Name of the whole picture, for those who hear it read out.
    """
    columns = min(columns, len(charts))
    rows = math.ceil(len(charts) / columns)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {columns * WIDTH} {rows * HEIGHT}" '
        f'width="{columns * WIDTH}" height="{rows * HEIGHT}" role="img" '
        'font-family="DejaVu Sans, Helvetica, Arial, sans-serif" font-size="11">',
        f"<title>{html.escape(title)}</title>" if title else "",
        '<rect width="100%" height="100%" fill="white"/>',
        f'<clipPath id="frame"><rect x="{_LEFT}" y="{_TOP}" width="{WIDTH - _LEFT - _RIGHT}" '
        f'height="{HEIGHT - _TOP - _BOTTOM}"/></clipPath>',
    ]
    for number, chart in enumerate(charts):
        left, top = number % columns * WIDTH, number // columns * HEIGHT
        parts += [f'<g transform="translate({left} {top})">', *_chart(chart), "</g>"]
    return "\n".join([part for part in parts if part] + ["</svg>", ""])


def charts_of(recording: Recording, beside: Recording | None = None, titles: Sequence[str] = ()) -> list[Chart]:
    """Plots of a run, as in its report.

    Parameters
    ----------
    recording, beside
        As in `bringup.report.plots.time_plots`.
    titles
        Beginnings of the titles to keep, in this order; empty: all.
    """
    panels = panels_of(recording, beside is not None)
    if titles:
        panels = [panel for title in titles for panel in panels if panel.title.startswith(title)]
    return [_panel_chart(recording, beside, panel) for panel in panels]


def _panel_chart(recording: Recording, beside: Recording | None, panel: Panel) -> Chart:
    def curve(run: Recording, line: Line) -> Curve:
        values = run.series[line.key] / panel.per_unit
        return Curve(run.time_s, values, line.name, line.colour, line.dash, line.width)

    curves = [curve(beside, line) for line in panel.beside] if beside is not None else []
    curves += [curve(recording, line) for line in panel.own]
    if panel.fault is not None and recording.status:
        threshold = recording.status[-1].thresholds[FAULTS.index(panel.fault)] / panel.per_unit
        ends = recording.time_s[[0, -1]]
        for sign, name in ((1.0, "threshold"), (-1.0, "")):
            curves.append(Curve(ends, np.full(2, sign * threshold), name, GREY, "dot", 1.1))
    first, last = float(recording.time_s[0]), float(recording.time_s[-1])
    marks = [(fault.onset_s, GREY, "dash") for fault in injected_faults(recording)]
    marks += [(at, GREEN, "solid") for at, _ in instants(recording)[1]]
    return Chart(
        title=panel.title,
        curves=curves,
        y_range=readable_range(recording, beside, panel),
        x_range=(first, last),
        marks=[mark for mark in marks if first <= mark[0] <= last],
    )


def _chart(chart: Chart) -> list[str]:
    x_axis = _axis(chart, "x", _LEFT, WIDTH - _RIGHT)
    y_axis = _axis(chart, "y", HEIGHT - _BOTTOM, _TOP)
    parts = [f'<text x="{_LEFT}" y="16" font-size="13">{_rich(chart.title)}</text>', *_legend(chart)]
    for tick in x_axis.ticks:
        at = float(x_axis.at(np.array(tick)))
        parts.append(_segment(at, _TOP, at, HEIGHT - _BOTTOM, "#ebedef", 1))
        parts.append(f'<text x="{at:.1f}" y="{HEIGHT - _BOTTOM + 15}" text-anchor="middle">{_label(tick)}</text>')
    for tick in y_axis.ticks:
        at = float(y_axis.at(np.array(tick)))
        parts.append(_segment(_LEFT, at, WIDTH - _RIGHT, at, "#ebedef", 1))
        parts.append(f'<text x="{_LEFT - 6}" y="{at + 4:.1f}" text-anchor="end">{_label(tick)}</text>')
    for value, colour, dash in chart.marks:
        at = float(x_axis.at(np.array(value)))
        parts.append(_segment(at, _TOP, at, HEIGHT - _BOTTOM, colour, 1, dash))
    parts += [_path(curve, x_axis, y_axis) for curve in chart.curves]
    parts.append(
        f'<path d="M{_LEFT} {_TOP}V{HEIGHT - _BOTTOM}H{WIDTH - _RIGHT}" fill="none" stroke="{GREY}" stroke-width="1"/>'
    )
    middle = (_LEFT + WIDTH - _RIGHT) / 2
    parts.append(f'<text x="{middle}" y="{HEIGHT - 8}" text-anchor="middle">{html.escape(chart.x_title)}</text>')
    return parts


def _axis(chart: Chart, which: str, start: float, stop: float) -> _Axis:
    given = chart.x_range if which == "x" else chart.y_range
    log = which in chart.log
    if given is None:
        values = np.concatenate([curve.x if which == "x" else curve.y for curve in chart.curves])
        values = values[np.isfinite(values) & (values > 0.0 if log else True)]
        margin = 0.0 if which == "x" or log else 0.06 * float(np.ptp(values))
        given = (float(values.min()) - margin, float(values.max()) + margin)
    low, high = given
    if log:
        ticks = [10.0**power for power in range(math.ceil(math.log10(low)), math.floor(math.log10(high)) + 1)]
        return _Axis(low, high, start, stop, True, ticks)
    if high <= low:
        low, high = low - 0.5, high + 0.5
    step = _nice((high - low) / 5.0)
    ticks = [number * step for number in range(math.ceil(low / step), math.floor(high / step) + 1)]
    return _Axis(low, high, start, stop, False, ticks)


def _nice(step: float) -> float:
    """Nearest of 1, 2, 5 times a power of ten that is not smaller."""
    power = 10.0 ** math.floor(math.log10(step))
    return next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= step * (1.0 - 1e-9))


def _label(value: float) -> str:
    return f"{value:.6g}".replace("-", "\N{MINUS SIGN}")


def _path(curve: Curve, x_axis: _Axis, y_axis: _Axis) -> str:
    """Draw a curve, thinned to what a picture of this width can show; a gap where a value is missing."""
    x, y = x_axis.at(curve.x), y_axis.at(curve.y)
    if len(x) > 4 * WIDTH:
        x, y = _thinned(x, y)
    x, y = _without_flat_runs(np.round(x, 1), np.round(y, 1))
    text, pen = [], "M"
    for px, py in zip(x.tolist(), y.tolist(), strict=True):
        if math.isnan(py):
            pen = "M"
            continue
        text.append(f"{pen}{px:.1f} {py:.1f}")
        pen = "L"
    look = _stroke(curve.colour, curve.width, curve.dash)
    return f'<path d="{"".join(text)}" fill="none" clip-path="url(#frame)" {look}/>'


def _without_flat_runs(
    x: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Leave out points between two of the same height: at rest a curve is a line with two ends."""
    flat = np.zeros(len(y), dtype=bool)
    flat[1:-1] = (y[1:-1] == y[:-2]) & (y[1:-1] == y[2:])
    return x[~flat], y[~flat]


def _thinned(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Keep the lowest and the highest point of every group, so that no peak is lost."""
    group = math.ceil(len(x) / (2 * WIDTH))
    keep: set[int] = {0, len(x) - 1}
    for start in range(0, len(x), group):
        part = y[start : start + group]
        if np.isnan(part).all():
            keep.add(start)
        else:
            keep.update((start + int(np.nanargmin(part)), start + int(np.nanargmax(part))))
    index = np.array(sorted(keep))
    return x[index], y[index]


def _legend(chart: Chart) -> list[str]:
    parts, at = [], float(_LEFT)
    for curve in reversed(chart.curves):
        if not curve.name:
            continue
        parts.append(_segment(at, 31, at + 22, 31, curve.colour, max(curve.width, 1.5), curve.dash))
        parts.append(f'<text x="{at + 26:.0f}" y="35" font-size="10">{html.escape(curve.name)}</text>')
        at += 38 + 5.6 * len(curve.name)
    return parts


def _segment(x1: float, y1: float, x2: float, y2: float, colour: str, width: float, dash: str = "solid") -> str:
    return f'<path d="M{x1:.1f} {y1:.1f}L{x2:.1f} {y2:.1f}" fill="none" {_stroke(colour, width, dash)}/>'


def _stroke(colour: str, width: float, dash: str) -> str:
    dashes = f' stroke-dasharray="{_DASHES[dash]}"' if _DASHES[dash] else ""
    return f'stroke="{colour}" stroke-width="{width}"{dashes}'


def _rich(text: str) -> str:
    """Titles carry <sub>; SVG wants it as a lowered, smaller span, and the next one raised again."""
    lowered = re.sub(r"<sub>(.*?)</sub>", "\x01\\1\x02", text)
    safe = html.escape(lowered)
    return safe.replace("\x01", '<tspan dy="3" font-size="9">').replace("\x02", '</tspan><tspan dy="-3">\u200b</tspan>')
