"""What a plot is, whoever draws it: `plotly_charts` for the page, `matplotlib_charts` for files and print."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Okabe and Ito's palette, told apart by colour-blind readers too; dashes tell the lines apart without any colour.
BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE, GREY = (
    "#000000",
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#0072B2",
    "#D55E00",
    "#CC79A7",
    "#6E6E6E",
)

#: Opacity of a shaded time.
SHADE = 0.12

#: A plot of no more points than this shows every one of them.
EVERY_POINT = 20_000
#: What is left of a longer one, about.
FEWER_POINTS = 8_000
#: A point is left out only where the line through its neighbours misses it by less than this part of the range.
MISS = 5e-4


@dataclass(frozen=True)
class Curve:
    """One line: points (x, y), how it is called and how it looks; `dash` is solid, dash, dot or dashdot.

    `step`: the value holds until the next point. `digits` and `unit`: of a value that the mouse points at.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    name: str
    colour: str = BLACK
    dash: str = "solid"
    width: float = 1.6
    step: bool = False
    digits: str = ".6g"
    unit: str = ""


@dataclass(frozen=True)
class Points:
    """Single points, each a marker; `symbol` is triangle (open) or diamond (full).

    `hover`: what the mouse is told of one, after the name, in plotly's words.
    """

    x: Sequence[float]
    y: Sequence[float]
    name: str
    symbol: str
    colour: str
    hover: str = "at %{x:.1f} s"


@dataclass(frozen=True)
class Mark:
    """An instant: a vertical line through every plot. Marks of one name look the same and are explained once."""

    at: float
    name: str
    colour: str
    dash: str


@dataclass(frozen=True)
class Span:
    """A time that is shaded in a plot, as long as something was so; `height`: up to this part of the plot."""

    start: float
    stop: float
    name: str
    colour: str
    height: float = 1.0
    opacity: float = SHADE


@dataclass(frozen=True)
class Chart:
    """One plot. In its texts ``<sub>`` stands for a subscript; `log` names the logarithmic axes ("x", "y").

    `alone`: its x is another quantity than that of the plots around it, and zooms by itself.
    """

    title: str
    curves: Sequence[Curve]
    y_title: str = ""
    x_title: str = "Time, s"
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None
    marks: Sequence[Mark] = ()
    spans: Sequence[Span] = ()
    points: Sequence[Points] = ()
    log: str = ""
    alone: bool = False


def kept_ticks(time_s: NDArray[np.float64], signals: Sequence[tuple[NDArray[np.float64], bool]]) -> NDArray[np.int_]:
    """Choose the ticks that a plot of several signals needs: one choice, so that the mouse meets all of them.

    Parameters
    ----------
    time_s
        (n,) evenly spaced.
    signals
        Each signal, (n,), and whether it is drawn as steps.

    Returns
    -------
    ndarray of int
        Indices in order. All of them up to `EVERY_POINT`, unless much fewer say the same: then every signal is met
        within `MISS` of its range by straight lines (or steps) between what is kept. In a longer recording of noise
        each signal keeps the lowest and the highest point of every stretch.
    """
    ticks = len(time_s)
    keep = np.zeros(ticks, dtype=bool)
    keep[:: max(1, ticks // 500)] = True  # the mouse meets a point everywhere
    keep[-1:] = True
    for values, step in signals:
        keep |= _needed(values, step)
    if 3 * keep.sum() > ticks:
        keep[:] = True
    if keep.sum() <= (EVERY_POINT if keep.all() else FEWER_POINTS):
        return np.flatnonzero(keep)
    stretch = -(-ticks * 2 * len(signals) // FEWER_POINTS)
    chosen = {0, ticks - 1}
    for values, _ in signals:
        for start in range(0, ticks, stretch):
            part = values[start : start + stretch]
            if not np.isnan(part).all():
                chosen.update((start + int(np.nanargmin(part)), start + int(np.nanargmax(part))))
            if np.isnan(part).any():
                chosen.add(start + int(np.argmax(np.isnan(part))))  # a gap stays a gap
    return np.array(sorted(chosen))


def _needed(values: NDArray[np.float64], step: bool) -> NDArray[np.bool_]:
    """Mark the points that cannot be left out; of a stretch (2, 4, 8 ... ticks) that its ends describe, the ends."""
    ticks = len(values)
    needed = np.ones(ticks, dtype=bool)
    finite = values[np.isfinite(values)]
    if ticks < 3 or not len(finite):
        return needed
    # Half of what may be missed: a point that another signal needs is off the line by as much as this, too.
    allowed = 0.5 * MISS * float(np.ptp(finite))
    length = 2
    while length < ticks:
        whole = (ticks - 1) // length
        stretches = values[np.arange(whole)[:, None] * length + np.arange(length + 1)]
        share = np.zeros(length + 1) if step else np.arange(length + 1) / length
        expected = stretches[:, :1] + share * (stretches[:, -1:] - stretches[:, :1])
        inner = slice(1, length)
        described = np.flatnonzero((np.abs(stretches - expected)[:, inner] <= allowed).all(axis=1))
        if not len(described):
            break
        needed[(described[:, None] * length + np.arange(1, length)).ravel()] = False
        length *= 2
    return needed


def spaced(low: float, high: float, least: float) -> tuple[float, float]:
    """Return the range of an axis that shows [low, high] with a margin, but never filled by rounding noise."""
    if high - low < least:
        middle = 0.5 * (low + high)
        low, high = middle - 0.5 * least, middle + 0.5 * least
    margin = 0.08 * (high - low)
    return low - margin, high + margin
