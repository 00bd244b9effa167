"""Health reports of the nodes on /diagnostics, typed both ways, and what the reports of a whole run amount to.

A node writes a `HealthReport`, and most nodes a part of their own beside it (`PlantReport`, ...). Each field knows its
keys and how it is written and read: no other file spells a key. Anybody may publish on /diagnostics, in a node's name
too: what makes no sense counts as not reported.
"""

import json
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any, Self

#: What a node announces when it does nothing out of the ordinary any more.
AS_USUAL = "as usual again"


@dataclass(frozen=True)
class _Wire:
    """How a field stands in a report; with a `prefix` it is a mapping, and each of its items has a key."""

    write: Callable[[Any], str]
    read: Callable[[str], Any]
    prefix: str = ""


def _field(default: Any, write: Callable[[Any], str], read: Callable[[str], Any]) -> Any:
    return field(default=default, metadata={"wire": _Wire(write, read)})


def _text() -> Any:
    return _field("", str, str)


def _count() -> Any:
    return _field(None, str, _integer)


def _number(form: str, default: float | None = math.nan) -> Any:
    return _field(default, lambda value: format(value, form), _finite)


def _exact() -> Any:
    return _field(math.nan, repr, _finite)


def _flag() -> Any:
    return _field(False, lambda value: "true" if value else "false", lambda text: text == "true")


def _items(read: Callable[[list[Any]], tuple[Any, ...]]) -> Any:
    return _field((), json.dumps, lambda text: read(_list(text)))


def _mapping(prefix: str, write: Callable[[Any], str], read: Callable[[str], Any]) -> Any:
    return field(default_factory=dict, metadata={"wire": _Wire(write, read, prefix)})


@dataclass(frozen=True)
class HealthPart:
    """Fields that stand in a health report, each under its name, or its items each under a prefix and their names."""

    def values(self) -> dict[str, str]:
        """Return the keys and values as they are published; None is left out."""
        found: dict[str, str] = {}
        for each in fields(self):
            wire: _Wire = each.metadata["wire"]
            value = getattr(self, each.name)
            if wire.prefix:
                found |= {f"{wire.prefix}{name}": wire.write(item) for name, item in value.items()}
            elif value is not None:
                found[each.name] = wire.write(value)
        return found

    @classmethod
    def read(cls, values: Mapping[str, str]) -> Self:
        """Return what keys and values say; a field that is missing or makes no sense has its default."""
        found: dict[str, Any] = {}
        for each in fields(cls):
            wire: _Wire = each.metadata["wire"]
            named = {each.name: each.name}
            if wire.prefix:
                named = {key.removeprefix(wire.prefix): key for key in values if key.startswith(wire.prefix)}
            told: dict[str, Any] = {}
            for name, key in named.items():
                try:
                    told[name] = wire.read(values[key])
                except (KeyError, ValueError, TypeError, OverflowError, RecursionError):
                    continue
            if wire.prefix:
                found[each.name] = told
            else:
                found |= told
        return cls(**found)


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value


def _integer(text: str) -> int:
    try:
        return int(text)  # exactly: a stamp in ns has more digits than a float
    except ValueError:
        return int(_finite(text))


def _list(text: str) -> list[Any]:
    items = json.loads(text)
    if not isinstance(items, list):
        raise TypeError(text)
    return items


def _announcements(items: list[Any]) -> tuple[tuple[float, str], ...]:
    return tuple((float(time_s), str(what)) for time_s, what in items)


def _ticks(items: list[Any]) -> tuple[int, ...]:
    return tuple(item for item in items if type(item) is int)


def _late(items: list[Any]) -> tuple[tuple[int, float], ...]:
    """Return the pairs of a tick and how late its command was, s."""
    pairs = [item for item in items if isinstance(item, list)]
    return tuple((pair[0], pair[1]) for pair in pairs if [type(value) for value in pair] == [int, float])


