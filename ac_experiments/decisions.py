"""When the detector saw a fault and what it named, and when nodes did something else than usual, and how long."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ac_common.fdi_status import NEVER_SURE, StatusRow
from ac_common.health import AS_USUAL


@dataclass(frozen=True)
class Spell:
    """A time in which something was so: a fault detected (`kind` is None), or named; `end_s` is nan: to the end.

    `sure_s`: when the name was first sure, and so to be acted on; nan: it never was.
    """

    kind: str | None
    start_s: float
    end_s: float = math.nan
    sure_s: float = math.nan

    @property
    def length_s(self) -> float:
        """How long it was so, s; nan: to the end of the run."""
        return self.end_s - self.start_s

    def holds_at(self, time_s: float) -> bool:
        """Return whether it was so at a time."""
        return self.start_s <= time_s and not time_s >= self.end_s


def spells_of(status: Iterable[StatusRow]) -> list[Spell]:
    """Return all detections and all that was named, in order of their beginning, a detection before its names."""
    begun: dict[str | None, Spell] = {}
    found: list[Spell] = []
    last: tuple[Any, ...] = (False, None, None, None)
    for row in status:
        state = (row.detected, row.isolated, row.also_isolated, row.unsure)
        if state == last:
            continue
        last = state
        now: list[str | None] = [None] if row.detected else []
        now += [name for name in (row.isolated, row.also_isolated) if name]
        over = [kind for kind in begun if kind not in now]
        found += [replace(begun.pop(kind), end_s=row.time_s) for kind in over]
        for kind in now:
            spell = begun.setdefault(kind, Spell(kind, row.time_s))
            if kind is not None and kind in row.acted_on and math.isnan(spell.sure_s):
                begun[kind] = replace(spell, sure_s=row.time_s)
    return sorted([*found, *begun.values()], key=lambda spell: (spell.start_s, spell.kind is not None))


def unsure_of(status: Iterable[StatusRow]) -> list[Spell]:
    """Return the times in which a name was unsure, in their order."""
    found: list[Spell] = []
    begun: Spell | None = None
    for row in status:
        if begun is not None and row.unsure != begun.kind:
            found.append(replace(begun, end_s=row.time_s))
            begun = None
        if row.unsure and begun is None:
            begun = Spell(row.unsure, row.time_s)
    return found if begun is None else [*found, begun]


def sure_from(spells: Sequence[Spell], kind: str | None, time_s: float) -> float:
    """Return from when on what is named at a time was sure, s; nan: it never was."""
    sure_s = next((spell.sure_s for spell in spells if spell.kind == kind and spell.holds_at(time_s)), math.nan)
    return time_s if sure_s < time_s else sure_s


def told_sure(entry: Mapping[str, Any], named_s: float | None = 0.0, since_s: float = 0.0, form: str = "") -> str:
    """Return in words, to go on with, when the name was sure that an entry of a summary has; nothing if at once.

    `named_s`: when it was named. `form` takes the time after `since_s`, s; without it only what was never sure is told.
    """
    sure_s = entry.get("sure_s", named_s)
    if sure_s == named_s:
        return ""
    return f", {NEVER_SURE}" if sure_s is None else form.format(sure_s - since_s)


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
