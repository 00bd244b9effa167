"""The yardstick of `acftc bench`: processes that move the loop's messages to the same readers and compute nothing.

Written the way one would write it first: one rclpy node a process, one callback a subscription, rclpy's executor, ready
messages with a new stamp. Same topics, types, QoS, processes and order within a tick as the graph; the recorder takes
every message serialised and drops it.

``python -m bringup.benchmarks.bare_chain NODE TICKS PERIOD_S`` is one process; it says ``ready`` when its outputs have
found their readers. The plant then waits for a line on its standard input, begins TICKS ticks (as fast as it goes, or
every PERIOD_S) and prints its figures as JSON.
"""

import json
import math
import sys
import time
from array import array
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

from ac_common.topics import (
    BY_NAME,
    COMPENSATOR,
    CONTROLLER,
    DIAGNOSTICS,
    FDI,
    INJECTOR,
    JOINTS,
    PLANT,
    RECORDER,
    SCENARIO,
    TICKED,
)
from ac_ros_common._rclpy import RCLError
from ac_ros_common.loop_node import IDLE_S
from ac_ros_common.messages import message_class
from ac_ros_common.process_exit import end_with_parent, leave
from ac_ros_common.qos import LOOP_QOS

NAMESPACE = "/bare"


def _of(node: str, *but: str) -> tuple[str, ...]:
    return tuple(topic.name for topic in TICKED if topic.publisher == node and topic.name not in but)


def _inputs(node: str, *but: str) -> tuple[str, ...]:
    return tuple(topic.name for topic in TICKED if node in topic.subscribers and topic.name not in but)


#: What each node waits for, and what it then sends.
STAGES: dict[str, list[tuple[tuple[str, ...], tuple[str, ...]]]] = {
    PLANT: [(_inputs(PLANT), _of(PLANT))],
    SCENARIO: [(_inputs(SCENARIO), _of(SCENARIO))],
    INJECTOR: [
        (_inputs(INJECTOR, "controller/command"), _of(INJECTOR, "actuator/command")),
        (("controller/command",), ("actuator/command",)),
    ],
    FDI: [(_inputs(FDI, "controller/command"), _of(FDI)), (("controller/command",), ())],
    COMPENSATOR: [(_inputs(COMPENSATOR), _of(COMPENSATOR))],
    CONTROLLER: [(_inputs(CONTROLLER), _of(CONTROLLER))],
    RECORDER: [],
}


class BareNode(Node):  # type: ignore[misc]
    """One process of the chain."""

    def __init__(self, name: str) -> None:
        super().__init__(name, namespace=NAMESPACE)
        self._senders = {topic: self._sender(topic) for _, outputs in STAGES[name] for topic in outputs}
        self._readers = []
        for inputs, outputs in STAGES[name]:
            waiting: dict[int, int] = {}
            for topic in inputs:
                take = self._taker(waiting, len(inputs), outputs)
                self._readers.append(
                    self.create_subscription(message_class(BY_NAME[topic].type), topic, take, LOOP_QOS)
                )
        if name == RECORDER:
            for topic_ in TICKED:
                kind = message_class(topic_.type)
                self._readers.append(self.create_subscription(kind, topic_.name, self._drop, LOOP_QOS, raw=True))
        self.received = 0
        self.complete: Callable[[int], None] | None = None

    def is_matched(self) -> bool:
        """Whether every output has found all its readers."""
        return all(
            publisher.get_subscription_count() > len(BY_NAME[topic].subscribers)
            for topic, (publisher, _) in self._senders.items()
        )

    def send(self, outputs: tuple[str, ...], tick: int) -> None:
        """Publish a ready message of each topic with a new stamp."""
        for topic in outputs:
            publisher, message = self._senders[topic]
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(tick, 1000)
            publisher.publish(message)

    def _sender(self, name: str) -> tuple[Any, Any]:
        from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

        topic = BY_NAME[name]
        message = message_class(topic.type)()
        message.header.frame_id = topic.frame
        if topic.type == JOINTS:
            message.name = list(topic.joints)
            for field in ("position", "velocity", "effort"):
                setattr(message, field, array("d", [math.nan] * len(topic.joints)))
        if topic.type == DIAGNOSTICS:
            values = [KeyValue(key=f"threshold/of_{i}", value="1.2345678901234567") for i in range(7)]
            message.status = [DiagnosticStatus(name="fdi", message="no fault", values=values)]
        return self.create_publisher(type(message), name, LOOP_QOS), message

    def _taker(self, waiting: dict[int, int], wanted: int, outputs: tuple[str, ...]) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            tick = message.header.stamp.sec * 1000 + message.header.stamp.nanosec
            waiting[tick] = waiting.get(tick, 0) + 1
            if waiting[tick] == wanted:
                del waiting[tick]
                if self.complete is not None:
                    self.complete(tick)
                else:
                    self.send(outputs, tick)

        return take

    def _drop(self, _data: Any) -> None:
        self.received += 1


def set_pace(node: BareNode, executor: SingleThreadedExecutor, ticks: int, period_s: float) -> dict[str, float]:
    """Set the pace of the chain: the plant's part."""
    outputs = STAGES[PLANT][0][1]
    latencies_s: list[float] = []
    done: list[int] = []
    node.complete = done.append
    started_s = time.monotonic()
    for tick in range(ticks):
        due_s = started_s + tick * period_s
        while period_s > 0.0 and (left := due_s - time.monotonic()) > 0.0:
            executor.spin_once(timeout_sec=left)
        sent_s = time.monotonic()
        node.send(outputs, tick)
        while not done or done[-1] < tick:
            executor.spin_once()
        latencies_s.append(time.monotonic() - sent_s)
    wall_s = time.monotonic() - started_s
    latencies_s.sort()
    return {
        "ticks_per_second": ticks / wall_s,
        "latency_p50_ms": 1e3 * latencies_s[len(latencies_s) // 2],
        "latency_p99_ms": 1e3 * latencies_s[int(0.99 * (len(latencies_s) - 1))],
        "latency_max_ms": 1e3 * latencies_s[-1],
    }


def main() -> int:
    """Run one process of the chain."""
    name, ticks, period_s = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
    end_with_parent()
    rclpy.init(args=[])
    try:
        node = BareNode(name)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        while not node.is_matched():
            executor.spin_once(timeout_sec=0.02)
        print("ready", flush=True)
        if name == PLANT:
            sys.stdin.readline()
            print(json.dumps(set_pace(node, executor, ticks, period_s)), flush=True)
        node.create_timer(IDLE_S, lambda: None)  # a wait without bound may miss that it is to end: see IDLE_S
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except RCLError:
        if rclpy.ok():
            raise  # else told to end in the middle of a call into the middleware
    finally:
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    leave(main())
