"""How the nodes of a recorded run fared: their health reports on `/diagnostics` as curves and events."""

import json
import math
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ac_common.health import read_restarts
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
_COUNTERS = {
    "missed_ticks": "ticks missed (command late, the last one held)",
    "missed_commands": "ticks without a command seen",
    "overruns": "ticks took longer than they may",
    "lost_inputs": "inputs lost",
    "late_inputs": "inputs too late",
}
#: Reports may come by the hundred; a table of more events than these is read by nobody.
MOST_EVENTS = 60


@dataclass(frozen=True)
class Report:
    """One health report: when (s since the run's first tick), whose, what it said in words, and its figures."""

    time_s: float
    node: str
    message: str
    values: Mapping[str, str]


@dataclass(frozen=True)
class Event:
    """Something out of the ordinary that a node reported."""

    time_s: float
    node: str
    what: str


def reports_of(raw: RawBag) -> list[Report]:
    """All health reports of a bag in order of time; what is no report is passed over."""
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
    """Stamp of the run's first tick, s: what nodes that tell a tick's own time count from."""
    return first_stamp_ns(raw) / NANOSECONDS


def events_of(reports: Sequence[Report], first_tick_s: float = 0.0) -> list[Event]:
    """What the nodes reported beyond business as usual, in order of time.

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
        state = report.values.get("state", "")
        if report.message not in (said, state, *(event.what for event in announced)):
            events.append(Event(report.time_s, report.node, report.message))
        ended = before is not None and before.values.get("state") == "active" and state not in ("active", "")
        if ended and report.values.get("finished") != "true":
            events.append(Event(report.time_s, report.node, f"no longer active: {state}"))
        last[report.node] = report
    if BRINGUP in last:
        restarts = read_restarts(last[BRINGUP].values.get("restarts", "[]"))
        events += [Event(restart.died_s, restart.node, str(restart)) for restart in restarts]
    return sorted(events, key=lambda event: event.time_s)


def health_charts(reports: Sequence[Report]) -> list[Chart]:
    """Timing over the run: how long each node took from its inputs to its outputs, and how fast the loop ran."""
    nodes = [node for node in reversed(_LOOKS) if any(report.node == node for report in reports)]
    described = (
        ("latency_p50_ms", "From a node's inputs to its outputs, typical", "median, ms"),
        ("latency_max_ms", "From a node's inputs to its outputs, longest", "longest, ms"),
    )
    charts = []
    for key, title, y_title in described:
        curves = [curve for node in nodes if (curve := _curve(reports, node, key)) is not None]
        if curves:
            charts.append(_chart(title, y_title, curves, log="y" if key == "latency_max_ms" else ""))
    speed = _curve(reports, CONTROLLER, "rate_hz")
    if speed is not None:
        charts.append(_chart("Commands in a second of the wall clock", "1/s", [speed]))
    return charts


def _chart(title: str, y_title: str, curves: Sequence[Curve], log: str = "") -> Chart:
    values = np.concatenate([curve.y for curve in curves])
    values = values[values > 0.0] if log else values
    if not len(values):
        values = np.array([1.0])
    low, high = float(values.min()), float(values.max())
    y_range = (low / 1.3, high * 1.3) if log else spaced(0.0, high, 1e-3)
    x_range = (0.0, max(1.0, *(float(curve.x[-1]) for curve in curves)))
    return Chart(title, curves, y_title, "Time of the report, s", x_range=x_range, y_range=y_range, log=log)


def _curve(reports: Sequence[Report], node: str, key: str) -> Curve | None:
    points = [
        (report.time_s, value)
        for report in reports
        if report.node == node and report.time_s >= 0.0 and math.isfinite(value := _number(report.values.get(key)))
    ]
    if len(points) < 2:
        return None
    x, y = np.array(points).T
    colour, dash = _LOOKS[node]
    return Curve(x, y, node, colour, dash, 1.4, digits=".3g")


def _announced(report: Report, first_tick_s: float) -> Iterator[Event]:
    try:
        announced = json.loads(report.values.get("announced", "[]"))
        for tick_s, what in announced:
            yield Event(float(tick_s) - first_tick_s, report.node, str(what))
    except (ValueError, TypeError):
        return


def _grown(report: Report, before: Report | None) -> Iterator[Event]:
    """Counters that are higher than in this node's report before."""
    old = before.values if before else {}

    def growth(key: str) -> int:
        new, known = _number(report.values.get(key)), _number(old.get(key, "0"))
        return int(new - known) if math.isfinite(new) and math.isfinite(known) else 0

    reasons = [key for key in report.values if key.startswith("rejected/") and growth(key) > 0]
    why = ", ".join(f"{growth(key)} {key.removeprefix('rejected/')}" for key in reasons)
    if (refused := growth("rejected_inputs")) > 0:
        last = report.values.get("last_rejected", "")
        detail = "; ".join(part for part in (why, f"the last: {last}" if last else "") if part)
        what = f"{refused} input{'s' if refused > 1 else ''} refused"
        yield Event(report.time_s, report.node, f"{what} ({detail})" if detail else what)
    for key, words in _COUNTERS.items():
        if (more := growth(key)) > 0:
            yield Event(report.time_s, report.node, f"{more} {words}")


def _number(text: str | None) -> float:
    try:
        return float(text) if text is not None else math.nan
    except ValueError:
        return math.nan
