"""What has happened in the loop, for the page's list and the marks in its plots. Pure: no ROS, no Bokeh.

Events come from what `fdi` says, what the nodes announce in their health reports, and the page's own controls.
"""

import threading
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from ac_common.faults import BY_KIND, UNKNOWN
from ac_common.fdi_status import NO_LONGER, NOT_SURE, SURE, StatusRow
from ac_common.health import AS_USUAL
from ac_common.topics import FDI, INJECTOR

#: So many are kept.
MOST_EVENTS = 200
#: What happened in one tick has one mark; so has what happened in so short a time, s.
ONE_MARK_S = 0.05


@dataclass(frozen=True)
class Happening:
    """One event: its stamp, whose it is, and what it was."""

    time_ns: int
    node: str
    what: str


@dataclass
class Events:
    """The last events, filled by one thread and read by others; each is told once, however often it is reported."""

    _kept: deque[Happening] = field(default_factory=lambda: deque(maxlen=MOST_EVENTS))
    _known: set[Happening] = field(default_factory=set)
    _status: tuple[bool, frozenset[str], frozenset[str]] = (False, frozenset(), frozenset())
    _faults: frozenset[str] = frozenset()
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def add(self, happening: Happening) -> None:
        """Take an event."""
        with self._lock:
            if happening in self._known:
                return
            if len(self._kept) == MOST_EVENTS:
                self._known.discard(self._kept[0])
            self._kept.append(happening)
            self._known.add(happening)

    def announced(self, node: str, told: Iterable[tuple[float, str]]) -> None:
        """Take what a node's health report announces: times [s] and words."""
        for time_s, what in told:
            self.add(Happening(round(time_s * 1e9), node, what))

    def decided(self, time_ns: int, status: StatusRow) -> None:
        """Take what has changed of the detector's decision."""
        detected, named, sure = self._status
        now, sure_now = (
            frozenset(filter(None, names)) for names in ((status.isolated, status.also_isolated), status.acted_on)
        )
        self._status = (status.detected, now, sure_now)
        if status.detected and not detected:
            self.add(Happening(time_ns, FDI, "fault detected"))
        for kind in sorted(now - named):
            doubt = "" if kind in sure_now else f": {NOT_SURE}"
            self.add(Happening(time_ns, FDI, f"{_symbol(kind)} isolated{doubt}"))
        changed = ((SURE, sure_now & named - sure), (NO_LONGER, sure & now - sure_now))
        for what, kinds in changed:
            for kind in sorted(kinds):
                self.add(Happening(time_ns, FDI, f"{_symbol(kind)} {what}"))
        for kind in sorted(named - now):
            self.add(Happening(time_ns, FDI, f"{_symbol(kind)} no longer isolated"))
        if detected and not status.detected:
            self.add(Happening(time_ns, FDI, "no fault detected any more"))

    def injected(self, time_ns: int, faults: frozenset[str]) -> None:
        """Take which live faults are on."""
        for kind in sorted(faults - self._faults):
            self.add(Happening(time_ns, INJECTOR, f"{_symbol(kind)} begins"))
        for kind in sorted(self._faults - faults):
            self.add(Happening(time_ns, INJECTOR, f"{_symbol(kind)} ends"))
        self._faults = faults

    def since(self, first_ns: int) -> list[tuple[float, Happening]]:
        """Return the events from a stamp on with their times [s] after it, in order of time."""
        with self._lock:
            kept = [happening for happening in self._kept if happening.time_ns >= first_ns]
        return [((one.time_ns - first_ns) / 1e9, one) for one in sorted(kept, key=lambda one: one.time_ns)]


def marks(events: Iterable[tuple[float, Happening]]) -> list[float]:
    """Return the times [s] at which the plots have a mark: not where a node only does as usual again."""
    found: list[float] = []
    for time_s, happening in events:
        if happening.what != AS_USUAL and (not found or time_s - found[-1] > ONE_MARK_S):
            found.append(time_s)
    return found


def _symbol(kind: str) -> str:
    return "another fault" if kind == UNKNOWN else BY_KIND[kind].symbol
