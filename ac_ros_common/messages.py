"""Incoming messages: their class, their stamp, and the check that a node may act on them."""

import math
from collections.abc import Callable
from importlib import import_module
from typing import Any

from rclpy.serialization import deserialize_message

from ac_common.fdi_status import status_row
from ac_common.topics import DIAGNOSTICS, JOINT_FIELD, JOINTS, SCALARS, TEMPERATURE, Topic
from ac_common.wire import NANOSECONDS, read_diagnostics, unpacker
from ac_common.wire import stamp_ns as serialised_stamp_ns

Values = tuple[Any, ...]
#: Stamp in ns and values of a serialised message.
Reader = Callable[[bytes], tuple[int, Values]]


class BadMessage(ValueError):  # noqa: N818  (reads as what it is: a message, and a bad one)
    """A message that a node must not act on; the text says what is wrong with it, `reason` in a word."""

    def __init__(self, text: str, reason: str = "malformed") -> None:
        super().__init__(text)
        self.reason = reason


def message_class(type_name: str) -> Any:
    """Return the class of a message type such as ``sensor_msgs/msg/Temperature``."""
    package, _, name = type_name.split("/")
    return getattr(import_module(f"{package}.msg"), name)


def stamp_ns(message: Any) -> int:
    """Time of the tick that `message` belongs to, in nanoseconds."""
    stamp = message.header.stamp
    return int(stamp.sec * NANOSECONDS + stamp.nanosec)


def reader(topic: Topic) -> Reader:
    """Return the function that turns a serialised message of `topic` into its stamp in ns and its values.

    A message that is laid out as this loop's own are is read here, in a sixth of the time that the middleware takes.
    The function raises `BadMessage` for one that must not be acted upon.
    """
    check, kind = message_reader(topic), message_class(topic.type)

    def read_any(data: bytes) -> tuple[int, Values]:
        try:
            message = deserialize_message(data, kind)
        except Exception as problem:  # RMWError, but also what a text that is no UTF-8 raises
            msg = f"{topic.name}: {len(data)} bytes that are no {topic.type}"
            raise BadMessage(msg) from problem
        return stamp_ns(message), check(message)

    if topic.type == DIAGNOSTICS:

        def read_status(data: bytes) -> tuple[int, Values]:
            try:
                first = read_diagnostics(data)[0]
                stamp = serialised_stamp_ns(data)
                return stamp, (status_row(first.values, stamp / NANOSECONDS),)
            except (ValueError, IndexError):
                return read_any(data)

        return read_status
    unpack, spans = unpacker(topic), topic.spans

    def read(data: bytes) -> tuple[int, Values]:
        found = unpack(data)
        if found is not None and all(low <= value <= high for value, (low, high) in zip(found[1], spans, strict=True)):
            return found
        return read_any(data)

    return read


def message_reader(topic: Topic) -> Callable[[Any], Values]:
    """Return the function that turns a message of `topic` into its values and raises `BadMessage` for a bad one."""
    if topic.type == DIAGNOSTICS:
        return _read_status
    spans = topic.spans
    if topic.type in SCALARS:
        ((low, high),) = spans
        field, unit, _ = SCALARS[topic.type]
        if topic.type == TEMPERATURE:
            unit = "degC or K"

        def read_scalar(message: Any) -> Values:
            value = getattr(message, field)
            if not low <= value <= high:
                raise _bad(value, topic.name, low, high, unit)
            return (value,)

        return read_scalar
    if topic.type == JOINTS:
        names = list(topic.joints)
        count = len(names)
        slots = [(JOINT_FIELD[joint], i, f"{topic.name}:{joint}", *spans[i]) for i, joint in enumerate(names)]

        def read_joints(message: Any) -> Values:
            if message.name != names:
                msg = f"{topic.name}: joints {list(message.name)}, expected {names}"
                raise BadMessage(msg, "names")
            values = []
            for field, i, key, low, high in slots:
                column = getattr(message, field)
                if len(column) != count:
                    msg = f"{topic.name}: {len(column)} values of {field} for {count} joints"
                    raise BadMessage(msg, "length")
                value = column[i]
                if not low <= value <= high:
                    raise _bad(value, key, low, high, "rad/s, 0..1, kg/s or W")
                values.append(value)
            return tuple(values)

        return read_joints
    raise AssertionError(topic)


def _bad(value: float, where: str, low: float, high: float, unit: str) -> BadMessage:
    if not math.isfinite(value):
        return BadMessage(f"{where}: {value} is not a finite number", "not finite")
    return BadMessage(f"{where}: {value:g} is outside {low:g} to {high:g} {unit}: another unit?", "out of range")


def _read_status(message: Any) -> Values:
    if not message.status:
        msg = "fdi/status: empty"
        raise BadMessage(msg)
    try:
        values = {item.key: item.value for item in message.status[0].values}
        return (status_row(values, stamp_ns(message) / NANOSECONDS),)
    except ValueError as problem:
        raise BadMessage(str(problem)) from None
