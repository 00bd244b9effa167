"""The loop's messages as bytes: little-endian XCDR1, as ROS 2 puts them on the wire.

A loop message always has the same layout, so a node writes numbers into a template, and a bag is read column by column.
Padding is zero, which the middleware's own serialisation does not promise: without that, two equal runs would not
record the same bytes.
"""

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ac_common.errors import shortened
from ac_common.fdi_status import StatusRow, status_text, status_values
from ac_common.topics import CLOCK, DIAGNOSTICS, JOINT_FIELD, JOINTS, SCALARS, Topic

NANOSECONDS = 1_000_000_000

#: Representation: plain CDR, little-endian.
_ENCAPSULATION = b"\x00\x01\x00\x00"
_STAMP = struct.Struct("<iI")
_DOUBLE = struct.Struct("<d")
_NAN = float("nan")

Packer = Callable[[int, Sequence[Any]], bytes]


def stamp_ns(data: bytes) -> int:
    """Return the stamp of a serialised message (or clock): in all of them it comes first."""
    seconds, nanoseconds = _STAMP.unpack_from(data, 4)
    return int(seconds) * NANOSECONDS + int(nanoseconds)


def restamped(data: bytes, time_ns: int) -> bytes:
    """Return the serialised message with another stamp."""
    return data[:4] + _STAMP.pack(*divmod(time_ns, NANOSECONDS)) + data[12:]


def stamps_ns(messages: Sequence[bytes]) -> NDArray[np.int64]:
    """Return the stamps of many serialised messages."""
    heads = np.frombuffer(b"".join([data[4:12] for data in messages]), dtype=[("s", "<i4"), ("ns", "<u4")])
    times: NDArray[np.int64] = heads["s"].astype(np.int64) * NANOSECONDS + heads["ns"].astype(np.int64)
    return times


# -------------------------------------------------------------------------------------------------------- writing


class _Sink:
    """Appends values with their alignment, which counts from the end of the encapsulation."""

    def __init__(self) -> None:
        self.data = bytearray(_ENCAPSULATION)

    def align(self, size: int) -> int:
        """Return the offset of the next value of `size` bytes."""
        self.data += bytes(-(len(self.data) - 4) % size)
        return len(self.data)

    def number(self, value: int) -> None:
        self.align(4)
        self.data += value.to_bytes(4, "little")

    def text(self, value: str) -> None:
        encoded = value.encode() + b"\0"
        self.number(len(encoded))
        self.data += encoded

    def doubles(self, values: Sequence[float]) -> int:
        """Append doubles; offset of the first one."""
        start = self.align(8) if values else len(self.data)
        for value in values:
            self.data += _DOUBLE.pack(value)
        return start

    def header(self, time_ns: int, frame: str) -> None:
        self.data += _STAMP.pack(*divmod(time_ns, NANOSECONDS))
        self.text(frame)


def packer(topic: Topic) -> Packer:
    """Return a function that makes a message of `topic` from its stamp in ns and its values.

    The values are those of the topic's `series`; for ``fdi/status`` one `StatusRow`. Unused fields of a JointState are
    nan.
    """
    if topic.type == DIAGNOSTICS:
        return lambda time_ns, values: pack_status(time_ns, values[0])
    template, offsets = _template(topic)
    fields = struct.Struct("<d")

    def pack(time_ns: int, values: Sequence[float]) -> bytes:
        _STAMP.pack_into(template, 4, *divmod(time_ns, NANOSECONDS))
        for offset, value in zip(offsets, values, strict=True):
            fields.pack_into(template, offset, value)
        return bytes(template)

    return pack


