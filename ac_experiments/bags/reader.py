"""Our bags as arrays, also bags that were cut short. Needs neither ROS nor the bag's index."""

import json
import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, Literal

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ac_common.design_file import PAPER
from ac_common.errors import UserError, shortened
from ac_common.fdi_status import StatusRow, status_row
from ac_common.health import BringupReport, HealthReport, PlantReport, health_of
from ac_common.topics import BRINGUP, BY_NAME, DIAGNOSTICS, NAMESPACE, OCCASIONAL, PLANT, Topic
from ac_common.wire import NANOSECONDS, columns, read_diagnostics, stamp_ns, stamps_ns
from ac_experiments.bags.foreign import inferred_run
from ac_experiments.bags.recorder import MENDED_RECORD, RUN_RECORD, bag_files
from ac_experiments.recording import Recording
from ac_experiments.scenario import check
from ac_experiments.scenario_schema import Scenario

_SCHEMA, _CHANNEL, _MESSAGE = 0x03, 0x04, 0x05
_RECORD = struct.Struct("<BQ")
#: The largest chunk or other record that is read: far more than any recorder writes, and less than fills the memory.
LARGEST_RECORD = 2**30
#: Encapsulation and stamp: what every loop message begins with.
SHORTEST_MESSAGE = 12
#: The topic with which the plant begins a tick, and the one with which the scenario player answers.
BEAT, ANSWER = "plant/evaporator_pressure", "reference/evaporator_pressure"
#: Messages of ticks before the run's first one, from a plant that beats all the time, and after its last one are no
#: damage within these times.
BEFORE_NS, AFTER_NS = 60 * NANOSECONDS, 10 * NANOSECONDS
#: Of a message in a chunk: opcode, length, channel, number, times of its arrival and of its sending.
_MESSAGE_HEAD = struct.Struct("<BQHIQQ")


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
    UserError
        When there is no bag, or none that can be read.
    """
    files = _files(Path(bag))
    result = RawBag(complete=True)
    for file in files:
        try:
            with file.open("rb") as stream:
                _read_file(_Records(stream, emit_chunks=True, record_size_limit=LARGEST_RECORD), result)
        except (EndOfFile, struct.error):
            result.complete = False  # cut short; what is missing from a run shows in its number of ticks
        except (McapError, zstandard.ZstdError, UnicodeDecodeError, MemoryError, OverflowError) as problem:
            msg = f"{file}: not a readable MCAP file: {shortened(problem, 200) or type(problem).__name__}"
            raise UserError(msg) from None
        except OSError as problem:
            msg = f"{file}: cannot be read: {problem.strerror}"
            raise UserError(msg) from None
    return result


class Run(BaseModel):
    """What was run, as the recorder was told: the metadata record of a bag."""

    model_config = ConfigDict(extra="allow", strict=True, allow_inf_nan=False)

    scenario: dict[str, Any]
    mode: Literal["lockstep", "realtime", "simulate"]
    passive: bool
    sample_time_s: float = Field(ge=0.01, le=0.1)
    ticks: int | None = Field(default=None, ge=0)


def run_of(raw: RawBag, bag: Path | str) -> tuple[dict[str, Any], Scenario]:
    """Return what was run, checked, and its scenario; of a bag recorded by somebody else what its topics tell.

    Raises
    ------
    UserError
        When the bag holds no run of ours, or one that cannot have been.
    """
    if not raw.run:
        raw.run = inferred_run({name: loop_messages(raw, topic) for name, topic in BY_NAME.items()}) or {}
    if "scenario" not in raw.run:
        msg = f"{bag}: holds no run of acftc (the metadata record {RUN_RECORD!r} is missing or damaged)"
        raise UserError(msg)
    try:
        run = Run.model_validate(raw.run).model_dump()
    except ValidationError as problem:
        first = problem.errors(include_url=False)[0]
        where = shortened(".".join(str(part) for part in first["loc"]))
        msg = f"{bag}: the metadata record {RUN_RECORD!r} is damaged: {where}: {shortened(first['msg'], 200)}"
        raise UserError(msg) from None
    # A recording that does not name its design is older than the second one.
    return run, check({"design": PAPER, **run["scenario"]}, f"{bag}: scenario of the recording")


def loop_messages(raw: RawBag, topic: Topic) -> list[bytes]:
    """Return the messages of a loop topic that are long enough to have a stamp: anything may have been recorded."""
    return [data for _, data in raw.messages.get(f"{NAMESPACE}/{topic.name}", []) if len(data) >= SHORTEST_MESSAGE]


def read_bag(bag: Path | str) -> Recording:
    """Read one of our bags, complete or cut short.

    Messages that no node of the loop can have sent (cut off, of another layout, stamped outside the run) are left out
    and counted in the metadata's ``unreadable``.

    Parameters
    ----------
    bag
        The folder that holds ``metadata.yaml``, a folder with such a folder ``bag`` in it, or an ``.mcap`` file.

    Raises
    ------
    UserError
        When it cannot be read or holds no run of ours.
    """
    return recording_of(read_raw(bag), bag)


def recording_of(raw: RawBag, bag: Path | str) -> Recording:
    """Return the run in a bag that has been read by `read_raw`; see `read_bag`."""
    run, scenario = run_of(raw, bag)
    tick_ns = round(run["sample_time_s"] * NANOSECONDS)
    messages = {name: loop_messages(raw, topic) for name, topic in BY_NAME.items()}
    sent = sum(len(raw.messages.get(f"{NAMESPACE}/{name}", [])) for name in BY_NAME)
    first = first_stamp_ns(raw)
    rows: dict[str, NDArray[np.int64]] = {}
    # A bench has begun before the run; on the wall clock nodes go on until they are stopped, a little after the plant.
    outside = 0
    for name, found in messages.items():
        row = np.rint((stamps_ns(found) - first) / tick_ns).astype(np.int64)
        within = (row >= 0) & (row < scenario.ticks)
        rows[name] = row[within]
        near = (row * tick_ns >= -BEFORE_NS) & (row * tick_ns < scenario.ticks * tick_ns + AFTER_NS)
        outside += int(np.count_nonzero(near & ~within))
        if not within.all():
            messages[name] = [data for data, keep in zip(found, within, strict=True) if keep]
    columns_of, status, kept = _decoded(messages, rows, first)
    ticks = max((int(found.max()) for found in rows.values() if len(found)), default=-1) + 1
    recording = Recording(time_s=np.arange(ticks) * tick_ns / 1e9, series={}, status=status)
    for name, topic in BY_NAME.items():
        if topic in OCCASIONAL and not messages[name]:
            continue
        for key, column in zip(topic.series, columns_of.get(name, ()), strict=True):
            recording.series[key] = np.full(ticks, 0.0 if topic.silent_at_zero else math.nan)
            recording.series[key][rows[name]] = column
    recording.metadata = {
        **run,
        "complete": raw.complete and ticks == run["ticks"],
        "unreadable": sent - kept - outside,
    }
    recording.metadata.update(_timing(_last_health(raw, PLANT)))
    recording.metadata["overruns"] = {node.name: node.overruns for node in health_of(health_reports(raw))}
    told = BringupReport.read(_last_health(raw, BRINGUP)).restarts
    recording.metadata["restarts"] = [asdict(restart) for restart in told]
    recording.metadata["events"] = _events(raw, first, scenario.ticks * tick_ns)
    return recording


def first_stamp_ns(raw: RawBag) -> int:
    """Return the stamp of tick 0, from which the scenario counts.

    Our plant begins to beat when all nodes are there, so its first message is the first of all. Somebody else's may
    have beaten before; then it is the first message that the scenario player answered.
    """
    is_ours = PlantReport.read(_last_health(raw, PLANT)).first_ns is not None
    for name in (BEAT,) if is_ours else (ANSWER, BEAT):
        if found := loop_messages(raw, BY_NAME[name]):
            return stamp_ns(found[0])
    return min(
        (int(stamps_ns(found).min()) for name in BY_NAME if (found := loop_messages(raw, BY_NAME[name]))), default=0
    )


def _decoded(
    messages: dict[str, list[bytes]], rows: dict[str, NDArray[np.int64]], first: int
) -> tuple[dict[str, list[NDArray[np.float64]]], list[StatusRow], int]:
    """Return columns of every topic, the rows of ``fdi/status``, how many messages were read; `rows` lose the rest."""
    decoded: dict[str, list[NDArray[np.float64]]] = {}
    status: list[StatusRow] = []
    kept = 0
    for name, topic in BY_NAME.items():
        if topic.type == DIAGNOSTICS:
            status = [row for data in messages[name] if (row := _status(data, first)) is not None]
            kept += len(status)
            continue
        try:
            decoded[name] = columns(topic, messages[name])
        except (ValueError, struct.error):
            good = [_is_readable(topic, data) for data in messages[name]]
            rows[name] = rows[name][good]
            decoded[name] = columns(topic, [data for data, keep in zip(messages[name], good, strict=True) if keep])
        kept += len(rows[name])
    return decoded, status, kept


def _is_readable(topic: Topic, data: bytes) -> bool:
    try:
        columns(topic, [data])
    except (ValueError, struct.error):
        return False
    return True


def _status(data: bytes, first: int) -> StatusRow | None:
    try:
        (status, *_) = read_diagnostics(data)
        return status_row(status.values, (stamp_ns(data) - first) / 1e9)
    except ValueError:
        return None


def _timing(health: dict[str, str]) -> dict[str, Any]:
    """Return what the plant's last health report says of the wall clock; nothing where it does not say it."""
    said = PlantReport.read(health)
    if said.missed_ticks is None or not math.isfinite(said.wall_seconds):
        return {}
    return {
        "wall_seconds": said.wall_seconds,
        "missed_ticks": said.missed_ticks,
        "command_latency_ms": dict(zip(("p50", "p99", "max"), said.command_latency_ms, strict=True)),
    }


