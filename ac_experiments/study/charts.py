"""The curves of a study, for its page and its picture."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ac_common.faults import BY_KIND
from ac_experiments.report.charts import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, Chart, Curve, Points
from ac_experiments.study.outcomes import CORRECT, FALSE_ALARM
from ac_experiments.study.pod import FOUND, Pod
from ac_experiments.study.schema import NO_FAULT
from ac_experiments.study.summary import Runs, pod_of, roc_of

Vector = NDArray[np.float64]
_COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK)
_DASHES = ("solid", "dash", "dashdot", "dot")
#: So many kinds have a curve of their own.
MOST_KINDS = 7
_BOUNDS = np.concatenate([np.linspace(0.05, 0.95, 19), [0.97, 0.98, 0.99]])


def charts_of(runs: Runs) -> list[Chart]:
    """Return the charts that the runs have data for."""
    kinds = runs.kinds[:MOST_KINDS]
    charts = [*_roc(runs, kinds), *_pods(runs, kinds), *_delays(runs, kinds), *_benefit(runs), *_alarms(runs)]
    return [replace(chart, alone=True) for chart in charts]


def _look(number: int) -> tuple[str, str]:
    return _COLOURS[number % len(_COLOURS)], _DASHES[number // len(_COLOURS) % len(_DASHES)]


def _steps(values: Vector) -> tuple[Vector, Vector]:
    """Return the share of values at most x: where it rises, and to what."""
    ordered = np.sort(values[np.isfinite(values)])
    if not len(ordered):
        return np.empty(0), np.empty(0)
    return (
        np.concatenate([ordered[:1], ordered]),
        np.concatenate([[0.0], np.arange(1, len(ordered) + 1)]) / len(values) * 100.0,
    )


def _roc(runs: Runs, kinds: list[str]) -> list[Chart]:
    curves, here = [], []
    for number, kind in enumerate(kinds):
        found = roc_of(runs, kind)
        if found is None:
            continue
        colour, dash = _look(number)
        x, y = 100.0 * found.false_alarms[::-1], 100.0 * found.detections[::-1]
        name = f"{BY_KIND[kind].name} ({found.area.value:.3f})"
        curves.append(Curve(np.append(x, 100.0), np.append(y, 100.0), name, colour, dash, step=True))
        at = int(np.searchsorted(found.scale, 1.0, side="right")) - 1
        here.append((100.0 * float(found.false_alarms[at]), 100.0 * float(found.detections[at])))
    if not curves:
        return []
    alarmed, found_then = [x for x, _ in here], [y for _, y in here]
    points = [Points(alarmed, found_then, "as they are", "diamond", BLACK, "%{x:.3g} %, %{y:.3g} %")]
    title = "Detections over false alarms as the thresholds are scaled"
    return [
        Chart(
            title,
            curves,
            "Faults detected, %",
            "Fault-free stretches alarmed, %",
            (-2, 102),
            (-2, 102),
            points=points,
        )
    ]


def _pods(runs: Runs, kinds: list[str]) -> list[Chart]:
    """Return one chart for each kind whose sizes differ."""
    charts = []
    for kind in kinds:
        of_kind = runs.of_kind(kind)
        fitted = pod_of(of_kind)
        if fitted is None:
            continue
        sizes = np.abs(of_kind["fault_size"])
        charts.append(_pod(fitted, kind, float(sizes[sizes > 0].min()), float(sizes.max())))
    return charts


def _pod(fitted: Pod, kind: str, low: float, high: float) -> Chart:
    size = np.geomspace(low, high, 120)
    curves = [Curve(size, 100.0 * fitted.probability(size), "fitted", BLUE)]
    bounds = np.array([fitted.size_at(float(share)) for share in _BOUNDS])
    within = np.isfinite(bounds) & (bounds <= high)
    if within.any():
        curves.append(Curve(bounds[within], 100.0 * _BOUNDS[within], "at 95 % confidence", BLUE, "dash", 1.2))
    unit, found = BY_KIND[kind].unit, fitted.size_at(FOUND)
    points = []
    if math.isfinite(found):
        name = f"a90/95 = {found:.3g} {unit}"
        points.append(Points([found], [90.0], name, "diamond", VERMILION, ""))
    seen = np.exp(fitted._x)
    hits = _binned(seen, fitted._hit)
    curves.append(Curve(*hits, "tenths of the runs", GREY, "dot", 1.2, step=False))
    return Chart(
        f"Probability of detection: {BY_KIND[kind].name}",
        curves,
        "Found, %",
        f"Size, {unit}",
        (low, high),
        (-2, 102),
        points=points,
        log="x",
    )


def _binned(size: Vector, hit: Vector) -> tuple[Vector, Vector]:
    order = np.argsort(size, kind="stable")
    parts = [part for part in np.array_split(order, 10) if len(part)]
    return (
        np.array([float(np.exp(np.log(size[part]).mean())) for part in parts]),
        np.array([100.0 * float(hit[part].mean()) for part in parts]),
    )


def _delays(runs: Runs, kinds: list[str]) -> list[Chart]:
    curves = []
    for number, kind in enumerate(kinds):
        of_kind = runs.of_kind(kind)
        of_kind = of_kind.where(of_kind["outcome"] != FALSE_ALARM)
        right = np.where(of_kind["outcome"] == CORRECT, of_kind["isolation_delay_s"], np.nan)
        x, y = _steps(right)
        if len(x):
            colour, dash = _look(number)
            curves.append(Curve(x, y, BY_KIND[kind].name, colour, dash, step=True))
    if not curves:
        return []
    return [Chart("Named right within", curves, "Runs, %", "Time from the onset, s", None, (-2, 102))]


def _benefit(runs: Runs) -> list[Chart]:
    if not runs.study.k0_alone:
        return []
    curves = []
    for number, kind in enumerate((NO_FAULT, *runs.kinds[:MOST_KINDS])):
        chosen = runs.where((runs["fault_kind"] == kind) & (runs["problem"] == ""))
        ratio = chosen["iae_pressure_kpa_s"] / chosen["k0_iae_pressure_kpa_s"]
        x, y = _steps(np.asarray(ratio, dtype=np.float64))
        if len(x):
            colour, dash = (GREY, "dash") if kind == NO_FAULT else _look(number - 1)
            name = "no fault" if kind == NO_FAULT else BY_KIND[kind].name
            curves.append(Curve(x, y, name, colour, dash, step=True))
    if not curves:
        return []
    title = "Error with accommodation over that of K0 alone"
    return [Chart(title, curves, "Runs, %", "IAE of p<sub>e</sub> over K0 alone's", None, (-2, 102))]


def _alarms(runs: Runs) -> list[Chart]:
    peaks = runs["peak_fault_free"]
    peaks = np.sort(peaks[np.isfinite(peaks)])
    hours = float(np.nansum(runs["fault_free_s"])) / 3600.0
    if len(peaks) < 2 or not hours > 0.0:
        return []
    left = np.arange(len(peaks), 0, -1) / hours
    curve = Curve(peaks, left, "stretches with an alarm, per hour", BLUE, step=True)
    return [Chart("Alarms without a fault over the thresholds' scale", [curve], "Per hour", "Scale")]
