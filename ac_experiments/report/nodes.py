"""How the nodes of a recorded run fared: their health reports on `/diagnostics` as curves and events."""

import math
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ac_common.health import BringupReport, FdiReport, HealthReport, PlantReport
from ac_common.topics import BRINGUP, COMPENSATOR, CONTROLLER, FDI, INJECTOR, NAMESPACE, PLANT, RECORDER, SCENARIO
from ac_common.wire import NANOSECONDS, read_diagnostics, stamp_ns
from ac_experiments.bags.reader import SHORTEST_MESSAGE, RawBag, first_stamp_ns
from ac_experiments.report.charts import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION, Chart, Curve, spaced

#: Node by node in the order of the loop, each with its look.
_LOOKS = {
    PLANT: (BLACK, "solid"),
    INJECTOR: (ORANGE, "dash"),
    FDI: (BLUE, "solid"),
    COMPENSATOR: (GREEN, "dash"),
    CONTROLLER: (VERMILION, "solid"),
    SCENARIO: (PURPLE, "dashdot"),
    RECORDER: (SKY, "dot"),
}
_BEAT = f"{NAMESPACE}/plant/evaporator_pressure"

#: Counters of a health report whose growth is an event, and how it is told.
_COUNTERS: tuple[tuple[Callable[["Report"], int | None], str], ...] = (
    (lambda report: PlantReport.read(report.values).missed_ticks, "ticks missed (command late, the last one held)"),
    (lambda report: FdiReport.read(report.values).missed_commands, "ticks without a command seen"),
    (lambda report: report.health.overruns, "ticks took longer than they may"),
    (lambda report: report.health.late_inputs, "inputs too late"),
)
#: Reports may come by the hundred; a table of more events than these is read by nobody.
MOST_EVENTS = 60


@dataclass(frozen=True)
class Report:
    """One health report: when (s since the run's first tick), whose, what it said in words, and its figures."""

    time_s: float
    node: str
    message: str
    values: Mapping[str, str]

    @cached_property
    def health(self) -> HealthReport:
        """What every node reports, read from the figures."""
        return HealthReport.read(self.values)


@dataclass(frozen=True)
class Event:
    """Something out of the ordinary that a node reported; `length_s` is nan where it has no end, or is none to last."""

    time_s: float
    node: str
    what: str
    length_s: float = math.nan


def reports_of(raw: RawBag) -> list[Report]:
    """Return all health reports of a bag in order of time; what is no report is passed over."""
    beats, first_ns = raw.messages.get(_BEAT, []), first_stamp_ns(raw)
    begun = (log_ns for log_ns, data in beats if len(data) >= SHORTEST_MESSAGE and stamp_ns(data) >= first_ns)
    start_ns = next(begun, min((log_ns for log_ns, _ in raw.messages.get("/diagnostics", [])), default=0))
    found = []
    for log_ns, data in raw.messages.get("/diagnostics", []):
        try:
            statuses = read_diagnostics(data)
        except (ValueError, struct.error, IndexError):
            continue
        found += [
            Report((log_ns - start_ns) / NANOSECONDS, status.name.rsplit("/", 1)[-1], status.message, status.values)
            for status in statuses
        ]
    return found


def first_tick_s(raw: RawBag) -> float:
    """Return the stamp of the run's first tick, s: what nodes that tell a tick's own time count from."""
    return first_stamp_ns(raw) / NANOSECONDS


