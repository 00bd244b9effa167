"""What the graph audit asks of the middleware."""

import os
import time
from collections.abc import Callable

import pytest
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import FluidPressure, JointState, Temperature

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


def test_a_bench_is_known_by_its_topics_and_what_does_not_fit_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in ros_environment().items():
        monkeypatch.setitem(os.environ, name, value)
    with client_node("bringup", NAMESPACE) as (node, _), client_node("my_bench", "/lab") as (bench, _):
        audit = GraphAudit(node, ("ac_plant",), ("ac_plant",), Reports())
        nothing = audit.lacking("ac_plant")
        assert "/ac/plant/superheat: no publisher (sensor_msgs/msg/Temperature, reliable)" in nothing
        assert "/ac/actuator/command: no subscription (sensor_msgs/msg/JointState)" in nothing
        bench.create_subscription(JointState, "/ac/actuator/command", print, 10)
        bench.create_publisher(FluidPressure, "/ac/plant/evaporator_pressure", 10)
        bench.create_publisher(FluidPressure, "/ac/plant/condenser_pressure", 10)
        bench.create_publisher(JointState, "/ac/plant/superheat", 10)
        bench.create_publisher(Temperature, "/ac/plant/air_inlet_temperature", 10)
        bench.create_publisher(Temperature, "/ac/plant/condenser_air_inlet_temperature", 10)
        bench.create_publisher(Temperature, "/ac/plant/wall_temperature", qos_profile_sensor_data)
        wrong = [
            "/ac/plant/superheat: /lab/my_bench has type sensor_msgs/msg/JointState instead of "
            "sensor_msgs/msg/Temperature",
            "/ac/plant/wall_temperature: /lab/my_bench offers best effort; the loop wants reliable",
        ]
        until(lambda: audit.lacking("ac_plant") == wrong)
        assert not [line for line in audit.unexpected(()) if "second publisher" in line]


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
        until(lambda: "/ac/controller/command: second publisher /ac/intruder" in audit.unexpected(()))