def _events(raw: RawBag, first: int, duration_ns: int) -> list[dict[str, Any]]:
    """Return what nodes announced within the run, in order of time; each once, as reports repeat it."""
    found: dict[tuple[float, str, str], None] = {}  # in the order of reports
    for name, values in health_reports(raw):
        announced = HealthReport.read(values).announced
        since = [(round(time_s - first / 1e9, 6) if first else time_s, what) for time_s, what in announced]
        found |= {(time_s, name, what): None for time_s, what in since if 0.0 <= time_s < duration_ns / 1e9}
    in_order = sorted(found, key=lambda event: event[:2])
    return [{"time_s": time_s, "node": name, "what": what} for time_s, name, what in in_order]


def health_reports(raw: RawBag) -> Iterator[tuple[str, dict[str, str]]]:
    """Return all health reports in a bag: node name and figures, oldest first; what is no report is passed over."""
    for _, data in raw.messages.get("/diagnostics", []):
        try:
            found = read_diagnostics(data)
        except ValueError:
            continue
        for status in found:
            yield status.name.rsplit("/", 1)[-1], status.values


def decode(topic: str, data: bytes) -> dict[str, Any]:
    """Return the values of one serialised loop message: numbers by series key, a status by its own keys."""
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
        files = bag_files(folder)
        if files:
            return files
    msg = f"{bag}: no such bag" if not bag.exists() else f"{bag}: no bag in this folder (no .mcap file)"
    raise UserError(msg)


