"""The running loop's messages, as they come over DDS, to whoever connects by Foxglove's WebSocket protocol."""

import os
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ac_common.errors import UserError
from ac_common.topics import CLOCK, DIAGNOSTICS, NAMESPACE, OCCASIONAL, TOPICS
from ac_ros_common.client_node import client_node
from ac_ros_common.inputs import Arrival, Gate, Subscriptions
from ac_ros_common.messages import message_class
from ac_ros_common.qos import PLAIN_QOS
from ac_ros_common.type_definitions import definition
from bringup.launch.processes import ros_environment

#: The name of the node that listens.
NAME = "acftc_foxglove"
#: Name and type of what is passed on.
PASSED_ON: dict[str, str] = {
    **{f"{NAMESPACE}/{topic.name}": topic.type for topic in (*TOPICS, *OCCASIONAL)},
    "/diagnostics": DIAGNOSTICS,
    "/clock": CLOCK,
    "/rosout": "rcl_interfaces/msg/Log",
}
#: How long the bridge waits for a message before it looks after services and signals, s.
IDLE_S = 0.1


class Bridge:
    """Passes on what arrives; `serve` does so until it is interrupted."""

    def __init__(self, node: Any, executor: Any, server: Any) -> None:
        import foxglove

        self.server = server
        self._executor = executor
        self._channels = []
        self._subscriptions = Subscriptions(node.context, self._pass_on)
        for name, type_ in PASSED_ON.items():
            schema = foxglove.Schema(name=type_, encoding="ros2msg", data=definition(type_).encode())
            self._channels.append(foxglove.Channel(name, schema=schema, message_encoding="cdr"))
            group = Gate(is_open=False)  # the executor leaves it alone
            kind = message_class(type_)
            self._subscriptions.add(
                node.create_subscription(kind, name, lambda _: None, PLAIN_QOS, callback_group=group)
            )

    def serve(self, until_s: float = float("inf")) -> None:
        """Pass messages on."""
        while time.monotonic() < until_s:
            self._subscriptions.wait(IDLE_S)
            self._executor.spin_once(timeout_sec=0.0)

    def _pass_on(self, messages: list[Arrival]) -> bool:
        now_ns = time.time_ns()
        for number, data, _ in messages:
            self._channels[number].log(data, log_time=now_ns)
        return False


@contextmanager
def bridge(host: str, port: int) -> Iterator[Bridge]:
    """Give a bridge that listens at an address; the graph is that of ROS_DOMAIN_ID.

    Raises
    ------
    UserError
        When the address cannot be had.
    """
    import foxglove

    _check_free(host, port)
    foxglove.set_log_level("ERROR")
    os.environ.update(ros_environment())
    with client_node(NAME) as (node, executor):
        server = foxglove.start_server(name="acftc", host=host, port=port)
        try:
            yield Bridge(node, executor, server)
        finally:
            server.stop()


def _check_free(host: str, port: int) -> None:
    try:
        with socket.create_server((host, port)):
            pass
    except (OSError, OverflowError) as problem:
        reason = getattr(problem, "strerror", None) or problem
        raise UserError(f"--host {host} --port {port}: cannot be had: {reason}") from None
