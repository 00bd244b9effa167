"""A node's inputs: messages are taken, checked, collected by stamp, and the node acts tick by tick (`tick_sync`)."""

import math
import time
from collections.abc import Callable, Sequence
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.context import Context
from rclpy.signals import SignalHandlerGuardCondition
from rclpy.subscription import Subscription

from ac_ros_common._rclpy import WaitSet
from ac_ros_common.messages import BadMessage, Reader, reader
from ac_ros_common.tick_sync import TickSet, Timeline, WallClockSet, Writer

#: Number of the subscription, serialised message, and the publisher's own number of it (None: the middleware has none).
Arrival = tuple[int, bytes, int | None]


class Gate(CallbackGroup):  # type: ignore[misc]
    """A callback group that is either open or closed; closed entities are not even waited for."""

    def __init__(self, is_open: bool) -> None:
        super().__init__()
        self.is_open = is_open

    def can_execute(self, entity: object) -> bool:  # noqa: ARG002
        """Whether entities of this group take part in the executor's next wait."""
        return self.is_open

    def beginning_execution(self, entity: object) -> bool:  # noqa: ARG002
        """Whether a callback may run now."""
        return self.is_open

    def ending_execution(self, entity: object) -> None:
        """Nothing to do after a callback."""


class Subscriptions:
    """The loop's subscriptions of a node, waited for and taken from without rclpy's executor.

    The executor makes a task for every message and rebuilds a wait set with all services, timers and events twice for
    each, which costs more than all of the loop's mathematics. Here the wait set holds these subscriptions and nothing
    else, and one wake takes whatever has arrived: `act` gets it, serialised, as a list of `Arrival`.
    """

    def __init__(self, context: Context, act: Callable[[list[Arrival]], bool]) -> None:
        self._context = context
        self._act = act
        self._sources: list[tuple[int, Any, Any]] = []
        self._wait_set: Any = None
        self._signals = SignalHandlerGuardCondition(context=context)

    def __len__(self) -> int:
        return len(self._sources)

    def add(self, subscription: Subscription) -> int:
        """Take from `subscription`, too; its number."""
        self._sources.append((len(self._sources), subscription.handle, subscription.msg_type))
        self._wait_set = None
        return len(self._sources) - 1

    def wait(self, timeout_s: float, numbers: Sequence[int] | None = None) -> bool:
        """Wait until something arrives, a signal comes or the time is over, act on what is there; what `act` said.

        With `numbers` only these subscriptions end the wait; messages of all of them are taken then.
        """
        if self._wait_set is None:
            self._wait_set = WaitSet(len(self._sources), 1, 0, 0, 0, 0, self._context.handle)
        wait_set = self._wait_set
        wait_set.clear_entities()
        for number in range(len(self._sources)) if numbers is None else numbers:
            wait_set.add_subscription(self._sources[number][1])
        wait_set.add_guard_condition(self._signals.handle)
        wait_set.wait(max(int(timeout_s * 1e9), 0))
        return self.take()

    def take(self) -> bool:
        """Act on all messages that are there; what `act` said."""
        messages = self.arrived()
        return self._act(messages) if messages else False

    def arrived(self) -> list[Arrival]:
        """Return all messages that are there."""
        messages: list[Arrival] = []
        serialised = True
        for number, handle, type_ in self._sources:
            while (taken := handle.take_message(type_, serialised)) is not None:
                messages.append((number, taken[0], taken[1]["publication_sequence_number"]))
        return messages


