"""The real controller gets messages that are missing, broken, late, double, in another unit or frozen."""

import math
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.node import Publisher

from ac_common.topics import BY_NAME, CONTROLLER, NAMESPACE
from ac_common.wire import packer, stamp_ns
from ac_experiments.bags.reader import decode
from ac_ros_common.messages import message_class
from ac_ros_common.qos import LOOP_QOS
from ac_ros_common.stuck_sensor import STUCK_S, StuckSensor
from bringup.launch.node_parameters import node_arguments
from bringup.launch.processes import ros_environment, start, stop
from bringup.launch.supervisor import Supervisor
from tests.design_files import design_parameters

P_E, SUPERHEAT, Q = "measured/evaporator_pressure", "measured/superheat", "compensator/q"
VALUES = {
    "reference/evaporator_pressure": [251.2e3],
    "reference/superheat": [20.0],
    P_E: [251.2e3],
    SUPERHEAT: [20.0],
    Q: [0.0, 0.0],
}
PERIOD_S = 0.1
#: How long the answer to a tick is waited for.
ANSWER_S = 2.0


class Surroundings:
    """All that is around the controller: sends a tick's messages, every 100 ms, and keeps its commands and health."""

    def __init__(self, supervisor: Supervisor) -> None:
        self._supervisor = supervisor
        node = supervisor.node
        self._publishers: dict[str, Publisher] = {
            name: node.create_publisher(message_class(BY_NAME[name].type), f"{NAMESPACE}/{name}", LOOP_QOS)
            for name in VALUES
        }
        command = BY_NAME["controller/command"]
        node.create_subscription(
            message_class(command.type), f"{NAMESPACE}/{command.name}", self._commanded, LOOP_QOS, raw=True
        )
        self.commands: list[tuple[int, dict[str, float]]] = []
        self._start_ns, self._start_s, self._tick = time.time_ns(), time.monotonic(), 0

    def _commanded(self, data: bytes) -> None:
        self.commands.append((stamp_ns(data), decode("controller/command", data)))

    def is_matched(self) -> bool:
        return all(publisher.get_subscription_count() > 0 for publisher in self._publishers.values())

    def publish(self, name: str, message: Any) -> None:
        self._publishers[name].publish(message)

    def packed(self, name: str, values: list[float] | None = None, ticks_ago: int = 0) -> bytes:
        stamp = self._start_ns + (self._tick - ticks_ago) * int(PERIOD_S * 1e9)
        return packer(BY_NAME[name])(stamp, values or VALUES[name])

    def tick(self, spoil: Callable[[str], list[Any]] | None = None, n: int = 1) -> list[dict[str, float]]:
        """Play `n` ticks; `spoil` gives the messages of a topic in place of the good one. The commands that came."""
        first = len(self.commands)
        for _ in range(n):
            for name in VALUES:
                for message in [self.packed(name)] if spoil is None else spoil(name):
                    self.publish(name, message)
            stamp = self._start_ns + self._tick * int(PERIOD_S * 1e9)
            late_s = time.monotonic() + ANSWER_S
            while (not self.commands or self.commands[-1][0] < stamp) and time.monotonic() < late_s:
                self._supervisor._executor.spin_once(timeout_sec=PERIOD_S)  # however late this process is
            self._tick += 1
            while (left := self._start_s + self._tick * PERIOD_S - time.monotonic()) > 0:
                self._supervisor._executor.spin_once(timeout_sec=left)
        return [command for _, command in self.commands[first:]]

    def health(self) -> dict[str, str]:
        """The next health report."""
        self._supervisor.health.pop(CONTROLLER, None)
        while CONTROLLER not in self._supervisor.health:
            self.tick()
        return self._supervisor.health[CONTROLLER]


@pytest.fixture(scope="module")
def loop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Surroundings]:
    folder = tmp_path_factory.mktemp("alone")
    arguments = node_arguments(CONTROLLER, {"mode": "realtime", **design_parameters(CONTROLLER, folder)}, folder)
    child = start(CONTROLLER, arguments, folder, ros_environment())
    try:
        with Supervisor({CONTROLLER: child}, ros_environment()) as supervisor:
            around = Surroundings(supervisor)
            supervisor.connect([CONTROLLER], around.is_matched)
            supervisor.activate([CONTROLLER])
            around._start_ns, around._start_s = time.time_ns(), time.monotonic()
            around.tick(n=3)
            yield around
    finally:
        stop([child])


def in_place_of(name: str, *messages: Any, loop: Surroundings) -> Callable[[str], list[Any]]:
    return lambda topic: list(messages) if topic == name else [loop.packed(topic)]


def changed(topic: str, fields: dict[str, Any]) -> Any:
    """A message of our own that is not what it should be; the stamp is put in when it is sent."""
    message = message_class(BY_NAME[topic].type)()
    for field, value in fields.items():
        setattr(message, field, value)
    return message


def stamped(loop: Surroundings, message: Any) -> Any:
    stamp = loop._start_ns + loop._tick * int(PERIOD_S * 1e9)
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
    return message


JOINTS = {"name": ["compressor", "expansion_valve"], "velocity": [0.0, math.nan], "position": [math.nan, 0.0]}