@dataclass(frozen=True)
class HealthReport(HealthPart):
    """What every node reports.

    Attributes
    ----------
    state : life-cycle state.
    pid : process.
    scheduling, realtime_care : what the operating system has granted.
    ticks : ticks done in this life of the node, `rate_hz` of them in a second since the last report.
    latency_p50_ms, latency_max_ms : from a complete set of inputs to the last output, since the last report.
    overruns : ticks whose own work took longer than a sample time.
    longest_tick_ms : the longest of all ticks.
    input_age_s : time since the inputs of a tick were complete.
    rejected_inputs : messages that were refused, `rejected` by reason, and `last_rejected`: why the last of them was.
    mode : what the node does other than usual.
    announced : changes of it, each with the time of its tick, s.
    subscriptions : how many the node has.
    late_inputs, duplicate_inputs, skipped_ticks : on the wall clock alone.
    missing : ticks that had to do without a message, by topic.
    subscribers : how many readers each output has found, by topic.
    """

    state: str = _text()
    pid: int | None = _count()
    scheduling: str = _text()
    realtime_care: str = _text()
    ticks: int | None = _count()
    rate_hz: float = _number(".1f")
    latency_p50_ms: float = _number(".3f")
    latency_max_ms: float = _number(".3f")
    overruns: int | None = _count()
    longest_tick_ms: float = _number(".3f")
    input_age_s: float = _number(".3f")
    rejected_inputs: int | None = _count()
    last_rejected: str = _text()
    rejected: Mapping[str, int] = _mapping("rejected/", str, _integer)
    mode: str = _text()
    announced: tuple[tuple[float, str], ...] = _items(_announcements)
    subscriptions: int | None = _count()
    late_inputs: int | None = _count()
    duplicate_inputs: int | None = _count()
    skipped_ticks: int | None = _count()
    missing: Mapping[str, int] = _mapping("missing/", str, _integer)
    subscribers: Mapping[str, int] = _mapping("subscribers/", str, _integer)


@dataclass(frozen=True)
class PlantReport(HealthPart):
    """What the plant reports besides: where the run is, and how long commands took.

    Attributes
    ----------
    tick : the tick under way; `finished` after the last one, which came `wall_seconds` after the first.
    missed_ticks : ticks of the wall clock that ended before their command had come; `missed_at` are the last of them.
    late_commands : the last late ones: tick, and s after its end.
    epoch_monotonic_s : when tick 0 was, on the monotonic clock; `first_ns`: its stamp.
    late_wakeups : ticks that began late.
    command_latency_p50_ms, command_latency_p99_ms, command_latency_max_ms : from measurement to command.
    internal_state : the model's states by name, SI; only of our own plant, and
    performance : the fields of `ac_common.signals.Performance`, likewise.
    """

    tick: int | None = _count()
    finished: bool = _flag()
    wall_seconds: float = _exact()
    missed_ticks: int | None = _count()
    missed_at: tuple[int, ...] = _items(_ticks)
    late_commands: tuple[tuple[int, float], ...] = _items(_late)
    epoch_monotonic_s: float = _exact()
    late_wakeups: int | None = _count()
    first_ns: int | None = _count()
    command_latency_p50_ms: float = _number(".3f")
    command_latency_p99_ms: float = _number(".3f")
    command_latency_max_ms: float = _number(".3f")
    internal_state: Mapping[str, float] = _mapping("state/", lambda value: format(value, ".6g"), _finite)
    performance: Mapping[str, float] = _mapping("performance/", lambda value: format(value, ".6g"), _finite)

    @property
    def command_latency_ms(self) -> tuple[float, float, float]:
        """Time from measurement to command: median, 99 % and longest."""
        return self.command_latency_p50_ms, self.command_latency_p99_ms, self.command_latency_max_ms


@dataclass(frozen=True)
class FdiReport(HealthPart):
    """What `fdi` reports besides: measurements that had to go ahead without the command of the tick before."""

    missed_commands: int | None = _count()


@dataclass(frozen=True)
class InjectorReport(HealthPart):
    """What the fault injector reports besides: the kinds of the live faults that are on."""

    live_faults: tuple[str, ...] = _field((), ", ".join, lambda text: tuple(part for part in text.split(", ") if part))


@dataclass(frozen=True)
class RecorderReport(HealthPart):
    """What the recorder reports besides: whether the bag holds the whole run, or else what is missing."""

    complete: bool = _flag()
    missing: str = _text()


