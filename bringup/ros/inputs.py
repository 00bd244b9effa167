"""A node's inputs: messages are collected by stamp, and the node acts when all of one tick are there."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.context import Context
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.signals import SignalHandlerGuardCondition
from rclpy.subscription import Subscription

from bringup.ros.messages import BadMessage, Values, reader, stamp_ns
from bringup.topics import Topic

#: Stamps that wait for their last message; more than this are garbage from a foreign publisher.
MOST_WAITING = 64


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

    def clear(self) -> None:
        """Forget everything, as before the first tick."""
        self.last_ns = -1
        self._waiting.clear()


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
    else, and one wake takes whatever has arrived: `act` gets it as a list of (number, message).
    """

    def __init__(self, context: Context, raw: bool, act: Callable[[list[tuple[int, Any]]], bool]) -> None:
        self._context = context
        self._raw = raw
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

    def wait(self, timeout_s: float) -> bool:
        """Wait until something arrives, a signal comes or the time is over, act on what is there; what `act` said."""
        if self._wait_set is None:
            self._wait_set = _rclpy.WaitSet(len(self._sources), 1, 0, 0, 0, 0, self._context.handle)
        wait_set = self._wait_set
        wait_set.clear_entities()
        for _, handle, _ in self._sources:
            wait_set.add_subscription(handle)
        wait_set.add_guard_condition(self._signals.handle)
        wait_set.wait(max(int(timeout_s * 1e9), 0))
        return self.take()

    def take(self) -> bool:
        """Act on all messages that are there; what `act` said."""
        messages = self.arrived()
        return self._act(messages) if messages else False

    def arrived(self) -> list[tuple[int, Any]]:
        """All messages that are there, each with the number of its subscription."""
        messages = []
        raw = self._raw
        for number, handle, type_ in self._sources:
            while (taken := handle.take_message(type_, raw)) is not None:
                messages.append((number, taken[0]))
        return messages


class LoopInputs:
    """Reads a node's messages, collects them into ticks and lets the node act on each complete one."""

    def __init__(self, rejected: Callable[[BadMessage], None]) -> None:
        self._rejected = rejected
        self._readers: list[tuple[TickSet, str, Callable[[Any], Values]]] = []
        self._sets: list[TickSet] = []

    def add(self, tick_set: TickSet) -> None:
        """Expect the topics of `tick_set` under the next numbers, in their order."""
        self._sets.append(tick_set)
        self._readers += [(tick_set, topic.name, reader(topic)) for topic in tick_set.topics]

    def clear(self) -> None:
        """Forget incomplete sets."""
        for tick_set in self._sets:
            tick_set.clear()

    def take(self, messages: list[tuple[int, Any]]) -> bool:
        """Act on the ticks that `messages` complete, in order of time; whether a tick is over for this node."""
        complete = []
        for number, message in messages:
            tick_set, name, read = self._readers[number]
            try:
                done = tick_set.add(name, stamp_ns(message), read(message))
            except BadMessage as problem:
                self._rejected(problem)
                continue
            if done is not None:
                complete.append((done[0], tick_set, done))
        if len(complete) > 1:
            complete.sort(key=_time)  # stable: within a tick in the order the node asked for
        over = False
        for _, tick_set, arguments in complete:
            tick_set.act(*arguments)
            over = over or tick_set is self._sets[-1]
        return over


def _time(complete: tuple[int, TickSet, tuple[Any, ...]]) -> int:
    return complete[0]
