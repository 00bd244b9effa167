"""How the nodes of a recorded run fared: their own health reports, boiled down to one row for each node."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from statistics import median


@dataclass(frozen=True)
class NodeHealth:
    """One node over a whole run; nan where it reported nothing.

    Attributes
    ----------
    name : as in ``ros2 node list``.
    state : life cycle state in the last report.
    latency_p50_ms, latency_max_ms : time from a complete set of inputs to the last output, typical and longest.
    rejected_inputs : messages that were refused, and
    last_rejected : why the last of them was.
    """

    name: str
    state: str
    latency_p50_ms: float
    latency_max_ms: float
    rejected_inputs: int
    last_rejected: str


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
            rejected_inputs=int(max(_numbers(rows[-1:], "rejected_inputs"), default=0.0)),
            last_rejected=rows[-1].get("last_rejected", ""),
        )
        for name, rows in sorted(by_node.items())
    ]


def _numbers(rows: list[Mapping[str, str]], key: str) -> list[float]:
    values = [_number(row[key]) for row in rows if key in row]
    return [value for value in values if math.isfinite(value)]


def _number(text: str) -> float:
    """A number, or nan for what is none: anybody may publish on /diagnostics."""
    try:
        return float(text)
    except ValueError:
        return math.nan
