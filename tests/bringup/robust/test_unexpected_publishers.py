"""Someone else publishes on the loop's topics: it is noticed, reported and, where it can be told apart, left alone."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mischief import Mischief

from ac_experiments.bags.reader import health_reports, read_bag, read_raw
from ac_experiments.scenario import load
from bringup.launch.launch import run_graph
from bringup.launch.processes import ros_environment

pytestmark = [pytest.mark.ros, pytest.mark.clock]

#: Publishes commands of a full-speed compressor with the right stamps, text where pressures belong, and temperatures
#: that claim to be of another version of their type: the hash that the middleware announces is changed in memory.
INTRUDER = """
import ctypes, os, time
import rclpy
from ac_common.wire import packer, stamp_ns
from ac_ros_common.qos import LOOP_QOS, PLAIN_QOS
from ac_common.topics import BY_NAME
from sensor_msgs.msg import FluidPressure, JointState, Temperature
from std_msgs.msg import String

class TypeSupport(ctypes.Structure):  # rosidl_message_type_support_t
    _fields_ = [(name, ctypes.c_void_p) for name in ("identifier", "data", "func", "get_type_hash", "text", "sources")]

def claim_another_version(message):
    message.__class__.__import_type_support__()
    capsule = message.__class__._TYPE_SUPPORT
    api = ctypes.pythonapi
    api.PyCapsule_GetName.restype, api.PyCapsule_GetName.argtypes = ctypes.c_char_p, [ctypes.py_object]
    api.PyCapsule_GetPointer.restype = ctypes.c_void_p
    api.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    generic = api.PyCapsule_GetPointer(capsule, api.PyCapsule_GetName(capsule))
    find = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p)(TypeSupport.from_address(generic).func)
    special = find(generic, b"rosidl_typesupport_fastrtps_c")
    kept = (ctypes.c_uint8 * 33)(1, *range(32))
    function = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p)(lambda _: ctypes.addressof(kept))
    for address in (generic, special):
        TypeSupport.from_address(address).get_type_hash = ctypes.cast(function, ctypes.c_void_p).value
    return function

function = claim_another_version(Temperature)
rclpy.init(args=[])
node = rclpy.create_node("intruder", namespace="/ac")
command = node.create_publisher(JointState, "controller/command", LOOP_QOS)
words = node.create_publisher(String, "measured/evaporator_pressure", PLAIN_QOS)
temperature = node.create_publisher(Temperature, "measured/superheat", LOOP_QOS)
pack = packer(BY_NAME["controller/command"])
def heard(data):
    command.publish(pack(stamp_ns(data), [600.0, 1.0]))
    words.publish(String(data="p_e is fine"))
node.create_subscription(FluidPressure, "plant/evaporator_pressure", heard, LOOP_QOS, raw=True)
until = time.monotonic() + 4.0
while time.monotonic() < until:
    rclpy.spin_once(node, timeout_sec=0.05)
node.destroy_node()
rclpy.shutdown()
"""


def test_second_publisher_is_reported_and_its_commands_are_left_alone(tmp_path: Path) -> None:
    begun: list[subprocess.Popen[bytes]] = []

    def intrude() -> None:
        begun.append(subprocess.Popen([sys.executable, "-c", INTRUDER], env=_environment()))

    try:
        scenario, mischief = load("nominal", ["duration_s=13"]), Mischief([(10, intrude)])
        run = run_graph(scenario, tmp_path, mode="realtime", care=True, progress=mischief, say=mischief.say)
    finally:
        for process in begun:
            process.wait(20)
    raw = read_raw(run.bag)
    reports = list(health_reports(raw))
    said = " ".join(values["strangers"] for name, values in reports if name == "bringup")
    assert "foreign node /ac/intruder" in said
    assert "/ac/controller/command: second publisher /ac/intruder" in said
    assert "/ac/measured/superheat: /ac/intruder has another version of sensor_msgs/msg/Temperature" in said
    assert mischief.said.count("foreign node /ac/intruder") == 1  # the user is told, once
    assert "has type std_msgs/msg/String instead of sensor_msgs/msg/FluidPressure" in said
    (injector,) = [values for name, values in reports if name == "fault_injector"][-1:]
    assert int(injector["rejected/stranger"]) > 5
    actuator = read_bag(run.bag).series["actuator/command:compressor"]
    assert np.nanmax(actuator) < 200.0  # never the intruder's 600 rad/s


def _environment() -> dict[str, str]:
    return {**os.environ, **ros_environment()}