def events_of(reports: Sequence[Report], first_tick_s: float = 0.0) -> list[Event]:
    """Return what the nodes reported beyond business as usual, in order of time.

    A change of what a node does (``announced``, in one report or more, or a message that is no state of the life
    cycle), a counter of something that should not be, that grew; inputs that were refused, by reason where the node
    gives one.
    """
    events: list[Event] = []
    told: set[Event] = set()
    last: dict[str, Report] = {}
    for report in reports:
        if report.node == BRINGUP:
            last[BRINGUP] = report
            continue
        before = last.get(report.node)
        announced = list(_announced(report, first_tick_s))
        events += [event for event in announced if event not in told]
        told.update(announced)
        events += _grown(report, before)
        said = before.message if before else "inactive"
        state = report.health.state
        if report.message not in (said, state, *(event.what for event in announced)):
            events.append(Event(report.time_s, report.node, report.message))
        ended = before is not None and before.health.state == "active" and state not in ("active", "")
        if ended and not PlantReport.read(report.values).finished:
            events.append(Event(report.time_s, report.node, f"no longer active: {state}"))
        last[report.node] = report
    if BRINGUP in last:
        restarts = BringupReport.read(last[BRINGUP].values).restarts
        events += [Event(restart.died_s, restart.node, str(restart)) for restart in restarts]
    return sorted(events, key=lambda event: event.time_s)


def health_charts(reports: Sequence[Report]) -> list[Chart]:
    """Return the timing over the run: how long each node took from inputs to outputs, and how fast the loop ran."""
    nodes = [node for node in reversed(_LOOKS) if any(report.node == node for report in reports)]
    described = (
        (_typical_ms, "From a node's inputs to its outputs, typical", "median, ms", ""),
        (_longest_ms, "From a node's inputs to its outputs, longest", "longest, ms", "y"),
    )
    charts = []
    for figure, title, y_title, log in described:
        curves = [curve for node in nodes if (curve := _curve(reports, node, figure)) is not None]
        if curves:
            charts.append(_chart(title, y_title, curves, log=log))
    speed = _curve(reports, CONTROLLER, lambda health: health.rate_hz)
    if speed is not None:
        charts.append(_chart("Commands in a second of the wall clock", "1/s", [speed]))
    return charts


def _typical_ms(health: HealthReport) -> float:
    return health.latency_p50_ms


def _longest_ms(health: HealthReport) -> float:
    return health.latency_max_ms


def _chart(title: str, y_title: str, curves: Sequence[Curve], log: str = "") -> Chart:
    values = np.concatenate([curve.y for curve in curves])
    values = values[values > 0.0] if log else values
    if not len(values):
        values = np.array([1.0])
    low, high = float(values.min()), float(values.max())
    y_range = (low / 1.3, high * 1.3) if log else spaced(0.0, high, 1e-3)
    x_range = (0.0, max(1.0, *(float(curve.x[-1]) for curve in curves)))
    return Chart(title, curves, y_title, "Time of the report, s", x_range=x_range, y_range=y_range, log=log)


def _curve(reports: Sequence[Report], node: str, figure: Callable[[HealthReport], float]) -> Curve | None:
    points = [
        (report.time_s, value)
        for report in reports
        if report.node == node and report.time_s >= 0.0 and math.isfinite(value := figure(report.health))
    ]
    if len(points) < 2:
        return None
    x, y = np.array(points).T
    colour, dash = _LOOKS[node]
    return Curve(x, y, node, colour, dash, 1.4, digits=".3g")


def _announced(report: Report, first_tick_s: float) -> Iterator[Event]:
    for tick_s, what in report.health.announced:
        yield Event(tick_s - first_tick_s, report.node, what)


def _grown(report: Report, before: Report | None) -> Iterator[Event]:
    """Give the counters that are higher than in this node's report before, in words."""
    old = before.health if before else HealthReport()
    by_reason = {reason: n - old.rejected.get(reason, 0) for reason, n in report.health.rejected.items()}
    why = ", ".join(f"{more} {reason}" for reason, more in by_reason.items() if more > 0)
    if (refused := _growth(report.health.rejected_inputs, old.rejected_inputs)) > 0:
        last = report.health.last_rejected
        detail = "; ".join(part for part in (why, f"the last: {last}" if last else "") if part)
        what = f"{refused} input{'s' if refused > 1 else ''} refused"
        yield Event(report.time_s, report.node, f"{what} ({detail})" if detail else what)
    for counter, words in _COUNTERS:
        if (more := _growth(counter(report), counter(before) if before else None)) > 0:
            yield Event(report.time_s, report.node, f"{more} {words}")


def _growth(new: int | None, old: int | None) -> int:
    return 0 if new is None else new - (old or 0)