def messages_of(topic: Topic, times_ns: NDArray[np.int64], values: Sequence[NDArray[np.float64]]) -> list[bytes]:
    """Return many messages of one topic; the inverse of `columns`.

    Parameters
    ----------
    topic
        One that holds numbers, or the clock.
    times_ns, values
        Stamp of each message; for each of the topic's `series` the value in each message.

    Returns
    -------
    list of bytes
        As `packer` makes them, each filled up to a whole number of four bytes, as the middleware delivers them.
    """
    template, offsets = _template(topic)
    template += bytes(-len(template) % 4)
    table = np.tile(np.frombuffer(template, np.uint8), (len(times_ns), 1))
    stamps = np.stack(np.divmod(times_ns, NANOSECONDS), axis=1).astype("<u4")
    table[:, 4:12] = stamps.view(np.uint8)
    for offset, column in zip(offsets, values, strict=True):
        table[:, offset : offset + _DOUBLE.size] = np.ascontiguousarray(column, "<f8").view(np.uint8).reshape(-1, 8)
    data, size = table.tobytes(), len(template)
    return [data[at : at + size] for at in range(0, len(data), size)]


def unpacker(topic: Topic) -> Callable[[bytes], tuple[int, tuple[float, ...]] | None]:
    """Return the inverse of `packer`, for a topic that holds numbers: stamp in ns and values of a message.

    It gives None for a message whose other bytes are not those that `packer` writes: from another publisher, or no
    message of this topic at all.
    """
    template, offsets = _template(topic)
    # In turn the bytes that are always the same, and a value; in a message a position comes before a velocity.
    starts = sorted(offsets)
    ends = [12, *(start + _DOUBLE.size for start in starts)]
    lengths = [start - end for start, end in zip([*starts, len(template)], ends, strict=True)]
    layout = struct.Struct("<4siI" + "d".join(f"{length}s" for length in lengths))
    same = layout.unpack(template)[3::2]
    places = [4 + 2 * starts.index(offset) for offset in offsets]

    def unpack(data: bytes) -> tuple[int, tuple[float, ...]] | None:
        if len(data) != layout.size:
            return None
        found = layout.unpack(data)
        if found[0] != _ENCAPSULATION or found[3::2] != same:
            return None
        return found[1] * NANOSECONDS + found[2], tuple([found[place] for place in places])

    return unpack


def _template(topic: Topic) -> tuple[bytearray, list[int]]:
    """Return a message of `topic` and where its values are."""
    sink = _Sink()
    if topic.type == CLOCK:
        sink.data += _STAMP.pack(0, 0)
        return sink.data, []
    sink.header(0, topic.frame)
    if topic.type in SCALARS:
        return sink.data, [sink.doubles([0.0, 0.0])]  # the value, and a variance of 0: unknown
    if topic.type != JOINTS:
        raise AssertionError(topic)
    sink.number(len(topic.joints))
    for joint in topic.joints:
        sink.text(joint)
    starts = {}
    for field in ("position", "velocity", "effort"):
        sink.number(len(topic.joints))
        starts[field] = sink.doubles([_NAN] * len(topic.joints))
    return sink.data, [starts[JOINT_FIELD[joint]] + 8 * i for i, joint in enumerate(topic.joints)]


@dataclass(frozen=True)
class Diagnostic:
    """One status of a DiagnosticArray; `level` is 0 when all is well, 1 for a warning."""

    name: str
    message: str
    values: dict[str, str]
    level: int = 0


def pack_status(time_ns: int, row: StatusRow) -> bytes:
    """Return a message of ``fdi/status``."""
    return pack_diagnostics(time_ns, [Diagnostic("fdi", status_text(row), status_values(row), int(row.detected))])


def pack_diagnostics(time_ns: int, statuses: Sequence[Diagnostic]) -> bytes:
    """Return a serialised DiagnosticArray."""
    sink = _Sink()
    sink.header(time_ns, "")
    sink.number(len(statuses))
    for status in statuses:
        sink.data.append(status.level)
        for word in (status.name, status.message, ""):  # the last: hardware
            sink.text(word)
        sink.number(len(status.values))
        for key, value in status.values.items():
            sink.text(key)
            sink.text(value)
    return bytes(sink.data)


# -------------------------------------------------------------------------------------------------------- reading


