"""What is shown of a run: which signals, in which unit, in which colour, and the instants that matter."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ac_common.faults import FAULTS, ISOLABLE, ISOLABLE_KINDS, Fault
from ac_common.signals import Performance
from ac_common.topics import CABIN_SERIES, CAR_SERIES, PERFORMANCE_SERIES, residual_of, truth_of
from ac_common.units import KPA, RPM
from ac_experiments.recording import Recording
from ac_experiments.report.charts import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    Chart,
    Curve,
    Points,
    kept_ticks,
    spaced,
)
from ac_experiments.report.moments import DETECTED, ISOLATED, instants, marks_of, spans_of, subscripted

#: The panels that tell what a fault does, in the order in which they are read, two in a row.
STORY = ("p_e", "SH", "N", "valve", "r_N", "r_p", "q_N", "q_valve")

#: Series that are made of others: actual p_e minus its reference, Pa, and cooling over compressor power.
ERROR, COP = "of the report/pressure_error", "of the report/cop"


_COP_OF = ("cooling", "compressor_power")
#: With less than this, W, there is no COP to speak of.
_LEAST_POWER_W = 10.0


@dataclass(frozen=True)
class Line:
    """One line of a panel or of a plot of the live page: the signal, how it is called and how it looks."""

    key: str
    name: str
    colour: str
    dash: str = "solid"
    width: float = 1.8
    step: bool = False


@dataclass(frozen=True)
class Panel:
    """One plot of a run: scale from SI, lines of the run itself and of the run beside it, drawn in this order."""

    key: str
    title: str
    y_title: str
    per_unit: float
    own: tuple[Line, ...]
    beside: tuple[Line, ...] = ()
    digits: str = ".6g"
    least_range: float = 0.1
    fault: str | None = None

    @property
    def main(self) -> Line:
        """The line that the panel is about: the thickest one."""
        return max(self.own, key=lambda line: line.width)

    @property
    def unit(self) -> str:
        """Unit of its axis: what stands last in the axis's title."""
        return self.y_title.rpartition(", ")[2]


def charts_of(
    recording: Recording,
    beside: Recording | None = None,
    keys: Sequence[str] = (),
    window_s: tuple[float, float] | None = None,
) -> list[Chart]:
    """Return the plots of a run.

    Parameters
    ----------
    recording
        The run.
    beside
        A run of the same scenario with the other kind of control, drawn into the same plots, or None.
    keys
        Which panels, in this order (see `panels_of`); those that this run does not have are left out. Empty: all.
    window_s
        From when to when, s; None: the whole run.
    """
    panels = panels_of(recording, beside is not None)
    if keys:
        panels = [panel for key in keys for panel in panels if panel.key == key]
    marks = marks_of(recording)
    start_s, stop_s = window_s or (0.0, math.inf)
    # The last sample lasts until the next would come, so a run of 1000 s ends at 1000.
    end_s = float(recording.time_s[-1] + recording.metadata["sample_time_s"])
    start_s, stop_s = max(start_s, float(recording.time_s[0])), min(stop_s, end_s)
    spans = spans_of(recording, start_s, stop_s)
    own_ticks = _ticks(recording, start_s, stop_s, [line for panel in panels for line in panel.own])
    other_ticks = None
    if beside is not None:
        other_ticks = _ticks(beside, start_s, stop_s, [line for panel in panels for line in panel.beside])
    return [
        Chart(
            title=panel.title,
            y_title=panel.y_title,
            curves=_curves(panel, recording, own_ticks, beside, other_ticks),
            x_range=(start_s, stop_s),
            y_range=_range(panel, recording, own_ticks, beside, other_ticks),
            marks=[mark for mark in marks if start_s <= mark.at <= stop_s],
            spans=spans,
            points=_decisions(panel, recording, start_s, stop_s),
        )
        for panel in panels
    ]


