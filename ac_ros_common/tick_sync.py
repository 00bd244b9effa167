"""Which messages make up a tick and when it is acted upon: bookkeeping without ROS.

In lockstep (`TickSet`) a tick waits for all its messages, however long that takes. On the wall clock (`WallClockSet`)
it does not: when a message stays away the tick goes on with the one before, or without. `Timeline` tells what is fresh
from what is stale, `Writer` the publisher that a topic belongs to from a stranger.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

from ac_common.topics import Topic

Values = tuple[Any, ...]

#: Stamps that wait for their last message; more than this are garbage from a foreign publisher.
MOST_WAITING = 64

_MS = 1_000_000
#: Messages that are older than so many ticks, and than this, are stale on the wall clock.
STALE_TICKS, STALE_NS = 2.5, 250 * _MS
#: Messages whose stamp is ahead of what is due by more than one tick, and by more than this, are from no clock of ours.
EARLY_NS = 100 * _MS
#: The least delay that was seen is forgotten by this part of the time that passes: one stamp that was early is no law.
FORGETS = 0.01
#: When nothing but refused stamps has come for so long, it is the time base that has changed.
REBASE_NS = 1_000 * _MS
#: A publisher is gone when nothing of its has come for so long (its numbers may then begin anew).
WRITER_GONE_NS = 400 * _MS
#: So many messages of one publisher may be lost in a row without it becoming a stranger.
MOST_LOST = 50


@dataclass
class TickSet:
    """Messages of several topics that belong together when they carry the same stamp.

    A complete set newer than the last one is handed on; what is older by then never will be and is dropped.
    """

    topics: tuple[Topic, ...]
    act: Callable[..., None]  # (stamp in ns, the values of all topics in their order)
    last_ns: int = -1
    _waiting: dict[int, dict[str, Values]] = field(default_factory=dict)

    def add(self, topic: str, time_ns: int, values: Values) -> tuple[Any, ...] | None:
        """Add one message; the arguments for `act` when it completes its set, else None."""
        if time_ns <= self.last_ns:
            return None
        got = self._waiting.setdefault(time_ns, {})
        got[topic] = values
        if len(got) < len(self.topics):
            if len(self._waiting) > MOST_WAITING:
                del self._waiting[min(self._waiting)]
            return None
        self.last_ns = time_ns
        self._waiting = {stamp: rest for stamp, rest in self._waiting.items() if stamp > time_ns}
        return (time_ns, *(value for topic_ in self.topics for value in got[topic_.name]))

    def lacking(self) -> Collection[int]:
        """Return the places among `topics`: of each tick under way the last that it lacks; all when there is none."""
        return _lacking(self.topics, self._waiting)

    def clear(self) -> None:
        """Forget everything, as before the first tick."""
        self.last_ns = -1
        self._waiting.clear()


def _lacking(topics: tuple[Topic, ...], waiting: Mapping[int, Mapping[str, Values]]) -> Collection[int]:
    places = range(len(topics))
    if not waiting:
        return places
    return {max(place for place in places if topics[place].name not in got) for got in waiting.values()}


class Timeline:
    """Where the stamps of the loop lie on this process's monotonic clock.

    The smallest time from a stamp to its arrival is learnt, and slowly forgotten; a message's age counts from there.
    Neither a step of the wall clock nor a pause of this process changes that.
    """

    def __init__(self, period_ns: int) -> None:
        self.period_ns = period_ns
        self.stale_ns = max(int(STALE_TICKS * period_ns), STALE_NS)
        self._early_ns = max(period_ns, EARLY_NS)
        self._offset_ns: int | None = None  # least of (arrival - stamp)
        self._judged_ns = 0
        self._refused_since_ns: int | None = None
        self.generation = 0  # grows with every new time base

    def refuse(self, stamp_ns: int, now_ns: int) -> str:
        """Return why a message with this stamp, arriving now, must not be acted upon; empty when it may be."""
        reason = self._judge(stamp_ns, now_ns)
        if not reason:
            self._refused_since_ns = None
            return ""
        if self._refused_since_ns is None:
            self._refused_since_ns = now_ns
        if now_ns - self._refused_since_ns < REBASE_NS:
            return reason
        self.clear()
        return self._judge(stamp_ns, now_ns)

    def arrival_ns(self, stamp_ns: int) -> int:
        """Return when the first message of a tick is to be expected, on the monotonic clock."""
        return stamp_ns + (self._offset_ns or 0)

    def clear(self) -> None:
        """Learn anew, from the next message on."""
        self._offset_ns = None
        self._refused_since_ns = None
        self.generation += 1

    def _judge(self, stamp_ns: int, now_ns: int) -> str:
        offset_ns = now_ns - stamp_ns
        passed_ns, self._judged_ns = now_ns - self._judged_ns, now_ns
        if self._offset_ns is None:
            self._offset_ns = offset_ns
            return ""
        age_ns = offset_ns - self._offset_ns
        if age_ns > self.stale_ns:
            return "stale"
        if age_ns < -self._early_ns:
            return "stamp from the future"
        self._offset_ns = min(self._offset_ns + int(FORGETS * min(passed_ns, self.period_ns)), offset_ns)
        return ""


class WallClockSet:
    """A `TickSet` that does not wait for ever.

    A tick is complete when all its messages are there. It is due when `patience_ns` have passed since its first message
    was to be expected, whether one has come or not; then the newest values stand in for what is missing. Of several
    ticks that have piled up only the newest is acted upon.

    Parameters
    ----------
    topics, act
        As of a `TickSet`. A value that is missing and may be is given to `act` as None.
    timeline
        The node's.
    patience_ns
        See above.
    holds : mapping from topic to int or None
        For how many ticks the newest value of a topic may stand in; None: for ever. Topics not named: not at all.
    optional : collection of topics without which a tick may do.
    on_missed_inputs : callable, optional
        Called with the stamp of a tick that lacks what it cannot do without. Without it such a tick is left out.
    """

    def __init__(
        self,
        topics: tuple[Topic, ...],
        act: Callable[..., None],
        timeline: Timeline,
        patience_ns: int,
        holds: Mapping[str, int | None] | None = None,
        optional: tuple[str, ...] = (),
        on_missed_inputs: Callable[[int], None] | None = None,
    ) -> None:
        self.topics = topics
        self.act = act
        self.last_ns = -1
        self.late = 0  # messages that came after their tick
        self.duplicates = 0
        self.skipped = 0  # ticks that were passed over
        self.held: dict[str, int] = {topic.name: 0 for topic in topics}  # ticks with a stand-in, or without
        self._timeline = timeline
        self._patience_ns = patience_ns
        self._holds: dict[str, int | None] = {topic.name: 0 for topic in topics}
        self._holds.update(holds or {})
        self._optional = optional
        self._on_missed_inputs = on_missed_inputs
        self._newest: dict[str, tuple[int, Values]] = {}
        self._waiting: dict[int, dict[str, Values]] = {}

    def add(self, topic: str, time_ns: int, values: Values) -> tuple[Any, ...] | None:
        """Add one message; the arguments for `act` when it completes its tick, else None."""
        newest = self._newest.get(topic)
        if newest is None or time_ns > newest[0]:
            self._newest[topic] = (time_ns, values)
        if time_ns <= self.last_ns:
            self.late += 1
            return None
        got = self._waiting.setdefault(time_ns, {})
        if topic in got:
            self.duplicates += 1
            return None
        got[topic] = values
        if len(got) == len(self.topics):
            return self._close(time_ns)
        if len(self._waiting) > MOST_WAITING:
            del self._waiting[min(self._waiting)]
        return None

    def due_ns(self) -> int | None:
        """Return when the next tick is due; None when nothing is to be expected."""
        tick_ns = self._next_ns()
        return None if tick_ns is None else self._timeline.arrival_ns(tick_ns) + self._patience_ns

    def overdue(self, now_ns: int) -> tuple[Any, ...] | None:
        """Return the arguments for `act` for the newest tick that is due; None when there is none, or nothing to do."""
        due_ns, tick_ns = self.due_ns(), self._next_ns()
        if due_ns is None or tick_ns is None or now_ns < due_ns:
            return None
        period_ns = self._timeline.period_ns
        tick_ns += (now_ns - due_ns) // period_ns * period_ns
        # A plant may stamp by a clock that jitters: what has come for about this tick is this tick.
        come = [stamp for stamp in self._waiting if self.last_ns < stamp < tick_ns + period_ns // 2]
        return self._close(max(come, key=lambda stamp: (len(self._waiting[stamp]), stamp), default=tick_ns))

    def lacking(self) -> Collection[int]:
        """Return the places among `topics`: of each tick under way the last that it lacks; all when there is none."""
        return _lacking(self.topics, self._waiting)

    def clear(self) -> None:
        """Forget everything, as before the first tick."""
        self.last_ns = -1
        self._waiting.clear()
        self._newest.clear()

    def _next_ns(self) -> int | None:
        if self.last_ns < 0:
            return min(self._waiting, default=None)
        following_ns = self.last_ns + self._timeline.period_ns
        if self._on_missed_inputs is not None or self._stands_in(following_ns):
            return following_ns
        return min(self._waiting, default=None)

    def _stands_in(self, time_ns: int) -> bool:
        """Whether a tick could do without any message of its own."""
        return all(self._value(topic, time_ns) is not None for topic in self.topics if topic.name not in self._optional)

    def _value(self, topic: Topic, time_ns: int) -> Values | None:
        newest = self._newest.get(topic.name)
        ticks = self._holds[topic.name]
        if newest is None or newest[0] > time_ns:
            return None
        if ticks is not None and time_ns - newest[0] > ticks * self._timeline.period_ns:
            return None
        return newest[1]

    def _close(self, time_ns: int) -> tuple[Any, ...] | None:
        got = self._waiting.pop(time_ns, {})
        arguments: list[Any] = [time_ns]
        is_lacking = False
        for topic in self.topics:
            values = got.get(topic.name)
            if values is None:
                self.held[topic.name] += 1
                values = self._value(topic, time_ns)
            if values is None:
                is_lacking = is_lacking or topic.name not in self._optional
                values = (None,) * max(len(topic.series), 1)
            arguments += values
        if self.last_ns >= 0:
            self.skipped += max(round((time_ns - self.last_ns) / self._timeline.period_ns) - 1, 0)
        self.last_ns = time_ns
        self._waiting = {stamp: rest for stamp, rest in self._waiting.items() if stamp > time_ns}
        if not is_lacking:
            return tuple(arguments)
        if self._on_missed_inputs is not None:
            self._on_missed_inputs(time_ns)
        return None


class Writer:
    """Tells the messages of a topic's own publisher from those of a second one by the publisher's own numbering.

    A topic's own publisher is the one that was there first; its numbers grow by one (by more when messages are lost).
    When it has been silent for `WRITER_GONE_NS`, the next one to speak is the topic's own.
    """

    def __init__(self) -> None:
        self._last = -1
        self._heard_ns = 0
        self.strangers = 0  # messages of others

    def owns(self, number: int | None, now_ns: int) -> bool:
        """Whether the message with this number, arriving now, is the own publisher's."""
        if number is None:  # a middleware that does not number messages
            return True
        if not self._last < number <= self._last + MOST_LOST and now_ns - self._heard_ns < WRITER_GONE_NS:
            self.strangers += 1
            return False
        self._last = number
        self._heard_ns = now_ns
        return True