class LoopInputs:
    """Reads a node's messages, collects them into ticks and lets the node act on each complete one.

    Parameters
    ----------
    rejected
        Told of each message that must not be acted upon: its topic, a word for the reason, and what is wrong with it.
    timeline
        For a node on the wall clock; None in lockstep.
    """

    def __init__(self, rejected: Callable[[str, str, str], None], timeline: Timeline | None = None) -> None:
        self._rejected = rejected
        self.timeline = timeline
        self._generation = timeline.generation if timeline else 0
        self._readers: list[tuple[TickSet | WallClockSet, str, Reader, Writer]] = []
        self._sets: list[TickSet | WallClockSet] = []
        self._numbers: list[range] = []  # of the subscriptions of each set
        self._clocked: list[WallClockSet] = []

    def add(self, tick_set: TickSet | WallClockSet) -> None:
        """Expect the topics of `tick_set` under the next numbers, in their order."""
        self._sets.append(tick_set)
        if isinstance(tick_set, WallClockSet):
            self._clocked.append(tick_set)
        self._numbers.append(range(len(self._readers), len(self._readers) + len(tick_set.topics)))
        self._readers += [(tick_set, topic.name, reader(topic), Writer()) for topic in tick_set.topics]

    def clear(self) -> None:
        """Forget incomplete sets, and when the last tick was."""
        for tick_set in self._sets:
            tick_set.clear()
        if self.timeline is not None:
            self.timeline.clear()
            self._generation = self.timeline.generation

    def take(self, messages: list[Arrival]) -> bool:
        """Act on the ticks that `messages` complete, in order of time; whether a tick is over for this node.

        On the wall clock only the newest tick of each set is acted upon.
        """
        complete = []
        now_ns = time.monotonic_ns()
        for number, message, sequence in messages:
            tick_set, name, read, writer = self._readers[number]
            if not writer.owns(sequence, now_ns):
                self._rejected(name, "stranger", f"message {sequence} of a second publisher")
                continue
            try:
                stamp, values = read(message)
            except BadMessage as problem:
                self._rejected(name, problem.reason, str(problem))
                continue
            if self.timeline is not None and (reason := self.timeline.refuse(stamp, now_ns)):
                self._rejected(name, reason, f"{name}: stamp {stamp / 1e9:.3f} s: {reason}")
                continue
            if self.timeline is not None and self.timeline.generation != self._generation:
                self._rebase()
            done = tick_set.add(name, stamp, values)
            if done is not None:
                complete.append((done[0], tick_set, done))
        if self._clocked and len(complete) > len(self._sets):
            newest = {id(tick_set): done for done in complete for tick_set in [done[1]]}
            complete = [done for done in complete if newest[id(done[1])] is done]
        if len(complete) > 1:
            complete.sort(key=_time)  # stable: within a tick in the order the node asked for
        over = False
        for _, tick_set, arguments in complete:
            tick_set.act(*arguments)
            over = over or tick_set is self._sets[-1]
        return over

    def awaited(self) -> list[int]:
        """Return the numbers of the subscriptions that are worth waking for: of a tick under way only one it lacks.

        A tick's messages come one by one within a few hundred microseconds. To wake for each costs more than what is
        done with them; the first is wanted at once, as it tells when the tick began.
        """
        both = zip(self._sets, self._numbers, strict=True)
        return [numbers[place] for tick_set, numbers in both for place in tick_set.lacking()]

    def due_s(self) -> float:
        """Return when the next tick is due although something is missing (monotonic clock); never in lockstep."""
        dues = [due for tick_set in self._clocked if (due := tick_set.due_ns()) is not None]
        return min(dues) / 1e9 if dues else math.inf

    def act_on_due(self) -> None:
        """Act on what is due by now."""
        now_ns = time.monotonic_ns()
        for tick_set in self._clocked:
            arguments = tick_set.overdue(now_ns)
            if arguments is not None:
                tick_set.act(*arguments)

    def counts(self) -> dict[str, Any]:
        """Return the fields of a health report about messages that the wall clock had to do without; none in lockstep.

        They are what came too late or twice, the ticks passed over, and by topic those without a message.
        """
        if not self._clocked:
            return {}
        return {
            "late_inputs": sum(tick_set.late for tick_set in self._clocked),
            "duplicate_inputs": sum(tick_set.duplicates for tick_set in self._clocked),
            "skipped_ticks": sum(tick_set.skipped for tick_set in self._clocked),
            "missing": {topic: n for tick_set in self._clocked for topic, n in tick_set.held.items() if n},
        }

    def _rebase(self) -> None:
        assert self.timeline is not None
        self._generation = self.timeline.generation
        for tick_set in self._clocked:
            tick_set.clear()


def _time(complete: tuple[int, Any, tuple[Any, ...]]) -> int:
    return complete[0]