@dataclass(frozen=True)
class _Look:
    """Colours and names of the lines of a run, and of the run beside it."""

    own: str
    soft: str
    other: str
    tag: str
    theirs: str

    @classmethod
    def of(cls, recording: Recording, both: bool) -> "_Look":
        """Return the look of a run: blue for an active one, red for a passive one."""
        if recording.metadata["passive"]:
            return cls(VERMILION, ORANGE, BLUE, ", passive" if both else "", "active")
        return cls(BLUE, SKY, VERMILION, ", active" if both else "", "passive")

    def output(self, key: str, signal: str, title: str, y_title: str, per_unit: float, *more: Line) -> Panel:
        """Return the panel of an output, as it is and as it is measured."""
        own = (
            Line(f"measured/{signal}", f"measured{self.tag}", self.soft, width=1.4),
            Line(f"plant/{signal}", f"actual{self.tag}", self.own, width=2.2),
        )
        beside = (Line(f"plant/{signal}", f"actual, {self.theirs}", self.other, "dashdot"),)
        return Panel(key, title, y_title, per_unit, (*own, *more), beside)

    def input(self, key: str, joint: str, title: str, y_title: str, per_unit: float) -> Panel:
        """Return the panel of a command, as it was given and as it reached the plant."""
        own = (
            Line(f"actuator/command:{joint}", f"at the plant{self.tag}", self.soft, width=1.4, step=True),
            Line(f"controller/command:{joint}", f"commanded{self.tag}", self.own, width=2.2, step=True),
        )
        beside = (Line(f"controller/command:{joint}", f"commanded, {self.theirs}", self.other, "dashdot", step=True),)
        return Panel(key, title, y_title, per_unit, own, beside)

    def error(self) -> Panel:
        """Return the panel of the actual pressure minus its reference: what a fault does also while loads move."""
        own = (Line(ERROR, f"actual minus reference{self.tag}", self.own, width=2.2),)
        beside = (Line(ERROR, f"actual minus reference, {self.theirs}", self.other, "dashdot"),)
        return Panel("error", "Evaporator pressure off its reference", "kPa", KPA, own, beside)

    def residual(self, fault: Fault) -> Panel:
        """Return the panel of a residual, with the fault that it estimates."""
        own = (_injected(fault), Line(residual_of(fault.kind), "residual", self.own, width=2.2))
        title, y_title = f"Residual of the {fault.name}", f"{subscripted(fault.residual_symbol)}, {fault.unit}"
        return Panel(fault.residual_symbol, title, y_title, fault.si, own, fault=fault.kind)

    def q(self, key: str, joint: str, title: str, y_title: str, per_unit: float, least: float) -> Panel:
        """Return the panel of what the compensator adds to a command."""
        q = Line(f"compensator/q:{joint}", f"q{self.tag}", self.own, width=2.2, step=True)
        return Panel(key, title, y_title, per_unit, (q,), least_range=least)


def panels_of(recording: Recording, both: bool) -> list[Panel]:
    """List the panels of a run, drawn beside another run or not.

    p_e, SH, N, valve, r_N, r_p; the faults that no filter is for, by their kind, when they are there; q_N, q_valve when
    a compensator acts; p_e off its reference; T_w, p_c; cooling, COP, vents, subcooling, water when some condenses;
    cabin, vehicle, condenser's air and humidity in a car; of the air side what moves.
    """
    look = _Look.of(recording, both)
    reference = partial(Line, name="reference", colour=BLACK, dash="dash", width=1.2)
    p_e, superheat = reference("reference/evaporator_pressure"), reference("reference/superheat")
    panels = [
        look.output("p_e", "evaporator_pressure", "Evaporator pressure", "p<sub>e</sub>, kPa", KPA, p_e),
        look.output("SH", "superheat", "Superheat", "SH, K", 1.0, superheat),
        look.input("N", "compressor", "Compressor speed", "N, rpm", RPM),
        look.input("valve", "expansion_valve", "Expansion valve", "opening, %", 0.01),
        *(look.residual(fault) for fault in ISOLABLE),
        *(_without_filter(fault) for fault in _unfiltered(recording)),
    ]
    if _acts(recording, "compensator/q:compressor") or _acts(recording, "compensator/q:expansion_valve"):
        title, y_title = "Compensator, compressor speed", "q<sub>N</sub>, rpm"
        panels.append(look.q("q_N", "compressor", title, y_title, RPM, 1.0))
        panels.append(
            look.q("q_valve", "expansion_valve", "Compensator, valve", "q<sub>valve</sub>, %", 0.01, 0.1),
        )
    panels.append(look.error())
    panels.append(look.output("T_w", "wall_temperature", "Wall temperature", "T<sub>w</sub>, °C", 1.0))
    p_c = Line("plant/condenser_pressure", f"actual{look.tag}", look.own, width=2.2)
    beside = Line("plant/condenser_pressure", f"actual, {look.theirs}", look.other, "dashdot")
    panels.append(Panel("p_c", "Condenser pressure", "p<sub>c</sub>, kPa", KPA, (p_c,), (beside,), least_range=1.0))
    moving = (panel for panel in _AIR if _varies(recording, panel.own[0].key))
    return [*panels, *_performance(recording, look), *_car(recording, look), *moving]