class _Records(StreamReader):
    """All records of a file but its indexes, of which there are more than of anything else."""

    def _read_record(self, opcode: int, length: int) -> McapRecord | None:
        if opcode in (Opcode.MESSAGE_INDEX, Opcode.CHUNK_INDEX):
            self._stream.read(length)
            return None
        return super()._read_record(opcode, length)


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
            data = _content(record)
            if record.uncompressed_crc and zlib.crc32(data) != record.uncompressed_crc:
                msg = "a chunk is damaged (its checksum is another)"
                raise McapError(msg)
            try:
                _read_chunk(data, channels)
            except (struct.error, EndOfFile):
                msg = "a chunk ends within a record"
                raise McapError(msg) from None
        elif isinstance(record, Schema | Channel):
            channels.define(record)
        elif isinstance(record, Message):  # a recorder that makes no chunks
            channels.messages.setdefault(record.channel_id, []).append((record.log_time, record.data))
        elif isinstance(record, Metadata) and record.name == RUN_RECORD:
            result.run = _run(record)
        elif isinstance(record, Metadata) and record.name == MENDED_RECORD:
            result.complete = False
        elif isinstance(record, Attachment):
            result.attachments[record.name] = record.data


def _run(record: Metadata) -> dict[str, Any]:
    try:
        run = json.loads(record.metadata["run"])
    except (KeyError, ValueError, RecursionError):
        run = None
    if not isinstance(run, dict):
        msg = f"the metadata record {RUN_RECORD!r} is damaged"
        raise McapError(msg)
    return run


def _content(chunk: Chunk) -> bytes:
    if chunk.uncompressed_size > LARGEST_RECORD:
        msg = f"a chunk of {chunk.uncompressed_size} bytes"
        raise McapError(msg)
    if chunk.compression == "zstd":
        if zstandard.frame_content_size(chunk.data) > LARGEST_RECORD:
            msg = "a chunk that unpacks to more than it says"
            raise McapError(msg)
        return zstandard.decompress(chunk.data, chunk.uncompressed_size)
    if chunk.compression:
        msg = f"compression {shortened(repr(chunk.compression))}"
        raise McapError(msg)
    return chunk.data


def _read_chunk(data: bytes, channels: _Channels) -> None:
    """Take the messages out of a chunk: several times faster than as one object each."""
    at, end = 0, len(data)
    while at < end:
        opcode = data[at]
        if opcode == _MESSAGE:
            _, length, number, _, log_ns, _ = _MESSAGE_HEAD.unpack_from(data, at)
            start = at + _MESSAGE_HEAD.size
            at += _RECORD.size + length
            if number not in channels.messages:
                msg = f"a message of channel {number}, which the file does not describe"
                raise McapError(msg)
            channels.messages[number].append((log_ns, data[start:at]))
            continue
        _, length = _RECORD.unpack_from(data, at)
        at += _RECORD.size
        if opcode == _SCHEMA:
            channels.define(Schema.read(ReadDataStream(BytesIO(data[at : at + length]))))
        elif opcode == _CHANNEL:
            channels.define(Channel.read(ReadDataStream(BytesIO(data[at : at + length]))))
        at += length
