"""What of a graph is to be seen over ROS: whether its nodes have found each other, and what does not belong there."""

from collections.abc import Collection
from typing import Any

from rclpy.qos import ReliabilityPolicy

from ac_common.topics import BRINGUP, BY_NAME, NAMESPACE, OCCASIONAL, PAGE, PLANT, RECORDER, SCENARIO, TOPICS, Topic
from ac_ros_common.type_definitions import type_hash
from bringup.launch.reports import Reports


class GraphAudit:
    """Compares what is to be seen of a graph with the table of topics.

    Parameters
    ----------
    node : rclpy.node.Node
        Through which the graph is seen.
    names
        Nodes of the graph.
    users
        Those of them whose code is the user's: they may read and publish what they like.
    health
        Last health report of each node, kept up to date by its owner: it tells how many subscribers its outputs have
        found.
    topics
        Those that have messages in this run.
    """

    def __init__(
        self,
        node: Any,
        names: Collection[str],
        users: Collection[str],
        health: Reports,
        topics: Collection[Topic] = TOPICS,
    ) -> None:
        self._node, self._names, self._users, self._health, self._topics = node, names, users, health, topics
        self._seen: object = None

    def is_connected(self, name: str) -> bool:
        """Whether every output of a node has the subscribers that this graph holds, on top of anybody else's."""
        if name in self._users:
            reads = sum(self._reads(name, topic) for topic in (*TOPICS, *OCCASIONAL))
            if not self.reports(name):
                return self.publishes_all(name)
            if reads < (self._health.of(name).subscriptions or 0):
                return False  # not all of them have been discovered here
        readers = self._health.of(name).subscribers
        return all(readers.get(topic, 0) >= n + self._others_readers(topic) for topic, n in self._wanted(name).items())

    def unconnected(self) -> str:
        """Name the nodes whose outputs have not found all their subscribers."""
        return ", ".join(name for name in self._names if not self.is_connected(name))

    def reports(self, name: str) -> bool:
        """Whether a node tells its state on /diagnostics, as those of acftc do."""
        return any(_is(name, writer) for writer in self._node.get_publishers_info_by_topic("/diagnostics"))

    def publishes_all(self, name: str) -> bool:
        """Whether every topic that is a node's to publish, and on which another node acts, has a fitting publisher."""
        return not self.lacking(name)

    def lacking(self, name: str) -> list[str]:
        """Return what of a user's node is missing or does not fit, in a line each: topic, type, QoS, and who it is."""
        found = []
        for topic in self._topics:
            if topic.publisher == name and topic.subscribers:
                full = f"{NAMESPACE}/{topic.name}"
                writers = [w for w in self._node.get_publishers_info_by_topic(full) if self._is_of(name, w)]
                if not writers:
                    found.append(f"{full}: no publisher ({topic.type}, reliable)")
                found += [f"{full}: {_called(w)} {why}" for w in writers if (why := _misfit(w, topic))]
        command = BY_NAME["actuator/command"]
        if name == PLANT:
            full = f"{NAMESPACE}/{command.name}"
            readers = [r for r in self._node.get_subscriptions_info_by_topic(full) if self._is_of(name, r)]
            if not readers:
                found.append(f"{full}: no subscription ({command.type})")
        return found

    def _is_of(self, name: str, endpoint: Any) -> bool:
        """Whether an endpoint belongs to a node of the graph: that of a user may be called as it likes."""
        if _is(name, endpoint):
            return True
        is_ours = endpoint.node_namespace == NAMESPACE and endpoint.node_name in (*self._names, BRINGUP, PAGE)
        return name in self._users and not is_ours and "UNKNOWN" not in endpoint.node_name

    def has_changed(self) -> bool:
        """Whether a node, or a publisher of the loop's topics, has come or gone since the last call; quickly told."""
        before, count = self._seen, self._node.count_publishers
        self._seen = (
            sorted(self._node.get_node_names_and_namespaces()),
            [count(f"{NAMESPACE}/{topic.name}") for topic in (*TOPICS, *OCCASIONAL)],
        )
        return self._seen != before

    def unexpected(self, restarted: Collection[str]) -> list[str]:
        """Return, in a line each, nodes and endpoints that do not belong to this graph.

        Of the nodes that were `restarted` the dead publishers may be seen for a while.
        """
        known = {*self._names, BRINGUP, PAGE, *self._users_nodes()}
        found = [
            f"foreign node {NAMESPACE}/{name}"
            for name, namespace in sorted(set(self._node.get_node_names_and_namespaces()))
            if namespace == NAMESPACE and name not in known
        ]
        for topic in (*TOPICS, *OCCASIONAL):
            found += self._unexpected_at(topic, restarted)
        return found

    def _unexpected_at(self, topic: Topic, restarted: Collection[str]) -> list[str]:
        full = f"{NAMESPACE}/{topic.name}"
        writers = self._node.get_publishers_info_by_topic(full)
        found = []
        rightful = [writer for writer in writers if self._is_of(topic.publisher, writer)]
        if len(rightful) > 1 and topic.publisher not in restarted:
            called = sorted({_called(writer) for writer in rightful})
            who = f"called {topic.publisher}" if len(called) == 1 else f"({', '.join(called)})"
            found.append(f"{full}: {len(rightful)} publishers {who}")
        found += [
            f"{full}: second publisher {_called(writer)}{_other_way(topic)}"
            for writer in writers
            if not self._is_of(topic.publisher, writer) and "UNKNOWN" not in writer.node_name
        ]
        if any("UNKNOWN" in writer.node_name for writer in writers):
            self._seen = None  # who it is comes after it: look again
        expected = type_hash(topic.type)
        for endpoint in (*writers, *self._node.get_subscriptions_info_by_topic(full)):
            if endpoint.topic_type != topic.type:
                found.append(f"{full}: {_called(endpoint)} has type {endpoint.topic_type} instead of {topic.type}")
            elif str(endpoint.topic_type_hash).startswith("RIHS") and str(endpoint.topic_type_hash) != expected:
                found.append(f"{full}: {_called(endpoint)} has another version of {topic.type}")
        return found

    def _users_nodes(self) -> set[str]:
        """Return what the nodes are called that stand in for the user's."""
        return {
            writer.node_name
            for topic in TOPICS
            if topic.publisher in self._users
            for writer in self._node.get_publishers_info_by_topic(f"{NAMESPACE}/{topic.name}")
            if self._is_of(topic.publisher, writer)
        }

    def _reads(self, name: str, topic: Topic) -> bool:
        """Whether a node subscribes to a topic: acftc's as the table says, the user's as the graph shows."""
        if name not in self._users:
            return name in topic.subscribers
        readers = self._node.get_subscriptions_info_by_topic(f"{NAMESPACE}/{topic.name}")
        return any(_is(name, reader) for reader in readers)

    def _others_readers(self, topic: str) -> int:
        """Count the subscribers of a topic that are no node of the graph, such as `ros2 topic echo`."""
        full = "/clock" if topic == "clock" else f"{NAMESPACE}/{topic}"
        readers = self._node.get_subscriptions_info_by_topic(full)
        return sum(reader.node_name not in self._names or reader.node_namespace != NAMESPACE for reader in readers)

    def _wanted(self, name: str) -> dict[str, int]:
        """Return how many nodes of the graph read each output of a node."""
        recorded = 1 if RECORDER in self._names else 0
        wanted = {
            topic.name: recorded + sum(self._reads(reader, topic) for reader in self._names)
            for topic in self._topics
            if topic.publisher == name
        }
        if name == PLANT and "clock" in self._health.of(name).subscribers:
            wanted["clock"] = recorded
        return wanted


def _is(name: str, endpoint: Any) -> bool:
    """Whether a publisher or subscriber belongs to the graph's node of that name."""
    return bool(endpoint.node_name == name and endpoint.node_namespace == NAMESPACE)


def _misfit(writer: Any, topic: Topic) -> str:
    """Return why nobody in the loop hears a publisher; empty when they do."""
    if writer.topic_type != topic.type:
        return f"has type {writer.topic_type} instead of {topic.type}"
    if writer.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT:
        return "offers best effort; the loop wants reliable"
    return ""


def _other_way(topic: Topic) -> str:
    """Return how a person does what publishing on the topic itself does not."""
    if not topic.name.startswith("reference/"):
        return ""
    return f", which nobody follows; a reference of yours goes to {NAMESPACE}/{SCENARIO}/{topic.name}"


def _called(endpoint: Any) -> str:
    return f"{endpoint.node_namespace.rstrip('/')}/{endpoint.node_name}"
