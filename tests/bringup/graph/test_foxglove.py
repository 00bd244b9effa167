"""`acftc foxglove`, seen by a client of Foxglove's WebSocket protocol that is not Foxglove's."""

import asyncio
import json
import os
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator

import pytest
from sensor_msgs.msg import Temperature
from tornado.httpclient import HTTPRequest
from tornado.websocket import WebSocketClientConnection, websocket_connect

from ac_common.topics import BY_NAME
from ac_common.wire import packer
from ac_experiments.bags.reader import decode
from ac_ros_common.client_node import client_node
from ac_ros_common.qos import LOOP_QOS
from ac_ros_common.type_definitions import definition
from bringup.commands.foxglove_bridge import PASSED_ON
from bringup.launch.processes import ros_environment

pytestmark = pytest.mark.ros

#: Opcode, subscription and time of a message on the wire.
HEAD = struct.Struct("<BIQ")


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return int(listener.getsockname()[1])


@pytest.fixture
def port() -> Iterator[int]:
    """Port of a bridge that is being served."""
    number = free_port()
    command = [sys.executable, "-m", "bringup.cli", "foxglove", "--port", str(number)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert f"ws://127.0.0.1:{number}" in process.stderr.readline()
        yield number
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=30)
    assert (process.returncode, said) == (0, "")


async def until(connection: WebSocketClientConnection, op: str) -> dict:
    while True:
        message = await connection.read_message()
        if isinstance(message, str) and json.loads(message)["op"] == op:
            return dict(json.loads(message))


async def heard(port: int, publish: Callable[[], None]) -> tuple[dict, bytes]:
    """Description of the superheat's channel, and the first message in it."""
    request = HTTPRequest(f"ws://127.0.0.1:{port}")
    connection = await websocket_connect(request, subprotocols=["foxglove.sdk.v1"])
    channels: dict[str, dict] = {}
    while set(channels) != set(PASSED_ON):
        for channel in (await until(connection, "advertise"))["channels"]:
            channels[channel["topic"]] = channel
    channel = channels["/ac/plant/superheat"]
    await connection.write_message(
        json.dumps({"op": "subscribe", "subscriptions": [{"id": 7, "channelId": channel["id"]}]})
    )
    while True:
        publish()
        try:
            message = await asyncio.wait_for(connection.read_message(), 0.2)
        except TimeoutError:
            continue
        if isinstance(message, bytes) and HEAD.unpack_from(message)[:2] == (1, 7):
            connection.close()
            return channel, message[HEAD.size :]


def test_a_client_gets_the_loops_messages_as_they_came(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in ros_environment().items():
        monkeypatch.setitem(os.environ, name, value)
    topic = BY_NAME["plant/superheat"]
    sent = packer(topic)(1_500_000_000, [19.5])
    with client_node("ac_plant", "/ac") as (node, _):
        publisher = node.create_publisher(Temperature, topic.name, LOOP_QOS)
        channel, data = asyncio.run(asyncio.wait_for(heard(port, lambda: publisher.publish(sent)), 60))
    assert (channel["encoding"], channel["schemaName"]) == ("cdr", "sensor_msgs/msg/Temperature")
    assert (channel["schemaEncoding"], channel["schema"]) == ("ros2msg", definition(topic.type))
    assert data == sent
    assert decode(topic.name, data) == {"plant/superheat": 19.5}


def test_an_address_that_is_taken_is_one_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        taken = str(listener.getsockname()[1])
        command = [sys.executable, "-m", "bringup.cli", "foxglove", "--port", taken]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert f"--port {taken}: cannot be had: Address already in use" in line
