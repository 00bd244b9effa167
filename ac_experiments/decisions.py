"""When the detector saw a fault and what it named, and when nodes did something else than usual, and how long."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from ac_common.fdi_status import StatusRow
from ac_common.health import AS_USUAL


@dataclass(frozen=True)
class Spell:
    """A time in which something was so: a fault detected (`kind` is None), or named; `end_s` is nan: to the end."""

    kind: str | None
    start_s: float
    end_s: float

    @property
    def length_s(self) -> float:
        """How long it was so, s; nan: to the end of the run."""
        return self.end_s - self.start_s

    def holds_at(self, time_s: float) -> bool:
        """Return whether it was so at a time."""
        return self.start_s <= time_s and not time_s >= self.end_s


def spells_of(status: Iterable[StatusRow]) -> list[Spell]:
    """Return all detections and all that was named, in order of their beginning, a detection before its names."""
    begun: dict[str | None, float] = {}
    found: list[Spell] = []
    last: tuple[Any, ...] = (False, None, None)
    for row in status:
        state = (row.detected, row.isolated, row.also_isolated)
        if state == last:
            continue
        last = state
        now: list[str | None] = [None] if row.detected else []
        now += [name for name in state[1:] if name]
        over = [kind for kind in begun if kind not in now]
        found += [Spell(kind, begun.pop(kind), row.time_s) for kind in over]
        for kind in now:
            begun.setdefault(kind, row.time_s)
    found += [Spell(kind, start_s, math.nan) for kind, start_s in begun.items()]
    return sorted(found, key=lambda spell: (spell.start_s, spell.kind is not None))


def with_lengths(events: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the changes of what nodes do, each with ``length_s``: until the same node's next one, None: to the end.

    The return to business as usual has none.
    """
    found = []
    for number, event in enumerate(events):
        later = (other["time_s"] for other in events[number + 1 :] if other["node"] == event["node"])
        end_s = None if event["what"] == AS_USUAL else next(later, None)
        found.append({**event, "length_s": None if end_s is None else end_s - event["time_s"]})
    return found
