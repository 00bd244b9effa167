"""What the graph audit asks of the middleware."""

import os
import time
from collections.abc import Callable

import pytest
from sensor_msgs.msg import JointState

from ac_common.topics import NAMESPACE
from ac_ros_common.client_node import client_node
from bringup.launch.graph_audit import GraphAudit
from bringup.launch.processes import ros_environment
from bringup.launch.reports import Reports

pytestmark = pytest.mark.ros


def until(condition: Callable[[], bool], patience_s: float = 20.0) -> None:
    deadline = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)  # the graph gives no event that rclpy tells of


def test_a_second_publisher_changes_what_is_seen_and_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in ros_environment().items():
        monkeypatch.setitem(os.environ, name, value)
    with client_node("bringup", NAMESPACE) as (node, _), client_node("intruder", NAMESPACE) as (intruder, _):
        audit = GraphAudit(node, (), (), Reports())
        until(lambda: "foreign node /ac/intruder" in audit.unexpected(()))
        audit.has_changed()
        assert not audit.has_changed()
        intruder.create_publisher(JointState, "controller/command", 10)
        until(audit.has_changed)
        assert not audit.has_changed()
        assert "/ac/controller/command: second publisher /ac/intruder" in audit.unexpected(())
