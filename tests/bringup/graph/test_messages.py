"""Numbers pass bit for bit, bad messages are refused, ticks are matched by stamp, bags read to where they end."""

import json
import math
import struct
from dataclasses import replace
from math import nan
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message

from ac_common.errors import UserError
from ac_common.fdi_status import StatusRow, status_row
from ac_common.topics import BY_NAME, DIAGNOSTICS, TOPICS
from ac_common.wire import columns, messages_of, pack_status, packer, read_diagnostics, stamp_ns
from ac_experiments.bags.reader import decode, read_bag, read_raw
from ac_experiments.bags.recorder import BagWriter, RecordedTopic
from ac_ros_common.messages import BadMessage, message_class, message_reader, reader
from ac_ros_common.messages import stamp_ns as stamp_of_message
from ac_ros_common.tick_sync import MOST_WAITING, TickSet

finite = st.floats(allow_nan=False, allow_infinity=False)
MOST_SERIES = max(len(topic.series) for topic in TOPICS)
scalars_and_joints = st.sampled_from([topic for topic in TOPICS if topic.type != DIAGNOSTICS])


def received(topic, data):
    """The message that a node gets for these bytes."""
    return deserialize_message(data, message_class(topic.type))


@given(
    topic=scalars_and_joints,
    places=st.lists(st.floats(0.0, 1.0), min_size=MOST_SERIES, max_size=MOST_SERIES),
    time_ns=st.integers(0, 2**31 * 10**9 - 1),
)
def test_numbers_pass_bit_for_bit(topic, places, time_ns):
    values = [low + place * (high - low) for place, (low, high) in zip(places, topic.spans, strict=False)]
    data = packer(topic)(time_ns, values)
    message = received(topic, data)
    bits = [struct.pack("<d", value) for value in values]
    assert [struct.pack("<d", value) for value in message_reader(topic)(message)] == bits
    assert stamp_of_message(message) == time_ns
    # What a node takes is serialised: by this loop's own packer, or by the middleware of whoever else publishes.
    for encoded in (data, serialize_message(message)):
        read_ns, read = reader(topic)(encoded)
        assert [struct.pack("<d", value) for value in read] == bits
        assert read_ns == time_ns
    # Bags have their own decoder, and the middleware its own encoder: all agree, but for what padding holds.
    for encoded in (data, serialize_message(message)):
        assert [struct.pack("<d", value) for value in decode(topic.name, encoded).values()] == bits
        assert stamp_ns(encoded) == time_ns
    assert len(serialize_message(message)) == len(data)
    # Many at once are what each is by itself, whoever sent them.
    (many,) = messages_of(topic, np.array([time_ns]), [np.array([value]) for value in values])
    assert many == data + bytes(-len(data) % 4)
    for column, bit in zip(columns(topic, [data, serialize_message(message)]), bits, strict=True):
        assert [struct.pack("<d", value) for value in column] == [bit, bit]


maybe_nan = st.floats(allow_infinity=False)


@given(
    detected=st.booleans(),
    isolated=st.sampled_from([None, "compressor_speed", "evaporator_pressure"]),
    also_isolated=st.sampled_from([None, "compressor_speed", "evaporator_pressure"]),
    unsure=st.sampled_from([None, "compressor_speed", "evaporator_pressure"]),
    size=maybe_nan,
    onset_s=maybe_nan,
    isolated_s=maybe_nan,
    limit=finite,
)
def test_status_passes_bit_for_bit(detected, isolated, also_isolated, unsure, size, onset_s, isolated_s, limit):
    topic = BY_NAME["fdi/status"]
    row = StatusRow(1.5, detected, isolated, size, onset_s, isolated_s, (limit, -limit), also_isolated, unsure)
    data = packer(topic)(1_500_000_000, [row])
    message = received(topic, data)
    assert repr(message_reader(topic)(message)) == repr((row,))
    for encoded in (data, serialize_message(message)):
        assert repr(reader(topic)(encoded)) == repr((1_500_000_000, (row,)))
    assert message.status[0].level == (DiagnosticStatus.WARN if detected else DiagnosticStatus.OK)
    assert repr(status_row(read_diagnostics(serialize_message(message))[0].values, 1.5)) == repr(row)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize(
    "topic", [topic for topic in TOPICS if topic.type != DIAGNOSTICS], ids=lambda topic: topic.name
)
def test_values_that_are_no_numbers_are_refused(topic, bad):
    data = packer(topic)(0, [bad] * len(topic.series))
    for read, message in ((message_reader(topic), received(topic, data)), (reader(topic), data)):
        with pytest.raises(BadMessage, match=topic.name) as refused:
            read(message)
        assert refused.value.reason == "not finite"


