"""What is asked of the middleware: messages over 127.0.0.1 alone, without shared memory, and foreign nodes find us."""

import os
import signal
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from ac_common.topics import FDI
from bringup.launch.launch import node_arguments
from bringup.launch.node_modules import MODULES
from bringup.launch.processes import FASTDDS_PROFILE, FASTDDS_THIS_HOST, Child, ros_environment, start, stop
from bringup.launch.supervisor import Supervisor
from tests.designs import design_parameters

RANGE, PROFILE, MIDDLEWARE, PEERS = NAMES = (
    "ROS_AUTOMATIC_DISCOVERY_RANGE",
    "FASTRTPS_DEFAULT_PROFILES_FILE",
    "RMW_IMPLEMENTATION",
    "ROS_STATIC_PEERS",
)
THIS_HOST = {RANGE: "SYSTEM_DEFAULT", PROFILE: str(FASTDDS_THIS_HOST)}
SHARED_MEMORY = "/dev/shm/fastrtps"
#: Somebody else's node, which knows nothing of our profiles: has it found ours, and does it use shared memory itself?
FOREIGN = f"""
import rclpy
from rcl_interfaces.srv import ListParameters
rclpy.init()
node = rclpy.create_node("foreign")
client = node.create_client(ListParameters, "/ac/fdi/list_parameters")
assert client.wait_for_service(20.0)
answer = client.call_async(ListParameters.Request())
rclpy.spin_until_future_complete(node, answer, timeout_sec=20.0)
print("design_file" in answer.result().result.names, "{SHARED_MEMORY}" in open("/proc/self/maps").read())
node.destroy_node()
rclpy.shutdown()
"""


@pytest.mark.parametrize(
    ("users", "ours"),
    [
        ({}, THIS_HOST),
        ({RANGE: "LOCALHOST"}, THIS_HOST),
        ({MIDDLEWARE: "rmw_fastrtps_cpp"}, THIS_HOST),
        (THIS_HOST, {}),  # a child of a process that has it already
        ({RANGE: "SUBNET"}, {PROFILE: str(FASTDDS_PROFILE)}),
        ({PROFILE: "my.xml"}, {RANGE: "LOCALHOST"}),
        ({PEERS: "192.0.2.1"}, {RANGE: "LOCALHOST", PROFILE: str(FASTDDS_PROFILE)}),
        ({MIDDLEWARE: "rmw_cyclonedds_cpp"}, {RANGE: "LOCALHOST", PROFILE: str(FASTDDS_PROFILE)}),
    ],
)
def test_what_the_user_has_chosen_is_left_alone(
    users: dict[str, str], ours: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in NAMES:
        monkeypatch.delenv(name, raising=False)
    for name, value in users.items():
        monkeypatch.setenv(name, value)
    wanted = ros_environment()
    assert {name: wanted[name] for name in NAMES if name in wanted} == ours


def test_the_two_profiles_differ_in_where_messages_go_alone() -> None:
    anywhere, this_host = (ET.parse(file).getroot() for file in (FASTDDS_PROFILE, FASTDDS_THIS_HOST))
    space = {"": this_host.tag.partition("}")[0].strip("{")}
    # The same size, said of our own transport there and of the built-in ones here.
    own = this_host.findtext("*/*/receiveBufferSize", None, space)
    assert own == anywhere.findtext("*/*/listenSocketBufferSize", None, space) is not None
    _drop(anywhere, "*/rtps", "listenSocketBufferSize", space)
    for parent, child in ((".", "transport_descriptors"), ("*/rtps", "userTransports")):
        _drop(this_host, parent, child, space)
    _drop(this_host, "*/rtps", "useBuiltinTransports", space)
    _drop(this_host, "*/rtps/builtin", "initialPeersList", space)
    assert _canonical(this_host) == _canonical(anywhere)


def _canonical(root: ET.Element) -> str:
    return ET.canonicalize(ET.tostring(root), strip_text=True)


def _drop(root: ET.Element, parent: str, child: str, space: dict[str, str]) -> None:
    """Remove the one such child, which must be there."""
    (holder,) = [element for element in root.findall(parent, space) if element.find(child, space) is not None]
    found = holder.find(child, space)
    assert found is not None
    holder.remove(found)


def start_fdi(folder: Path) -> Child:
    own = {"autostart": True, **design_parameters(FDI, folder)}
    return start(FDI, node_arguments(MODULES[FDI], FDI, own, folder), folder, ros_environment())


@pytest.mark.ros
def test_node_uses_no_shared_memory_and_foreign_nodes_find_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in NAMES:
        monkeypatch.delenv(name, raising=False)
    strangers = dict(os.environ)  # before ours is in it
    child = start_fdi(tmp_path)
    try:
        with Supervisor({FDI: child}, ros_environment()) as supervisor:
            supervisor.wait_for({FDI: "active"})
        maps = Path(f"/proc/{child.process.pid}/maps").read_text()
        assert SHARED_MEMORY not in maps
        for discovery in ("LOCALHOST", "SUBNET"):
            environment = {**strangers, RANGE: discovery}
            said = subprocess.run(
                [sys.executable, "-c", FOREIGN], env=environment, capture_output=True, text=True, timeout=60, check=True
            ).stdout
            assert said.split() == ["True", "True"], discovery
    finally:
        stop([child])


@pytest.mark.ros
def test_where_a_node_has_shared_memory_it_takes_it_along(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in NAMES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv(RANGE, "SUBNET")
    child = start_fdi(tmp_path)
    try:
        with Supervisor({FDI: child}, ros_environment()) as supervisor:
            supervisor.wait_for({FDI: "active"})
        maps = Path(f"/proc/{child.process.pid}/maps").read_text()
        mapped = {line.split()[-1] for line in maps.splitlines() if SHARED_MEMORY in line}
        own = [Path(file) for file in mapped if "_port" not in file]  # ports are those of others as well
        assert own
        child.process.send_signal(signal.SIGTERM)
        assert child.process.wait(10) == 0
    finally:
        stop([child])
    assert not [file for file in own if file.exists()]
