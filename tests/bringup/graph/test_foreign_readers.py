"""Bags as others see them: Foxglove's decoder reads every message, and a plain player puts them back on the wire."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rclpy
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosbags.highlevel import AnyReader

from ac_common.topics import BY_NAME, NAMESPACE, TICKED
from ac_common.yaml_file import parsed
from ac_experiments.bags.reader import read_bag, read_raw
from ac_ros_common.messages import message_class
from ac_ros_common.qos import LOOP_QOS
from bringup.launch.launch import GraphRun

pytestmark = pytest.mark.ros

PLAYED = ("plant/superheat", "controller/command", "fdi/status")


def test_foxgloves_decoder_reads_every_message(run: GraphRun) -> None:
    """`mcap_ros2` builds its types from the definitions in the file, as Foxglove does; it knows nothing of ROS."""
    recording = read_bag(run.bag)
    (file,) = run.bag.glob("*.mcap")
    counts: dict[str, int] = {}
    speeds, pressures = [], []
    with file.open("rb") as stream:
        for _, channel, _, message in make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
            if channel.topic == f"{NAMESPACE}/controller/command":
                speeds.append(message.velocity[0])
            elif channel.topic == f"{NAMESPACE}/measured/evaporator_pressure":
                pressures.append(message.fluid_pressure)
    assert {topic.name: counts[f"{NAMESPACE}/{topic.name}"] for topic in TICKED} == {t.name: run.ticks for t in TICKED}
    np.testing.assert_array_equal(speeds, recording.series["controller/command:compressor"])
    np.testing.assert_array_equal(pressures, recording.series["measured/evaporator_pressure"])


def offered_qos(bag: Path, topic: str) -> QoSProfile:
    """QoS with which `ros2 bag play` would publish a topic: what the bag's metadata says was offered."""
    content = parsed((bag / "metadata.yaml").read_text(), "metadata")["rosbag2_bagfile_information"]
    (found,) = (
        entry["topic_metadata"]
        for entry in content["topics_with_message_count"]
        if entry["topic_metadata"]["name"] == topic
    )
    (qos,) = found["offered_qos_profiles"]
    return QoSProfile(
        history=HistoryPolicy.get_from_short_key(qos["history"]),
        depth=qos["depth"],
        reliability=ReliabilityPolicy.get_from_short_key(qos["reliability"]),
        durability=DurabilityPolicy.get_from_short_key(qos["durability"]),
        deadline=Duration(seconds=qos["deadline"]["sec"], nanoseconds=qos["deadline"]["nsec"]),
    )


def messages_by_time(bag: Path) -> Iterator[tuple[str, bytes]]:
    """Topic and bytes of what is played, in the order of the log, read by a foreign library."""
    wanted = [f"{NAMESPACE}/{name}" for name in PLAYED]
    with AnyReader([bag]) as reader:
        for connection, _, data in reader.messages(connections=[c for c in reader.connections if c.topic in wanted]):
            yield connection.topic, bytes(data)


def test_a_plain_player_puts_the_recorded_messages_back_on_the_wire(run: GraphRun) -> None:
    """What `ros2 bag play` does, done with `rosbags` and rclpy: a reader with the loop's own QoS gets every byte."""
    context = rclpy.Context()
    rclpy.init(context=context, args=[])
    executor = SingleThreadedExecutor(context=context)
    node = rclpy.create_node("player", context=context)
    executor.add_node(node)
    try:
        heard: dict[str, list[bytes]] = {f"{NAMESPACE}/{name}": [] for name in PLAYED}
        publishers = {}
        for name in PLAYED:
            topic, type_ = f"{NAMESPACE}/{name}", message_class(BY_NAME[name].type)
            publishers[topic] = node.create_publisher(type_, topic, offered_qos(run.bag, topic))
            node.create_subscription(type_, topic, heard[topic].append, LOOP_QOS, raw=True)
        while not all(publisher.get_subscription_count() for publisher in publishers.values()):
            executor.spin_once(timeout_sec=0.1)
        for played, (topic, data) in enumerate(messages_by_time(run.bag), start=1):
            publishers[topic].publish(data)
            while sum(map(len, heard.values())) < played:
                executor.spin_once(timeout_sec=1.0)
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()
    raw = read_raw(run.bag)
    for topic, found in heard.items():
        assert found == [data for _, data in raw.messages[topic]], topic
