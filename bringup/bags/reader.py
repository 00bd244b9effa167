"""Our bags as arrays, also bags that were cut short. Needs neither ROS nor the bag's index."""

import json
import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.records import Attachment, Channel, Chunk, Metadata, Schema
from mcap.stream_reader import StreamReader

from bringup.bags.recorder import RUN_RECORD
from bringup.errors import BringupError, one_line
from bringup.recording import Recording
from bringup.ros.cdr import NANOSECONDS, columns, read_diagnostics, stamp_ns, stamps_ns, status_row
from bringup.topics import BY_NAME, DIAGNOSTICS, NAMESPACE, PLANT

_SCHEMA, _CHANNEL, _MESSAGE = 0x03, 0x04, 0x05
_RECORD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")


@dataclass
class RawBag:
    """Serialised messages of a bag by full topic name, in the order of the file.

    Attributes
    ----------
    messages : for each topic a list of (log time in ns, CDR bytes).
    types : type of each topic.
    run : what was run, as the recorder was told.
    attachments : files that were stored with it, by name.
    complete : False when the file ends before its time.
    """

    messages: dict[str, list[tuple[int, bytes]]] = field(default_factory=dict)
    types: dict[str, str] = field(default_factory=dict)
    run: dict[str, Any] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    complete: bool = False


def read_raw(bag: Path | str) -> RawBag:
    """Read all messages of a bag folder or of a bare ``.mcap`` file.

    Raises
    ------
    BringupError
        When there is no bag, or none that can be read.
    """
    files = _files(Path(bag))
    result = RawBag(complete=True)
    for file in files:
        try:
            with file.open("rb") as stream:
                _read_file(StreamReader(stream, emit_chunks=True), result)
        except (EndOfFile, struct.error):
            result.complete = False  # cut short; what is missing from a run shows in its number of ticks
        except (McapError, zstandard.ZstdError, UnicodeDecodeError) as problem:
            msg = f"{file}: not a readable MCAP file: {one_line(problem) or type(problem).__name__}"
            raise BringupError(msg) from None
        except OSError as problem:
            msg = f"{file}: cannot be read: {problem.strerror}"
            raise BringupError(msg) from None
    return result


def read_bag(bag: Path | str) -> Recording:
    """Read one of our bags, complete or cut short.

    Parameters
    ----------
    bag
        The folder that holds ``metadata.yaml``, a folder with such a folder ``bag`` in it, or an ``.mcap`` file.

    Raises
    ------
    BringupError
        When it cannot be read or holds no run of ours.
    """
    raw = read_raw(bag)
    if "sample_time_s" not in raw.run:
        msg = f"{bag}: holds no run of acftc (the metadata record {RUN_RECORD!r} is missing)"
        raise BringupError(msg)
    tick_ns = round(raw.run["sample_time_s"] * NANOSECONDS)
    prefix = f"{NAMESPACE}/"
    messages = {name: [data for _, data in raw.messages.get(prefix + name, [])] for name in BY_NAME}
    stamps = {name: stamps_ns(found) for name, found in messages.items()}
    every = [times for times in stamps.values() if len(times)]
    first = min((int(times.min()) for times in every), default=0)
    rows = {name: np.rint((times - first) / tick_ns).astype(np.int64) for name, times in stamps.items()}
    ticks = max((int(found.max()) for found in rows.values() if len(found)), default=-1) + 1
    recording = Recording(time_s=np.arange(ticks) * tick_ns / 1e9, series={})
    for name, topic in BY_NAME.items():
        if topic.type == DIAGNOSTICS:
            recording.status = [
                status_row(read_diagnostics(data)[0].values, (stamp_ns(data) - first) / 1e9) for data in messages[name]
            ]
            continue
        for key, column in zip(topic.series, columns(topic, messages[name]), strict=True):
            recording.series[key] = np.full(ticks, math.nan)
            recording.series[key][rows[name]] = column
    health = _last_health(raw, PLANT)
    recording.metadata = {**raw.run, "complete": raw.complete and ticks == raw.run.get("ticks")}
    if "wall_seconds" in health:
        recording.metadata["wall_seconds"] = float(health["wall_seconds"])
        recording.metadata["missed_ticks"] = int(health["missed_ticks"])
        recording.metadata["command_latency_ms"] = {
            quantile: float(health[f"command_latency_{quantile}_ms"]) for quantile in ("p50", "p99", "max")
        }
    return recording


