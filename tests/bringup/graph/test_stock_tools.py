"""What the stock tools of ROS see of a graph, and do with it: logging, parameters, health, references."""

import os
import time
from collections.abc import Callable
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log
from rcl_interfaces.srv import ListParameters
from sensor_msgs.msg import Temperature

from ac_experiments.bags.reader import read_bag, read_raw
from ac_experiments.scenario import load
from ac_ros_common.client_node import client_node
from ac_ros_common.qos import ROSOUT_QOS
from bringup.launch.launch import run_graph
from bringup.launch.processes import ros_environment

pytestmark = pytest.mark.ros


class Stock:
    """A node with nothing but the defaults of rclpy, as `ros2 topic pub` and rqt_console are."""

    def __init__(self, node: Any, executor: Any) -> None:
        self.node, self._executor = node, executor
        self.logged: list[Log] = []
        node.create_subscription(Log, "/rosout", self.logged.append, ROSOUT_QOS)
        self._reference = node.create_publisher(Temperature, "/ac/scenario/reference/superheat", 10)
        self._stranger = node.create_publisher(Temperature, "/ac/reference/superheat", 10)
        self._parameters = node.create_client(ListParameters, "/ac/bringup/list_parameters")
        self.answer: Any = None

    def at(self, done: int) -> None:
        """Do what is due at a tick."""
        if done >= 20 and self.answer is None:
            assert self._parameters.service_is_ready()
            self.answer = self._parameters.call_async(ListParameters.Request())
            self._reference.publish(Temperature(temperature=18.0))
            self._reference.publish(Temperature(temperature=500.0))  # refused
            self._stranger.publish(Temperature(temperature=18.0))
        self.spin(lambda: False, 0.05)

    def spin(self, until: Callable[[], bool], patience_s: float) -> None:
        end_s = time.monotonic() + patience_s
        while not until() and time.monotonic() < end_s:
            self._executor.spin_once(timeout_sec=0.02)


@pytest.mark.clock
def test_a_stock_publisher_sets_a_reference_and_stock_tools_see_the_rest(
    tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in ros_environment().items():
        monkeypatch.setitem(os.environ, name, value)
    told: list[str] = []
    with client_node("stock") as (node, executor):
        stock = Stock(node, executor)
        scenario = load("nominal", ["duration_s=9"])
        run = run_graph(scenario, tmp_path, mode="realtime", progress=lambda done, _: stock.at(done), say=told.append)
    assert stock.answer.done()  # /ac/bringup has parameter services, and is there to answer
    recording = read_bag(run.bag)
    reference = recording.series["reference/superheat"]
    assert reference[10] == pytest.approx(20.0)
    assert reference[-1] == pytest.approx(18.0)
    said = {(line.name, line.msg) for line in stock.logged}
    assert any(name == "ac.scenario" and "500" in text for name, text in said), said
    hint = "/ac/reference/superheat: second publisher /stock, which nobody follows; a reference of yours goes to "
    assert ("ac.bringup", hint + "/ac/scenario/reference/superheat") in said
    assert hint + "/ac/scenario/reference/superheat" in told


def test_health_of_a_lockstep_run_has_the_nodes_clock_and_a_hardware_id(run: Any) -> None:
    from rclpy.serialization import deserialize_message

    messages = [deserialize_message(data, DiagnosticArray) for _, data in read_raw(run.bag).messages["/diagnostics"]]
    assert len(messages) > 10
    assert {status.hardware_id for message in messages for status in message.status} == {os.uname().nodename}
    times = [message.header.stamp.sec + message.header.stamp.nanosec / 1e9 for message in messages]
    assert 0.0 <= min(times) < max(times) <= 12.0  # the run's, not the wall clock's
