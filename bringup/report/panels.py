"""What is drawn of a run: which signals, in which unit, in which colour. `plots` and `svg` draw it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bringup.recording import Recording
from bringup.topics import FAULTS
from bringup.units import KPA, RPM

# Okabe and Ito's palette, told apart by colour-blind readers too; dashes tell the lines apart without any colour.
BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE, GREY = (
    "#000000",
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#0072B2",
    "#D55E00",
    "#CC79A7",
    "#7F7F7F",
)


@dataclass(frozen=True)
class Line:
    """One line of a plot: where it comes from, how it is scaled, how it looks."""

    key: str
    name: str
    colour: str
    dash: str = "solid"
    width: float = 1.8
    step: bool = False


@dataclass(frozen=True)
class Panel:
    """One plot of the column: title with unit, scale from SI, its lines of the run itself and of the run beside it."""

    title: str
    per_unit: float
    own: tuple[Line, ...]
    beside: tuple[Line, ...] = ()
    digits: str = ".3f"
    least_range: float = 0.1
    fault: str | None = None


def panels_of(recording: Recording, both: bool) -> list[Panel]:
    """List the panels of a report, drawn beside another run or not; the air side only when something happens there."""
    passive = bool(recording.metadata["passive"])
    ours, theirs = ("passive", "active") if passive else ("active", "passive")
    own, soft = (VERMILION, ORANGE) if passive else (BLUE, SKY)
    other = BLUE if passive else VERMILION
    tag = f", {ours}" if both else ""

    def output(quantity: str, title: str, per_unit: float) -> Panel:
        return Panel(
            title,
            per_unit,
            (
                Line(f"measured/{quantity}", f"measured{tag}", soft, width=1.4),
                Line(f"plant/{quantity}", f"actual{tag}", own, width=2.2),
                Line(f"reference/{quantity}", "reference", BLACK, "dash", 1.2),
            ),
            (Line(f"plant/{quantity}", f"actual, {theirs}", other, "dashdot"),),
        )

    def input_(joint: str, title: str, per_unit: float) -> Panel:
        return Panel(
            title,
            per_unit,
            (
                Line(f"actuator/command:{joint}", f"reached the plant{tag}", soft, width=1.4, step=True),
                Line(f"controller/command:{joint}", f"commanded{tag}", own, width=2.2, step=True),
            ),
            (Line(f"controller/command:{joint}", f"commanded, {theirs}", other, "dashdot", step=True),),
        )

    def residual(key: str, kind: str, title: str, per_unit: float) -> Panel:
        return Panel(
            title,
            per_unit,
            (
                Line(f"fault/{key}", "fault injected", BLACK, "dash", 1.4, step=True),
                Line(f"fdi/residual/{key}", "residual", own, width=2.2),
            ),
            fault=kind,
        )

    panels = [
        output("evaporator_pressure", "Evaporator pressure p<sub>e</sub>, kPa", KPA),
        output("superheat", "Superheat SH, K", 1.0),
        input_("compressor", "Compressor speed N, rpm", RPM),
        input_("expansion_valve", "Expansion valve, %", 0.01),
        residual("compressor_speed:compressor", "compressor_speed", "Residual r<sub>N</sub>, rpm", RPM),
        residual("evaporator_pressure", "evaporator_pressure", "Residual r<sub>p</sub>, kPa", KPA),
    ]
    if _varies(recording, "scenario/air:evaporator_air"):
        flow = Line("scenario/air:evaporator_air", "air flow", GREEN, step=True)
        panels.append(Panel("Evaporator air flow, kg/s", 1.0, (flow,), digits=".4f", least_range=0.001))
    if _varies(recording, "scenario/air_inlet_temperature"):
        inlet = Line("scenario/air_inlet_temperature", "air inlet", GREEN, step=True)
        panels.append(Panel("Evaporator air inlet, °C", 1.0, (inlet,)))
    return panels


def _varies(recording: Recording, key: str) -> bool:
    values = recording.series[key]
    values = values[np.isfinite(values)]
    return bool(len(values)) and bool(values.max() > values.min())


def instants(recording: Recording) -> tuple[list[float], list[tuple[float, str]]]:
    """Find when detections begin, s, and when a fault is named: (s, which)."""
    detections: list[float] = []
    isolations: list[tuple[float, str]] = []
    detected, isolated = False, None
    for row in recording.status:
        if row.detected and not detected:
            detections.append(row.time_s)
        if row.isolated is not None and row.isolated != isolated:
            isolations.append((row.time_s, row.isolated))
        detected, isolated = row.detected, row.isolated
    return detections, isolations


def between(recording: Recording, start_s: float, stop_s: float) -> Recording:
    """Cut a recording to the ticks from `start_s` to `stop_s`; the detector's rows stay whole."""
    keep = (recording.time_s >= start_s) & (recording.time_s <= stop_s)
    series = {key: values[keep] for key, values in recording.series.items()}
    return replace(recording, time_s=recording.time_s[keep], series=series)


def readable_range(recording: Recording, beside: Recording | None, panel: Panel) -> tuple[float, float] | None:
    """Range of a panel's axis: all of its lines, but never so narrow that rounding noise fills it.

    Returns
    -------
    tuple of float or None
        In the panel's unit; None when there is nothing to show.
    """
    lines = [recording.series[line.key] for line in panel.own]
    lines += [beside.series[line.key] for line in panel.beside] if beside is not None else []
    values: NDArray[np.float64] = np.concatenate(lines) / panel.per_unit
    values = values[np.isfinite(values)]
    if not len(values):
        return None
    low, high = float(values.min()), float(values.max())
    least = max(panel.least_range, 1e-3 * abs(high))
    if panel.fault is not None and recording.status:
        least = max(least, 3.0 * recording.status[-1].thresholds[FAULTS.index(panel.fault)] / panel.per_unit)
    if high - low < least:
        middle = 0.5 * (low + high)
        low, high = middle - 0.5 * least, middle + 0.5 * least
    margin = 0.08 * (high - low)
    return low - margin, high + margin