class _Source:
    """Reads from left to right; whatever does not fit into the message is a ValueError, and nothing is read twice."""

    def __init__(self, data: bytes) -> None:
        if data[:4] != _ENCAPSULATION:
            msg = f"a message that begins with {data[:4].hex() or 'nothing'} is no little-endian CDR"
            raise ValueError(msg)
        self.data = data
        self.at = 4

    def align(self, size: int) -> int:
        self.at += -(self.at - 4) % size
        return self.at

    def skip(self, size: int) -> int:
        """Return the offset of the next `size` bytes, which must be there."""
        start, self.at = self.at, self.at + size
        if self.at > len(self.data):
            msg = f"a message of {len(self.data)} bytes ends before its content does"
            raise ValueError(msg)
        return start

    def number(self) -> int:
        self.align(4)
        start = self.skip(4)
        return int.from_bytes(self.data[start : start + 4], "little")

    def count(self, smallest: int) -> int:
        """Return the length of a sequence whose items take at least `smallest` bytes each."""
        count = self.number()
        if count * smallest > len(self.data) - self.at:
            msg = f"a message of {len(self.data)} bytes claims to hold {count} items"
            raise ValueError(msg)
        return count

    def text(self) -> str:
        """Return the next text: `number` and `skip` in one, as a status is almost nothing else."""
        start = (self.at + 7) & ~3
        length = int.from_bytes(self.data[start - 4 : start], "little")
        self.at = start
        self.skip(length)
        return self.data[start : start + length - 1].decode(errors="replace") if length else ""

    def doubles(self) -> tuple[int, int]:
        """Return the offset of a sequence's first double, and how many there are."""
        count = self.count(8)
        start = self.align(8) if count else self.at
        return self.skip(8 * count) if count else start, count

    def header(self) -> None:
        self.skip(8)
        self.text()


def value_offsets(topic: Topic, data: bytes) -> list[int]:
    """Return where the values of `topic` are in a serialised message of it.

    Raises
    ------
    ValueError
        When the message ends early, has other joints, or fewer values than joints.
    """
    source = _Source(data)
    source.header()
    if topic.type in SCALARS:
        source.align(8)
        return [source.skip(8)]
    if topic.type != JOINTS:
        raise AssertionError(topic)
    names = [source.text() for _ in range(source.count(4))]
    if names != list(topic.joints):
        msg = f"{topic.name}: joints {shortened(names)}, expected {list(topic.joints)}"
        raise ValueError(msg)
    fields = {field: source.doubles() for field in ("position", "velocity", "effort")}
    offsets = []
    for i, joint in enumerate(names):
        start, count = fields[JOINT_FIELD[joint]]
        if i >= count:
            msg = f"{topic.name}: fewer values than joints"
            raise ValueError(msg)
        offsets.append(start + 8 * i)
    return offsets


def columns(topic: Topic, messages: Sequence[bytes]) -> list[NDArray[np.float64]]:
    """Return the values of many messages of one topic, one array for each of its `series`."""
    if not messages:
        return [np.empty(0) for _ in topic.series]
    first = messages[0]
    offsets = value_offsets(topic, first)
    end = max(offsets) + _DOUBLE.size
    if all(len(data) == len(first) for data in messages):
        table = np.frombuffer(b"".join(messages), np.uint8).reshape(len(messages), -1)
        # Same frame, same joints: the values are at the same place in every message.
        is_fixed = np.arange(len(first)) < end
        is_fixed[4:12] = False
        for offset in offsets:
            is_fixed[offset : offset + _DOUBLE.size] = False
        if (table[:, is_fixed] == table[0, is_fixed]).all():
            return [
                table[:, at : at + _DOUBLE.size].copy().view("<f8")[:, 0].astype(np.float64, copy=False)
                for at in offsets
            ]
    rows = [[_DOUBLE.unpack_from(data, offset)[0] for offset in value_offsets(topic, data)] for data in messages]
    return [np.array(column) for column in zip(*rows, strict=True)]


def read_diagnostics(data: bytes) -> list[Diagnostic]:
    """Return the content of a serialised DiagnosticArray.

    Raises
    ------
    ValueError
        When the message ends early or holds what is no text.
    """
    source = _Source(data)
    source.header()
    found = []
    for _ in range(source.count(1 + 3 * 4 + 4)):
        level = source.data[source.skip(1)]
        name, message, _hardware = source.text(), source.text(), source.text()
        pairs = [(source.text(), source.text()) for _ in range(source.count(2 * 4))]
        found.append(Diagnostic(name, message, dict(pairs), level))
    return found
