"""Incoming messages: their class, their stamp, and the check that a node may act on them."""

import math
from collections.abc import Callable
from importlib import import_module
from typing import Any

from bringup.ros.cdr import NANOSECONDS, status_row
from bringup.topics import DIAGNOSTICS, JOINT_FIELD, JOINTS, PRESSURE, TEMPERATURE, Topic

Values = tuple[Any, ...]


class BadMessage(ValueError):  # noqa: N818  (reads as what it is: a message, and a bad one)
    """A message that a node must not act on; the text says what is wrong with it."""


def message_class(type_name: str) -> Any:
    """Class of a message type such as ``sensor_msgs/msg/Temperature``."""
    package, _, name = type_name.split("/")
    return getattr(import_module(f"{package}.msg"), name)


def stamp_ns(message: Any) -> int:
    """Time of the tick that `message` belongs to, in nanoseconds."""
    stamp = message.header.stamp
    return int(stamp.sec * NANOSECONDS + stamp.nanosec)


def reader(topic: Topic) -> Callable[[Any], Values]:
    """Return the function that turns a message of `topic` into its values and raises `BadMessage` for a bad one."""
    if topic.type == PRESSURE:
        return lambda message: (_finite(message.fluid_pressure, topic.name),)
    if topic.type == TEMPERATURE:
        return lambda message: (_finite(message.temperature, topic.name),)
    if topic.type == DIAGNOSTICS:
        return _read_status
    if topic.type == JOINTS:
        names = list(topic.joints)
        slots = [(JOINT_FIELD[joint], i, f"{topic.name}:{joint}") for i, joint in enumerate(names)]

        def read_joints(message: Any) -> Values:
            if message.name != names:
                msg = f"{topic.name}: joints {list(message.name)}, expected {names}"
                raise BadMessage(msg)
            try:
                return tuple([_finite(getattr(message, field)[i], key) for field, i, key in slots])
            except IndexError:
                msg = f"{topic.name}: fewer values than joints"
                raise BadMessage(msg) from None

        return read_joints
    raise AssertionError(topic)


def _read_status(message: Any) -> Values:
    if not message.status:
        msg = "fdi/status: empty"
        raise BadMessage(msg)
    try:
        values = {item.key: item.value for item in message.status[0].values}
        return (status_row(values, stamp_ns(message) / NANOSECONDS),)
    except ValueError as problem:
        raise BadMessage(str(problem)) from None


def _finite(value: float, where: str) -> float:
    if not math.isfinite(value):
        msg = f"{where}: {value} is not a finite number"
        raise BadMessage(msg)
    return value