@dataclass(frozen=True)
class BringupReport(HealthPart):
    """What bringup reports of the graph: the restarts so far, and what is in it and does not belong there."""

    restarts: tuple["Restart", ...] = _field(
        (), lambda restarts: json.dumps([asdict(restart) for restart in restarts]), lambda text: _restarts(text)
    )
    strangers: tuple[str, ...] = _items(lambda items: tuple(str(item) for item in items))


@dataclass(frozen=True)
class NodeHealth:
    """One node over a whole run; nan where it reported nothing.

    Attributes
    ----------
    name : as in ``ros2 node list``.
    state : life cycle state in the last report.
    latency_p50_ms, latency_max_ms : time from a complete set of inputs to the last output, typical and longest.
    overruns : ticks whose own work took longer than a sample time, over all lives of the node.
    rejected_inputs : messages that were refused, and
    last_rejected : why the last of them was.
    """

    name: str
    state: str
    latency_p50_ms: float
    latency_max_ms: float
    overruns: int
    rejected_inputs: int
    last_rejected: str


@dataclass(frozen=True)
class MissedTick:
    """A tick of the wall clock that ended before its command had come.

    Attributes
    ----------
    tick : its number.
    began_s : when it began, on the monotonic clock.
    late_s : how long after the tick's end the command came; nan: not at all, or nobody told.
    """

    tick: int
    began_s: float
    late_s: float = math.nan


def missed_ticks(reports: Iterable[Mapping[str, str]], sample_time_s: float) -> tuple[MissedTick, ...]:
    """Return all missed ticks that the plant's health reports of a run tell of, in order; each tells the last ones."""
    epoch_s = math.nan
    missed: set[int] = set()
    late_s: dict[int, float] = {}
    for report in map(PlantReport.read, reports):
        epoch_s = report.epoch_monotonic_s if math.isfinite(report.epoch_monotonic_s) else epoch_s
        missed.update(report.missed_at)
        late_s.update(report.late_commands)
    return tuple(MissedTick(k, epoch_s + k * sample_time_s, late_s.get(k, math.nan)) for k in sorted(missed))


def health_of(reports: Iterable[tuple[str, Mapping[str, str]]]) -> list[NodeHealth]:
    """Return one row for each node, in order of name, from health reports (node name, values), oldest first."""
    by_node: dict[str, list[HealthReport]] = {}
    for name, values in reports:
        by_node.setdefault(name, []).append(HealthReport.read(values))
    return [
        NodeHealth(
            name=name,
            state=rows[-1].state,
            latency_p50_ms=_median(_known(row.latency_p50_ms for row in rows)),
            latency_max_ms=max(_known(row.latency_max_ms for row in rows), default=math.nan),
            overruns=sum(_ends([row.overruns for row in rows if row.overruns is not None])),
            rejected_inputs=rows[-1].rejected_inputs or 0,
            last_rejected=rows[-1].last_rejected,
        )
        for name, rows in sorted(by_node.items())
    ]


def _ends(values: list[int]) -> list[int]:
    """Return the last value of a counter in each life of a node: one that was started again counts from 0."""
    return [value for i, value in enumerate(values) if i + 1 == len(values) or values[i + 1] < value]


def _median(values: Iterable[float]) -> float:
    """Return the median, nan of nothing; the module that has it takes longer to load than a node may."""
    ordered = sorted(values)
    return 0.5 * (ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2]) if ordered else math.nan


def _known(values: Iterable[float]) -> list[float]:
    return [value for value in values if math.isfinite(value)]


@dataclass
class Restart:
    """One restart of a node, times in s since the first tick.

    Attributes
    ----------
    died_s : when bringup saw that the process was gone.
    back_s : when the node was back in service; nan while it is not.
    reason : signal or exit code, and its last words.
    """

    node: str
    died_s: float
    reason: str
    back_s: float = float("nan")

    @property
    def is_back(self) -> bool:
        """Whether the node is back in service."""
        return math.isfinite(self.back_s)

    def __str__(self) -> str:
        """Return what happened, in words, without the node's name."""
        then = f"back in service {self.back_s - self.died_s:.1f} s later" if self.is_back else "not back in service"
        return f"died ({self.reason}) and was started again; {then}"


def _restarts(text: str) -> tuple[Restart, ...]:
    return tuple(
        Restart(str(item["node"]), float(item["died_s"]), str(item["reason"]), float(item["back_s"]))
        for item in json.loads(text)
    )