def health_reports(raw: RawBag) -> Iterator[tuple[str, dict[str, str]]]:
    """All health reports in a bag: node name and figures, oldest first."""
    for _, data in raw.messages.get("/diagnostics", []):
        for status in read_diagnostics(data):
            yield status.name.rsplit("/", 1)[-1], status.values


def decode(topic: str, data: bytes) -> dict[str, Any]:
    """Values of one serialised loop message: numbers by series key, a status by its own keys."""
    described = BY_NAME[topic]
    if described.type == DIAGNOSTICS:
        return {key: value for status in read_diagnostics(data) for key, value in status.values.items()}
    found = zip(described.series, columns(described, [data]), strict=True)
    return {key: float(column[0]) for key, column in found}


def _last_health(raw: RawBag, node: str) -> dict[str, str]:
    found: dict[str, str] = {}
    for name, values in health_reports(raw):
        if name == node:
            found = values
    return found


# ------------------------------------------------------------------------------------------------------- the file


def _files(bag: Path) -> list[Path]:
    if bag.is_file():
        return [bag]
    for folder in (bag, bag / "bag"):
        files = sorted(folder.glob("*.mcap"))
        if files:
            return files
    msg = f"{bag}: no such bag" if not bag.exists() else f"{bag}: no bag in this folder (no .mcap file)"
    raise BringupError(msg)


class _Channels:
    """Channels and schemas of one file, and where their messages go."""

    def __init__(self, bag: RawBag) -> None:
        self._bag = bag
        self._types: dict[int, str] = {}
        self.messages: dict[int, list[tuple[int, bytes]]] = {}

    def define(self, record: Schema | Channel) -> None:
        """Learn a schema or a channel; both come again in the summary at the end."""
        if isinstance(record, Schema):
            self._types[record.id] = record.name
        elif record.id not in self.messages:
            self._bag.types[record.topic] = self._types.get(record.schema_id, "")
            self.messages[record.id] = self._bag.messages.setdefault(record.topic, [])


def _read_file(reader: StreamReader, result: RawBag) -> None:
    """Walk through the records; what precedes an early end has been taken by then."""
    channels = _Channels(result)
    for record in reader.records:
        if isinstance(record, Chunk):
            _read_chunk(record, channels)
        elif isinstance(record, Schema | Channel):
            channels.define(record)
        elif isinstance(record, Metadata) and record.name == RUN_RECORD:
            result.run = json.loads(record.metadata["run"])
        elif isinstance(record, Attachment):
            result.attachments[record.name] = record.data


def _read_chunk(chunk: Chunk, channels: _Channels) -> None:
    """Take the messages out of a chunk: several times faster than as one object each."""
    data = chunk.data
    if chunk.compression == "zstd":
        data = zstandard.decompress(data, chunk.uncompressed_size)
    elif chunk.compression:
        msg = f"compression {chunk.compression!r}"
        raise McapError(msg)
    at = 0
    while at < len(data):
        opcode, length = _RECORD.unpack_from(data, at)
        at += _RECORD.size
        if opcode == _MESSAGE:
            number, _, log_ns, _ = _MESSAGE_HEAD.unpack_from(data, at)
            channels.messages[number].append((log_ns, data[at + _MESSAGE_HEAD.size : at + length]))
        elif opcode == _SCHEMA:
            channels.define(Schema.read(ReadDataStream(BytesIO(data[at : at + length]))))
        elif opcode == _CHANNEL:
            channels.define(Channel.read(ReadDataStream(BytesIO(data[at : at + length]))))
        at += length