def _car(recording: Recording, look: _Look) -> list[Panel]:
    """Return the panels of a car: how it moves, and what comes of its cabin; none without one."""
    cabin_air, interior, humidity, condenser_air = CABIN_SERIES
    if not _acts(recording, cabin_air):
        return []
    cabin = (
        Line("scenario/condenser_air_inlet_temperature", "outside", GREY, "dash"),
        Line(interior, "interior", ORANGE),
        Line("plant/vent_temperature", "vents", SKY),
        Line(cabin_air, "cabin air", look.own, width=2.2),
    )
    vehicle = Line(CAR_SERIES[0], "vehicle", look.own)
    return [
        Panel("cabin", "Cabin and vents", "T, °C", 1.0, cabin),
        Panel("vehicle", "Vehicle speed", "km/h", 1 / 3.6, (vehicle,), least_range=1.0),
        _air("front_end", condenser_air, "Air through the condenser", "m<sub>ca</sub>, kg/s", 0.01),
        _air("breath", humidity, "Relative humidity of the air into the evaporator", "%", 1.0, 0.01),
    ]


def _air(key: str, series: str, title: str, y_title: str, least: float, per_unit: float = 1.0) -> Panel:
    line = Line(series, title.lower(), GREEN, step=True)
    return Panel(key, title, y_title, per_unit, (line,), least_range=least)


_AIR = (
    _air("air_flow", "scenario/air:evaporator_air", "Evaporator air flow", "m<sub>ea</sub>, kg/s", 0.001),
    _air("air_inlet", "scenario/air_inlet_temperature", "Evaporator air inlet", "T<sub>ea</sub>, °C", 0.1),
    _air("humidity", "scenario/air_humidity", "Relative humidity at the evaporator", "%", 1.0, 0.01),
    _air("condenser_flow", "scenario/condenser_air:condenser_air", "Condenser air flow", "m<sub>ca</sub>, kg/s", 0.001),
    _air(
        "condenser_inlet",
        "scenario/condenser_air_inlet_temperature",
        "Condenser air inlet",
        "T<sub>ca</sub>, °C",
        0.1,
    ),
)
"""Panels of the air side; a run has those in which something moves."""


def _performance(recording: Recording, look: _Look) -> list[Panel]:
    """Return the panels of what the plant makes of a run; none for a plant that does not tell it."""
    cooling, latent, water, frost, power, vent, subcooling = PERFORMANCE_SERIES
    if not _acts(recording, cooling):
        return []
    heat = [Line(cooling, "cooling", look.own, width=2.2), Line(power, "compressor power", ORANGE)]
    moist = _acts(recording, water)
    if moist:
        heat.insert(1, Line(latent, "latent cooling", SKY, width=1.4))
    panels = [
        Panel("cooling", "Cooling and compressor power", "kW", 1e3, tuple(heat)),
        Panel("cop", "COP: cooling over compressor power", "COP", 1.0, (Line(COP, "COP", look.own, width=2.2),)),
        Panel(
            "vents", "Air at the evaporator's outlet", "T, °C", 1.0, (Line(vent, "air outlet", look.own, width=2.2),)
        ),
        Panel("subcooling", "Subcooling", "K", 1.0, (Line(subcooling, "subcooling", look.own, width=2.2),)),
    ]
    if moist:
        lines = [Line(water, "water", look.own, width=2.2)]
        if _acts(recording, frost):
            lines.append(Line(frost, "of it frost", ORANGE))
        panels.append(Panel("water", "Water that condenses", "kg/h", 1 / 3600, tuple(lines)))
    return panels


def story_of(recording: Recording) -> tuple[str, ...]:
    """List the panels that tell what the faults of a run do: `STORY`, and those that no filter is for."""
    return (*STORY, *(fault.kind for fault in _unfiltered(recording)))


def _injected(fault: Fault) -> Line:
    return Line(truth_of(fault.kind), "fault injected", BLACK, "dash", 1.4, step=True)


def _without_filter(fault: Fault) -> Panel:
    """Return the panel of a fault that has no residual."""
    title, y_title = f"Fault of the {fault.name}", f"{subscripted(fault.symbol)}, {fault.unit}"
    return Panel(fault.kind, title, y_title, fault.si, (_injected(fault),))


def _unfiltered(recording: Recording) -> list[Fault]:
    """List the faults of a run that no filter is for."""
    return [fault for fault in FAULTS if not fault.has_filter and _acts(recording, truth_of(fault.kind))]


def values_of(run: Recording, key: str) -> NDArray[np.float64]:
    """Return a series of a run, also `ERROR` and `COP`, SI."""
    if key == ERROR:
        return run.series["plant/evaporator_pressure"] - run.series["reference/evaporator_pressure"]
    if key != COP:
        return run.series[key]
    cooling, power = (run.series[PERFORMANCE_SERIES[Performance._fields.index(name)]] for name in _COP_OF)
    with np.errstate(divide="ignore", invalid="ignore"):
        cop: NDArray[np.float64] = np.where(power > _LEAST_POWER_W, cooling / power, np.nan)
    return cop


