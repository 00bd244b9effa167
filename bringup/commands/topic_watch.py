"""What flows between the nodes right now: a table of the running loop's topics, for those without `ros2`."""

import os
import struct
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from typing import Any, Self

from rclpy.qos import QoSProfile, ReliabilityPolicy

from ac_common.errors import shortened
from ac_common.topics import BY_NAME, DIAGNOSTICS, NAMESPACE
from ac_common.wire import read_diagnostics
from ac_experiments.bags.reader import decode
from ac_ros_common.client_node import client_node
from ac_ros_common.messages import message_class
from bringup.launch.processes import ros_environment

#: The name of the node that looks.
NAME = "acftc_topics"
#: The rate is that of the messages of so many seconds.
RATE_WINDOW_S = 2.0
#: Topics come and go: looked for so often, s.
LOOK_S = 0.5

#: Who only looks must never hold a publisher up.
QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)


@dataclass
class SeenTopic:
    """One row of the table."""

    name: str
    type: str
    rate_hz: float = 0.0
    value: str = ""
    publishers: list[str] = field(default_factory=list)
    subscribers: list[str] = field(default_factory=list)


class Watch:
    """Subscribes to every topic of the loop as it appears."""

    def __init__(self) -> None:
        os.environ.update(ros_environment())
        self._stack = ExitStack()
        self._node, self._executor = self._stack.enter_context(client_node(NAME))
        self._arrivals: dict[str, deque[float]] = {}
        self._newest: dict[str, bytes] = {}
        self._types: dict[str, str] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def spin(self, duration_s: float) -> None:
        """Take messages for a while."""
        until = time.monotonic() + duration_s
        looked_s = -LOOK_S
        while (now := time.monotonic()) < until:
            if now - looked_s >= LOOK_S:
                self._look()
                looked_s = now
            self._executor.spin_once(timeout_sec=min(until - now, LOOK_S))

    def rows(self) -> list[SeenTopic]:
        """Return all topics that have been seen, in the order of the loop, then by name."""
        order = {f"{NAMESPACE}/{name}": i for i, name in enumerate(BY_NAME)}
        names = sorted(self._types, key=lambda name: (order.get(name, len(order)), name))
        return [self._row(name) for name in names]

    def _look(self) -> None:
        for name, (type_name, *_) in self._node.get_topic_names_and_types():
            if name in self._types or not (name.startswith(f"{NAMESPACE}/") or name in ("/clock", "/diagnostics")):
                continue
            if not self._node.get_publishers_info_by_topic(name):
                continue
            try:
                type_ = message_class(type_name)
            except (ImportError, AttributeError):
                continue  # not of this loop
            self._types[name] = type_name
            self._arrivals[name] = deque()
            self._node.create_subscription(type_, name, self._taker(name), QOS, raw=True)

    def _taker(self, name: str) -> Callable[[Any], None]:
        arrivals = self._arrivals[name]

        def take(data: Any) -> None:
            arrivals.append(time.monotonic())
            self._newest[name] = data

        return take

    def _row(self, name: str) -> SeenTopic:
        arrivals, now = self._arrivals[name], time.monotonic()
        while arrivals and now - arrivals[0] > RATE_WINDOW_S:
            arrivals.popleft()
        spans = len(arrivals) - 1
        rate = spans / (arrivals[-1] - arrivals[0]) if spans > 0 and arrivals[-1] > arrivals[0] else 0.0
        return SeenTopic(
            name=name,
            type=self._types[name],
            rate_hz=round(rate, 1),
            value=self._value(name),
            publishers=_nodes(self._node.get_publishers_info_by_topic(name)),
            subscribers=[n for n in _nodes(self._node.get_subscriptions_info_by_topic(name)) if n != NAME],
        )

    def _value(self, name: str) -> str:
        data = self._newest.get(name)
        if data is None:
            return ""
        topic = BY_NAME.get(name.removeprefix(f"{NAMESPACE}/"))
        if topic is None or topic.type == DIAGNOSTICS:
            if self._types[name] != DIAGNOSTICS:
                return ""
            return "; ".join(f"{status.name.rsplit('/', 1)[-1]}: {status.message}" for status in read_diagnostics(data))
        try:
            return ", ".join(f"{value:.6g}" for value in decode(topic.name, data).values())
        except (ValueError, struct.error) as problem:  # a message of somebody else's
            return shortened(problem, 60)


def _nodes(endpoints: Any) -> list[str]:
    return sorted({endpoint.node_name for endpoint in endpoints})


def topics_once(duration_s: float = 2.0) -> list[dict[str, Any]]:
    """Return the rows of the table after watching for a while, as plain dicts."""
    with Watch() as watch:
        watch.spin(duration_s)
        return [asdict(row) for row in watch.rows()]


def topics_live(period_s: float = 0.5) -> Iterator[list[SeenTopic]]:
    """Yield the rows of the table again and again, until the caller has seen enough."""
    with Watch() as watch:
        while True:
            watch.spin(period_s)
            yield watch.rows()


#: On a terminal of fewer columns the table leaves away types and nodes, or its lines would be cut off.
WIDE = 140


def table(rows: list[SeenTopic], width: int) -> Any:
    """Return the rows as a table for a terminal of so many columns."""
    from rich.table import Table

    if not rows:
        return (
            f"no topic of the loop to be seen in ROS domain {os.environ.get('ROS_DOMAIN_ID', '0')}; "
            "is a run going on, in this domain and on this host?"
        )
    is_wide = width >= WIDE
    caption = None if is_wide else f"types, publishers, subscribers: {WIDE} columns or more, or --json"
    result = Table(box=None, pad_edge=False, caption=caption, caption_justify="left")
    result.add_column("topic", no_wrap=True)
    if is_wide:
        result.add_column("type", no_wrap=True)
    result.add_column("rate, Hz", justify="right", no_wrap=True)
    result.add_column("last value", no_wrap=True, overflow="ellipsis")
    if is_wide:
        result.add_column("from -> to")
    for row in rows:
        name = row.name if is_wide else row.name.removeprefix(f"{NAMESPACE}/")
        cells = [name, f"{row.rate_hz:.1f}", row.value]
        if is_wide:
            cells.insert(1, row.type.replace("/msg/", "/"))
            cells.append(f"{', '.join(row.publishers) or '-'} -> {', '.join(row.subscribers) or '-'}")
        result.add_row(*cells)
    return result
