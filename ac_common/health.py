"""How the nodes of a run fared, from their own health reports: a row for each node, and the missed ticks.

Anybody may publish on /diagnostics, in a node's name too: what makes no sense counts as not reported.
"""

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from statistics import median
from typing import Any

#: What a node announces when it does nothing out of the ordinary any more.
AS_USUAL = "as usual again"


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
    """All missed ticks that the plant's health reports of a run tell of, in order; each tells the last ones only."""
    epoch_s = math.nan
    missed: set[int] = set()
    late_s: dict[int, float] = {}
    for values in reports:
        epoch_s = reported(values, "epoch_monotonic_s", epoch_s)
        missed.update(k for k in _items(values, "missed_at") if type(k) is int)
        late_s.update(pair for pair in _items(values, "late_commands") if _is_late(pair))
    return tuple(MissedTick(k, epoch_s + k * sample_time_s, late_s.get(k, math.nan)) for k in sorted(missed))


def health_of(reports: Iterable[tuple[str, Mapping[str, str]]]) -> list[NodeHealth]:
    """Boil down health reports (node name, figures), oldest first, to one row for each node in order of name."""
    by_node: dict[str, list[Mapping[str, str]]] = {}
    for name, values in reports:
        by_node.setdefault(name, []).append(values)
    return [
        NodeHealth(
            name=name,
            state=rows[-1].get("state", ""),
            latency_p50_ms=median(_numbers(rows, "latency_p50_ms") or [math.nan]),
            latency_max_ms=max(_numbers(rows, "latency_max_ms"), default=math.nan),
            overruns=int(sum(_ends(rows, "overruns"))),
            rejected_inputs=int(max(_numbers(rows[-1:], "rejected_inputs"), default=0.0)),
            last_rejected=rows[-1].get("last_rejected", ""),
        )
        for name, rows in sorted(by_node.items())
    ]


def _ends(rows: list[Mapping[str, str]], key: str) -> list[float]:
    """Last value of a counter in each life of a node: one that was started again counts from 0."""
    values = _numbers(rows, key)
    return [value for i, value in enumerate(values) if i + 1 == len(values) or values[i + 1] < value]


def _numbers(rows: list[Mapping[str, str]], key: str) -> list[float]:
    values = [reported(row, key) for row in rows]
    return [value for value in values if math.isfinite(value)]


def _items(values: Mapping[str, str], key: str) -> list[Any]:
    """What is listed under a key, as JSON."""
    try:
        items = json.loads(values.get(key, "[]"))
    except (ValueError, RecursionError):
        return []
    return items if isinstance(items, list) else []


def _is_late(pair: Any) -> bool:
    """Whether it is a tick and how late its command was, s."""
    return isinstance(pair, list) and [type(value) for value in pair] == [int, float]


def reported(values: Mapping[str, str], key: str, otherwise: float = math.nan) -> float:
    """Read the finite number that a health report has under `key`, `otherwise` where it has none."""
    try:
        value = float(values[key])
    except (KeyError, ValueError):
        return otherwise
    return value if math.isfinite(value) else otherwise


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
        """What happened, in words, without the node's name."""
        then = f"back in service {self.back_s - self.died_s:.1f} s later" if self.is_back else "not back in service"
        return f"died ({self.reason}) and was started again; {then}"


def read_restarts(text: str) -> list[Restart]:
    """All restarts of bringup's health report, in order; none where it holds something else."""
    try:
        return [
            Restart(str(item["node"]), float(item["died_s"]), str(item["reason"]), float(item["back_s"]))
            for item in json.loads(text)
        ]
    except (ValueError, TypeError, KeyError):
        return []