def cut(recording: Recording, stop_s: float) -> Recording:
    """Leave out what came after `stop_s`."""
    keep = recording.time_s <= stop_s
    return replace(
        recording,
        time_s=recording.time_s[keep],
        series={key: values[keep] for key, values in recording.series.items()},
        status=[row for row in recording.status if row.time_s <= stop_s],
    )


# ------------------------------------------------------------------------------------------------------- details


def _curves(
    panel: Panel,
    recording: Recording,
    ticks: NDArray[np.int_],
    beside: Recording | None,
    other_ticks: NDArray[np.int_] | None,
) -> list[Curve]:
    """Return the lines of a panel; the run beside lies underneath, thresholds on top."""

    def curve(run: Recording, line: Line, at: NDArray[np.int_]) -> Curve:
        values, look = values_of(run, line.key)[at] / panel.per_unit, (line.name, line.colour, line.dash, line.width)
        return Curve(run.time_s[at], values, *look, line.step, panel.digits, panel.unit)

    curves = []
    if beside is not None and other_ticks is not None:
        curves += [curve(beside, line, other_ticks) for line in panel.beside]
    curves += [curve(recording, line, ticks) for line in panel.own]
    if panel.fault is not None and recording.status:
        curves += _thresholds(recording, panel)
    return curves


def _thresholds(recording: Recording, panel: Panel) -> list[Curve]:
    index = ISOLABLE_KINDS.index(panel.fault or "")
    times = np.array([row.time_s for row in recording.status])
    threshold = np.array([row.thresholds[index] for row in recording.status]) / panel.per_unit
    changes = np.concatenate([[True], np.diff(threshold) != 0.0])
    changes[-1] = True
    return [
        Curve(
            times[changes],
            sign * threshold[changes],
            "threshold" if sign > 0 else "",
            GREY,
            "dot",
            1.2,
            step=True,
            unit=panel.unit,
        )
        for sign in (1.0, -1.0)
    ]


def _decisions(panel: Panel, recording: Recording, start_s: float, stop_s: float) -> list[Points]:
    """Return the detection and isolation as points on the residual that they are about."""
    if panel.fault is None:
        return []
    detections, isolations = instants(recording)
    named = [at for at, kind in isolations if kind == panel.fault]
    # A detection belongs to the residual whose fault is named next.
    seen = [at for at in detections if next((kind for when, kind in isolations if when >= at), None) == panel.fault]
    residual = recording.series[panel.own[1].key] / panel.per_unit
    found = []
    for name, symbol, colour, times in ((DETECTED, "triangle", PURPLE, seen), (ISOLATED, "diamond", GREEN, named)):
        inside = [at for at in times if start_s <= at <= stop_s]
        if inside:
            y = np.interp(inside, recording.time_s, residual).tolist()
            found.append(Points(inside, y, name, symbol, colour))
    return found


def _ticks(run: Recording, start_s: float, stop_s: float, lines: Sequence[Line]) -> NDArray[np.int_]:
    """Return the ticks of a run that plots of these lines from `start_s` to `stop_s` need."""
    inside = np.flatnonzero((run.time_s >= start_s) & (run.time_s <= stop_s))
    signals = [(values_of(run, line.key)[inside], line.step) for line in lines]
    return inside[kept_ticks(run.time_s[inside], signals)] if len(inside) else inside


def _range(
    panel: Panel,
    recording: Recording,
    ticks: NDArray[np.int_],
    beside: Recording | None,
    other_ticks: NDArray[np.int_] | None,
) -> tuple[float, float] | None:
    """Return the range of a panel's axis over what is shown, in its unit; None when there is nothing to show."""
    lines = [values_of(recording, line.key)[ticks] for line in panel.own]
    if beside is not None and other_ticks is not None:
        lines += [values_of(beside, line.key)[other_ticks] for line in panel.beside]
    values = np.concatenate(lines) / panel.per_unit
    values = values[np.isfinite(values)]
    if not len(values):
        return None
    low, high = float(values.min()), float(values.max())
    least = max(panel.least_range, 1e-3 * abs(high))
    if panel.fault is not None and recording.status:
        threshold = recording.status[-1].thresholds[ISOLABLE_KINDS.index(panel.fault)] / panel.per_unit
        low, high = min(low, -threshold), max(high, threshold)
    return spaced(low, high, least)


def _varies(recording: Recording, key: str) -> bool:
    values = recording.series[key]
    values = values[np.isfinite(values)]
    return bool(len(values)) and bool(values.max() > values.min())


def _acts(recording: Recording, key: str) -> bool:
    return key in recording.series and bool(np.nan_to_num(recording.series[key]).any())
