"""Arrays to messages and back, stamps, and the check of what comes in. Numbers pass bit for bit."""

import math
from array import array
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from bringup.recording import StatusRow
from bringup.topics import CLOCK, DIAGNOSTICS, FAULTS, JOINT_FIELD, JOINTS, PRESSURE, TEMPERATURE, Topic

Values = tuple[Any, ...]

NANOSECONDS = 1_000_000_000


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


def stamp_of_cdr(data: bytes) -> int:
    """Time stamp of a serialised loop message or clock: in all of them it comes first, after 4 bytes of header."""
    return int.from_bytes(data[4:8], "little", signed=True) * NANOSECONDS + int.from_bytes(data[8:12], "little")


def set_stamp(message: Any, time_ns: int) -> None:
    """Stamp `message` with a time in nanoseconds."""
    stamp = message.clock if hasattr(message, "clock") else message.header.stamp
    stamp.sec, stamp.nanosec = divmod(time_ns, NANOSECONDS)


def writer(topic: Topic) -> tuple[Any, Callable[[Sequence[float]], None]]:
    """Return one message of `topic` to be used again and again, and a function that puts values into it.

    The values are those of the topic's `series`; the fields of a JointState that are not used are nan.
    """
    message = message_class(topic.type)()
    if topic.type == CLOCK:
        return message, lambda _: None
    message.header.frame_id = topic.frame
    if topic.type == PRESSURE:
        return message, lambda values: setattr(message, "fluid_pressure", float(values[0]))
    if topic.type == TEMPERATURE:
        return message, lambda values: setattr(message, "temperature", float(values[0]))
    if topic.type == JOINTS:
        message.name = list(topic.joints)
        for field in ("position", "velocity", "effort"):
            setattr(message, field, array("d", [math.nan] * len(topic.joints)))
        slots = [(getattr(message, JOINT_FIELD[joint]), i) for i, joint in enumerate(topic.joints)]

        def put_joints(values: Sequence[float]) -> None:
            for (field, i), value in zip(slots, values, strict=True):
                field[i] = value

        return message, put_joints
    if topic.type == DIAGNOSTICS:
        return message, lambda values: setattr(message, "status", [status_message(values[0])])
    raise AssertionError(topic)


def reader(topic: Topic) -> Callable[[Any], Values]:
    """Return the function that turns a message of `topic` into its values and raises `BadMessage` for a bad one."""
    if topic.type == PRESSURE:
        return lambda message: (_finite(message.fluid_pressure, topic.name),)
    if topic.type == TEMPERATURE:
        return lambda message: (_finite(message.temperature, topic.name),)
    if topic.type == DIAGNOSTICS:
        return lambda message: (status_row(message, stamp_ns(message) / NANOSECONDS),)
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


def _finite(value: float, where: str) -> float:
    if not math.isfinite(value):
        msg = f"{where}: {value} is not a finite number"
        raise BadMessage(msg)
    return value


def status_message(row: StatusRow) -> DiagnosticStatus:
    """``fdi/status`` as a message: numbers as the shortest text that reads back to the same bits."""
    if row.isolated is not None:
        text = f"fault isolated: {row.isolated}"
    else:
        text = "fault detected, not yet isolated" if row.detected else "no fault"
    values = {
        "detected": "true" if row.detected else "false",
        "isolated": row.isolated or "",
        "size": repr(row.size),
        "onset_s": repr(row.onset_s),
        "isolated_s": repr(row.isolated_s),
        **{f"threshold/{fault}": repr(limit) for fault, limit in zip(FAULTS, row.thresholds, strict=True)},
    }
    return DiagnosticStatus(
        level=DiagnosticStatus.WARN if row.detected else DiagnosticStatus.OK,
        name="fdi",
        message=text,
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )


def status_row(message: DiagnosticArray, time_s: float) -> StatusRow:
    """Read ``fdi/status``; raises `BadMessage` when it is not what `status_message` writes."""
    try:
        values = {item.key: item.value for item in message.status[0].values}
        isolated = values["isolated"] or None
        if isolated is not None and isolated not in FAULTS:
            raise ValueError(isolated)
        return StatusRow(
            time_s=time_s,
            detected={"true": True, "false": False}[values["detected"]],
            isolated=isolated,
            size=float(values["size"]),
            onset_s=float(values["onset_s"]),
            isolated_s=float(values["isolated_s"]),
            thresholds=(float(values[f"threshold/{FAULTS[0]}"]), float(values[f"threshold/{FAULTS[1]}"])),
        )
    except (IndexError, KeyError, ValueError) as problem:
        msg = f"fdi/status: {type(problem).__name__} {problem}"
        raise BadMessage(msg) from None