@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.name)
@given(data=st.binary(max_size=200), keeps_head=st.booleans())
def test_bytes_that_are_no_message_are_refused(topic, data, keeps_head):
    row = StatusRow(0.0, False, None, 0.0, 0.0, 0.0, (0.0, 0.0))
    good = packer(topic)(0, [row] if topic.type == DIAGNOSTICS else [low for low, _ in topic.spans])
    bad = good[: len(good) // 2] + data[: len(good) // 3] if keeps_head else data[: len(good) // 2]
    with pytest.raises(BadMessage, match=topic.name):
        reader(topic)(bad)


def test_joints_of_someone_else_are_refused():
    topic = BY_NAME["controller/command"]
    message = received(topic, packer(topic)(0, [1.0, 2.0]))
    message.name = ["expansion_valve", "compressor"]
    with pytest.raises(BadMessage, match="expected"):
        message_reader(topic)(message)
    message.name = list(topic.joints)
    message.velocity = []
    with pytest.raises(BadMessage, match="0 values of velocity for 2 joints"):
        message_reader(topic)(message)


def test_status_of_someone_else_is_refused():
    topic = BY_NAME["fdi/status"]
    with pytest.raises(BadMessage, match="empty"):
        message_reader(topic)(DiagnosticArray())
    message = received(topic, packer(topic)(0, [StatusRow(0.0, False, "gremlin", 0.0, 0.0, 0.0, (0.0, 0.0))]))
    with pytest.raises(BadMessage, match="gremlin"):
        message_reader(topic)(message)


PAIR = (BY_NAME["plant/superheat"], BY_NAME["plant/wall_temperature"])


@given(st.permutations([(topic.name, k) for topic in PAIR for k in range(4)]))
def test_ticks_are_matched_whatever_the_order_of_arrival(arrivals):
    tick_set = TickSet(PAIR, act=lambda *_: None)
    complete = [done for name, k in arrivals if (done := tick_set.add(name, k, ((name, k),)))]
    for time_ns, first, second in complete:
        assert first == ("plant/superheat", time_ns)
        assert second == ("plant/wall_temperature", time_ns)
    times = [done[0] for done in complete]
    assert times == sorted(set(times))  # each at most once, never back in time
    assert times[-1] == 3  # the newest tick always completes


def test_foreign_stamps_do_not_pile_up():
    tick_set = TickSet(PAIR, act=lambda *_: None)
    for k in range(10 * MOST_WAITING):
        assert tick_set.add(PAIR[0].name, k, (0.0,)) is None
    assert len(tick_set._waiting) <= MOST_WAITING


@pytest.fixture(scope="module")
def small_bag(tmp_path_factory):
    """A bag of 40 ticks with two topics in it, written chunk by chunk."""
    folder = tmp_path_factory.mktemp("small") / "bag"
    topics = [BY_NAME["plant/evaporator_pressure"], BY_NAME["controller/command"]]
    recorded = [RecordedTopic(f"/ac/{topic.name}", topic.type, 10, 1.0) for topic in topics]
    scenario = {"name": "small", "duration_s": 4.0}
    run = {"scenario": scenario, "mode": "lockstep", "passive": False, "sample_time_s": 0.1, "ticks": 40}
    bag = BagWriter(folder, recorded, run)
    for k in range(40):
        for number, topic in enumerate(topics):
            time_ns = k * 100_000_000
            bag.write(number, packer(topic)(time_ns, [k + 0.5] * len(topic.series)), time_ns, time_ns)
        bag._writer.flush()
    bag.close()
    return folder


def test_small_bag_reads_back(small_bag):
    recording = read_bag(small_bag)
    assert recording.metadata["complete"]
    assert recording.series["plant/evaporator_pressure"].tolist() == [k + 0.5 for k in range(40)]
    assert recording.series["controller/command:expansion_valve"].tolist() == [k + 0.5 for k in range(40)]


def test_what_no_node_can_have_sent_is_left_out_and_counted(tmp_path):
    topics = [BY_NAME["plant/evaporator_pressure"], BY_NAME["fdi/status"], BY_NAME["controller/command"]]
    recorded = [RecordedTopic(f"/ac/{topic.name}", topic.type, 10, 1.0) for topic in topics]
    scenario = {"name": "small", "duration_s": 4.0}
    run = {"scenario": scenario, "mode": "realtime", "passive": False, "sample_time_s": 0.1, "ticks": 40}
    bag = BagWriter(tmp_path / "bag", recorded, run)
    pack = packer(topics[0])
    other_joints = packer(replace(topics[2], joints=("compressor", "evaporator_air")))
    start_ns = 1_000_000_000_000
    for k in range(40):
        bag.write(0, pack(start_ns + k * 100_000_000, [k + 0.5]), k, k)
    for data in (b"", b"\0\1\0\0", pack(start_ns, [1.0])[:20], pack(0, [7.0]), pack(10 * start_ns, [7.0])):
        bag.write(0, data, 0, 0)
    bag.write(1, pack_status(start_ns, StatusRow(0.0, False, None, nan, nan, nan, (1.0, 1.0)))[:-9], 0, 0)
    bag.write(2, other_joints(start_ns, [1.0, 2.0]), 0, 0)
    bag.close()
    recording = read_bag(tmp_path / "bag")
    assert recording.series["plant/evaporator_pressure"].tolist() == [k + 0.5 for k in range(40)]
    assert recording.status == []
    assert np.isnan(recording.series["controller/command:compressor"]).all()
    assert recording.metadata["unreadable"] == 7


def test_flipped_bit_is_noticed(small_bag, tmp_path):
    (file,) = small_bag.glob("*.mcap")
    content = bytearray(file.read_bytes())
    noticed = 0
    for at in range(2000, len(content) - 2000, 997):
        flipped = tmp_path / "flipped.mcap"
        flipped.write_bytes(content[:at] + bytes([content[at] ^ 0x10]) + content[at + 1 :])
        try:
            raw = read_raw(flipped)
        except UserError:
            noticed += 1
            continue
        assert raw.messages == read_raw(small_bag).messages or not raw.complete
    assert noticed > 0


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
@given(share=st.floats(0.0, 1.0))
def test_bag_cut_anywhere_gives_what_was_flushed_before(small_bag, tmp_path, share):
    (file,) = small_bag.glob("*.mcap")
    content = file.read_bytes()
    part = tmp_path / "part.mcap"
    part.write_bytes(content[: int(share * len(content))])
    raw = read_raw(part)
    for messages in raw.messages.values():
        assert [stamp_ns(data) for _, data in messages] == [k * 100_000_000 for k in range(len(messages))]
    if raw.run:
        recording = read_bag(part)
        assert recording.series["plant/evaporator_pressure"].tolist() == [k + 0.5 for k in range(len(recording.time_s))]
    else:
        with pytest.raises(UserError, match="holds no run"):
            read_bag(part)


def test_what_is_no_bag_is_refused(tmp_path: Path):
    with pytest.raises(UserError, match="no such bag"):
        read_bag(tmp_path / "nothing")
    with pytest.raises(UserError, match="no bag in this folder"):
        read_bag(tmp_path)
    (tmp_path / "text.mcap").write_text(json.dumps({"no": "bag"}) * 10)
    with pytest.raises(UserError, match="not a readable MCAP file"):
        read_bag(tmp_path / "text.mcap")
