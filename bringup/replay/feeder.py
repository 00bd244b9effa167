"""Stands in for everything around one node: publishes its inputs and collects its outputs, both serialised."""

import time
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ac_common.topics import NAMESPACE, TOPICS, Topic
from ac_common.wire import stamp_ns
from ac_ros_common.messages import message_class
from ac_ros_common.qos import qos_of
from bringup.launch.supervisor import Supervisor


class Feeder:
    """Publishers for a node's inputs, subscriptions to its outputs."""

    def __init__(self, supervisor: Supervisor, node: str, topics: Sequence[Topic] = TOPICS) -> None:
        self._supervisor = supervisor
        ros = supervisor.node
        self._publishers = {
            topic.name: ros.create_publisher(message_class(topic.type), f"{NAMESPACE}/{topic.name}", qos_of(topic))
            for topic in topics
            if node in topic.subscribers
        }
        self._subscriptions: list[Any] = []
        self.got: dict[str, bytes] = {}
        for topic in topics:
            if topic.publisher == node:
                self._subscribe(topic)

    def _subscribe(self, topic: Topic) -> None:
        def take(data: Any) -> None:
            self.got[topic.name] = data

        self._subscriptions.append(
            self._supervisor.node.create_subscription(
                message_class(topic.type), f"{NAMESPACE}/{topic.name}", take, qos_of(topic), raw=True
            )
        )

    def is_matched(self) -> bool:
        """Whether the node reads all its inputs by now and its outputs arrive here."""
        return all(p.get_subscription_count() > 0 for p in self._publishers.values()) and all(
            s.get_publisher_count() > 0 for s in self._subscriptions
        )

    def publish(self, messages: Iterable[tuple[Topic, bytes]]) -> None:
        """Publish one tick's inputs."""
        for topic, data in messages:
            self._publishers[topic.name].publish(data)

    def collect(self, wanted: Mapping[str, bytes], patience_s: float) -> dict[str, bytes] | None:
        """Wait for the outputs of one tick; None when one of them does not come."""
        deadline = time.monotonic() + patience_s
        stamps = {topic: stamp_ns(data) for topic, data in wanted.items()}
        while not all(topic in self.got and stamp_ns(self.got[topic]) == stamp for topic, stamp in stamps.items()):
            self._supervisor.spin()
            if time.monotonic() > deadline:
                return None
        answers, self.got = self.got, {}
        return answers
