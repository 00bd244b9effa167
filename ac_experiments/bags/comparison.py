"""A node's recorded messages tick by tick, and its new answers compared with them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ac_common.topics import TOPICS, Topic
from ac_common.wire import restamped, stamp_ns
from ac_experiments.bags.reader import RawBag, decode, loop_messages

#: Largest relative difference that counts as rounding of another processor.
RELATIVE_TOLERANCE = 1e-9
#: Differences that are described one by one.
MOST_SHOWN = 20


@dataclass
class ReplayResult:
    """What a replay has shown.

    Attributes
    ----------
    compared : number of messages compared.
    identical : how many of them have the recorded bytes.
    largest_relative_difference : over all values of all messages.
    differences : the first messages that differ by more than rounding, one line each.
    different : how many they are in all.
    """

    node: str
    ticks: int = 0
    compared: int = 0
    identical: int = 0
    largest_relative_difference: float = 0.0
    different: int = 0
    differences: list[str] = field(default_factory=list)

    @property
    def same(self) -> bool:
        """Whether the node still gives its recorded outputs, up to rounding."""
        return self.compared > 0 and self.different == 0

    @property
    def bit_for_bit(self) -> bool:
        """Whether every message is the recorded one to the last bit."""
        return self.compared > 0 and self.identical == self.compared

    def compare(self, tick: int, topic: str, recorded: bytes, answer: bytes) -> None:
        """Count one message, and describe it if it differs by more than rounding."""
        self.compared += 1
        if recorded == answer:
            self.identical += 1
            return
        then, now = decode(topic, recorded), decode(topic, answer)
        worst = 0.0
        for key in then:
            worst = max(worst, _relative_difference(then[key], now.get(key)))
        self.largest_relative_difference = max(self.largest_relative_difference, worst)
        if worst > RELATIVE_TOLERANCE:
            self.different += 1
            if len(self.differences) < MOST_SHOWN:
                changed = [f"{k} {then[k]!r} -> {now.get(k)!r}" for k in then if then[k] != now.get(k)]
                self.differences.append(f"tick {tick} {topic}: {', '.join(changed)}")


@dataclass
class Tick:
    """What a node got and gave at one stamp."""

    inputs: list[tuple[Topic, bytes]] = field(default_factory=list)
    outputs: dict[str, bytes] = field(default_factory=dict)


def by_tick(raw: RawBag, node: str, topics: Sequence[Topic] = TOPICS) -> list[Tick]:
    """Return the recorded inputs and outputs of a node, stamps counted from the first one, in order of time."""
    ticks: dict[int, Tick] = {}
    messages = {topic.name: loop_messages(raw, topic) for topic in topics}
    first = min((stamp_ns(found[0]) for found in messages.values() if found), default=0)
    wanted = 0
    for topic in topics:
        if topic.publisher != node and node not in topic.subscribers:
            continue
        wanted += node in topic.subscribers
        for data in messages[topic.name]:
            time_ns = stamp_ns(data) - first
            tick = ticks.setdefault(time_ns, Tick())
            if topic.publisher == node:
                tick.outputs[topic.name] = restamped(data, time_ns)
            else:
                tick.inputs.append((topic, restamped(data, time_ns)))
    ordered = [ticks[time_ns] for time_ns in sorted(ticks)]
    # A bag cut short ends with a tick of which only a part is there.
    whole = next((i for i, tick in enumerate(ordered) if len(tick.inputs) < wanted), len(ordered))
    return ordered[:whole]


def _relative_difference(then: Any, now: Any) -> float:
    """Return the difference relative to the larger value; infinite when they are no numbers and not equal."""
    if then == now:
        return 0.0
    try:
        a, b = float(then), float(now)
    except (TypeError, ValueError):
        return math.inf
    if math.isnan(a) and math.isnan(b):
        return 0.0
    return abs(a - b) / max(abs(a), abs(b)) if math.isfinite(a) and math.isfinite(b) else math.inf