BROKEN: list[tuple[str, dict[str, Any], str]] = [
    (P_E, {"fluid_pressure": math.nan}, "not finite"),
    (P_E, {"fluid_pressure": math.inf}, "not finite"),
    (P_E, {"fluid_pressure": 251.2}, "out of range"),  # kPa
    (P_E, {"fluid_pressure": 1e9}, "out of range"),
    (SUPERHEAT, {"temperature": 293.15}, "out of range"),  # K in place of a difference
    (Q, {**JOINTS, "velocity": [1000.0, math.nan]}, "out of range"),  # rpm
    (Q, {**JOINTS, "position": [math.nan, 40.0]}, "out of range"),  # per cent
    (Q, {**JOINTS, "name": ["expansion_valve", "compressor"]}, "names"),
    (Q, {**JOINTS, "velocity": [0.0]}, "length"),
    (Q, {**JOINTS, "velocity": [0.0, 0.0, 0.0]}, "length"),
]


@pytest.mark.ros
@pytest.mark.clock
def test_broken_messages_are_refused_each_with_its_reason_and_the_loop_goes_on(loop: Surroundings) -> None:
    commands = []
    for name, fields, _ in BROKEN:
        broken = changed(name, fields)
        commands += loop.tick(
            lambda topic, name=name, broken=broken: [stamped(loop, broken) if topic == name else loop.packed(topic)]
        )
        commands += loop.tick()
    assert len(commands) >= 2 * len(BROKEN) - 1
    for command in commands:
        assert all(math.isfinite(value) for value in command.values())
    health = loop.health()
    for reason in {reason for _, _, reason in BROKEN}:
        assert int(health[f"rejected/{reason}"]) == sum(why == reason for _, _, why in BROKEN)
    assert "3 values of velocity for 2 joints" in health["last_rejected"]


@pytest.mark.ros
@pytest.mark.clock
def test_bytes_that_are_no_message_are_refused_and_the_loop_goes_on(loop: Surroundings) -> None:
    before = loop.health()
    commands = []
    for name in (P_E, Q):
        commands += loop.tick(in_place_of(name, loop.packed(name)[:32], loop=loop)) + loop.tick(n=2)
    assert len(commands) >= 5
    health = loop.health()
    assert int(health["rejected/malformed"]) == int(before.get("rejected/malformed", 0)) + 2
    assert health["last_rejected"] == "compensator/q: 32 bytes that are no sensor_msgs/msg/JointState"


@pytest.mark.ros
@pytest.mark.clock
def test_missing_double_and_late_messages_are_counted_and_do_no_harm(loop: Surroundings) -> None:
    before = loop.health()
    calm = loop.tick(n=2)[-1]
    commands = loop.tick(in_place_of(SUPERHEAT, loop=loop))  # missing
    commands += loop.tick(lambda topic: [loop.packed(topic)] * 2)  # double
    commands += loop.tick(lambda topic: [loop.packed(topic), loop.packed(topic, ticks_ago=1)])  # and an old one again
    commands += loop.tick(lambda topic: [loop.packed(topic), loop.packed(topic, ticks_ago=40)])  # and a stale one
    assert len(commands) >= 4
    for command in commands:
        assert command == pytest.approx(calm, rel=1e-3)
    after = loop.health()

    def grown(key: str) -> int:
        return int(after.get(key, "0")) - int(before.get(key, "0"))

    assert grown("missing/measured/superheat") >= 1
    assert grown("late_inputs") + grown("duplicate_inputs") >= 2 * len(VALUES) - 2
    assert grown("rejected/stale") == len(VALUES)


@pytest.mark.ros
@pytest.mark.clock
def test_measurement_that_stays_away_is_held_then_the_safe_command_is_sent(loop: Surroundings) -> None:
    loop.tick(n=3)
    commands = loop.tick(in_place_of(P_E, loop=loop), n=12)
    assert len(commands) >= 10
    assert loop.health()["state"] == "active"
    assert all(math.isfinite(value) for command in commands for value in command.values())
    assert "no measurement: going to the safe command" in _announced(loop)


@pytest.mark.ros
@pytest.mark.clock
def test_frozen_measurement_counts_as_missing(loop: Surroundings) -> None:
    def sticking(topic: str) -> list[Any]:
        moving = [20.0 + 0.1 * (loop._tick % 10)]
        return [loop.packed(topic, moving if topic == SUPERHEAT else None)]

    loop.tick(sticking, n=round(STUCK_S / PERIOD_S) + 8)
    assert int(loop.health()["rejected/frozen"]) > 0
    assert f"{P_E}: has stood still" in loop.health()["last_rejected"]


def _announced(loop: Surroundings) -> str:
    return loop._supervisor._children[CONTROLLER].log.read_text()


def test_at_rest_nothing_is_frozen_and_while_all_moves_neither():
    watch = StuckSensor((P_E, SUPERHEAT))
    assert not any(watch.which(0.1 * k, [251.2e3, 20.0]) for k in range(100))
    watch = StuckSensor((P_E, SUPERHEAT))
    assert not any(watch.which(0.1 * k, [251.2e3 + k, 20.0 + 0.01 * k]) for k in range(100))


@given(st.lists(st.floats(-100.0, 100.0), min_size=30, max_size=60), st.integers(0, 5))
def test_frozen_is_told_only_after_its_time_and_only_while_others_moved(walk, frozen_from):
    watch = StuckSensor((P_E, SUPERHEAT))
    for k, step in enumerate(np.cumsum(walk)):
        pressure = 251.2e3 if k >= frozen_from else 251.2e3 + 1.0 + k
        told = watch.which(0.1 * k, [pressure, 20.0 + step])
        if told == P_E:
            assert 0.1 * (k - frozen_from) >= STUCK_S - 1e-9
