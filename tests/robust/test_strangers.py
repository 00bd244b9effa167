"""Someone else publishes on the loop's topics: it is noticed, reported and, where it can be told apart, left alone."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mischief import Mischief

from bringup.bags.reader import health_reports, read_bag, read_raw
from bringup.ros.graph import run_graph
from bringup.ros.processes import ros_environment
from bringup.scenario import load

pytestmark = pytest.mark.ros

#: Publishes commands of a full-speed compressor with the right stamps, and text where pressures belong.
INTRUDER = """
import os, time
import rclpy
from bringup.ros.cdr import packer, stamp_ns
from bringup.ros.node_shell import LOOP_QOS, PLAIN_QOS
from bringup.topics import BY_NAME
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import String
rclpy.init(args=[])
node = rclpy.create_node("intruder", namespace="/ac")
command = node.create_publisher(JointState, "controller/command", LOOP_QOS)
words = node.create_publisher(String, "measured/evaporator_pressure", PLAIN_QOS)
pack = packer(BY_NAME["controller/command"])
def heard(data):
    command.publish(pack(stamp_ns(data), [600.0, 1.0]))
    words.publish(String(data="p_e is fine"))
node.create_subscription(FluidPressure, "plant/evaporator_pressure", heard, LOOP_QOS, raw=True)
until = time.monotonic() + 4.0
while time.monotonic() < until:
    rclpy.spin_once(node, timeout_sec=0.05)
"""


def test_second_publisher_is_reported_and_its_commands_are_left_alone(tmp_path: Path) -> None:
    begun: list[subprocess.Popen[bytes]] = []

    def intrude() -> None:
        begun.append(subprocess.Popen([sys.executable, "-c", INTRUDER], env=_environment()))

    try:
        run = run_graph(
            load("nominal", ["duration_s=11"]), tmp_path, mode="realtime", progress=Mischief([(10, intrude)])
        )
    finally:
        for process in begun:
            process.wait(20)
    raw = read_raw(run.bag)
    reports = list(health_reports(raw))
    said = " ".join(values["strangers"] for name, values in reports if name == "bringup")
    assert "foreign node /ac/intruder" in said
    assert "/ac/controller/command: second publisher /ac/intruder" in said
    assert "has type std_msgs/msg/String instead of sensor_msgs/msg/FluidPressure" in said
    (injector,) = [values for name, values in reports if name == "fault_injector"][-1:]
    assert int(injector["rejected/stranger"]) > 5
    actuator = read_bag(run.bag).series["actuator/command:compressor"]
    assert np.nanmax(actuator) < 200.0  # never the intruder's 600 rad/s


def _environment() -> dict[str, str]:
    return {**os.environ, **ros_environment()}
