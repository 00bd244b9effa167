"""A ROS 2 bag folder (MCAP and ``metadata.yaml``), written so that little is lost when the writer is killed.

A writer that goes on after one that was killed adds a file of its own to the folder; `bags.mending` makes it one again.
"""

import json
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from mcap.data_stream import RecordBuilder
from mcap.writer import CompressionType, Writer

from ac_common.delivery import DEADLINE_S, DEPTH
from ac_common.errors import UserError
from ac_common.files import put_whole
from ac_common.topics import CLOCK, DIAGNOSTICS, NAMESPACE, OCCASIONAL, TICKED, TOPICS
from ac_common.yaml_file import yaml_text
from ac_ros_common.type_definitions import definition, type_hash

#: Small chunks: what is lost in a crash, and how long the writer stands still to compress one.
CHUNK_BYTES = 64 * 1024
#: What a killed recorder can lose at most, s.
FLUSH_PERIOD_S = 0.25
#: Name of the MCAP metadata record that says what was run.
RUN_RECORD = "acftc"
#: Name of the MCAP metadata record of a file that was cut short and has been given its end by `mend`.
MENDED_RECORD = "acftc_mended"

_FOREVER = {"sec": 9223372036, "nsec": 854775807}


@dataclass(frozen=True)
class RecordedTopic:
    """A topic with its full name, and its deadline (None: no deadline)."""

    name: str
    type: str
    depth: int
    deadline_s: float | None = None

    def qos(self) -> dict[str, Any]:
        """Return the offered QoS, as the metadata of a bag spells it."""
        deadline = _FOREVER if self.deadline_s is None else {"sec": int(self.deadline_s), "nsec": 0}
        return {
            "history": "keep_last",
            "depth": self.depth,
            "reliability": "reliable",
            "durability": "volatile",
            "deadline": deadline,
            "lifespan": _FOREVER,
            "liveliness": "automatic",
            "liveliness_lease_duration": _FOREVER,
            "avoid_ros_namespace_conventions": False,
        }


def recorded_topics(lockstep: bool, namespace: str = NAMESPACE) -> list[RecordedTopic]:
    """List what is recorded of a run: the loop's topics, those that may be silent, health reports, and the clock."""
    topics = [
        RecordedTopic(f"{namespace}/{t.name}", t.type, DEPTH, DEADLINE_S if t in TICKED else None) for t in TOPICS
    ]
    topics += [RecordedTopic(f"{namespace}/{t.name}", t.type, DEPTH) for t in OCCASIONAL]
    topics.append(RecordedTopic("/diagnostics", DIAGNOSTICS, DEPTH))
    return [*topics, RecordedTopic("/clock", CLOCK, DEPTH)] if lockstep else topics


class BagWriter:
    """Writes raw CDR messages; `close` makes the folder complete.

    Parameters
    ----------
    folder
        Made when it does not exist.
    topics, run
        What is recorded, and what is being run.
    append
        Go on in the next file of a bag that is there already, instead of refusing.
    """

    def __init__(
        self, folder: Path, topics: Sequence[RecordedTopic], run: Mapping[str, Any], append: bool = False
    ) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        self._earlier = bag_files(folder)
        if self._earlier and not append:
            msg = f"{folder}: holds a bag already"
            raise UserError(msg)
        self._file = folder / f"{folder.name}_{len(self._earlier)}.mcap"
        self._topics = list(topics)
        self._run = json.dumps(run)
        self.counts = [0] * len(self._topics)
        self._first_ns: int | None = None
        self._last_ns = 0
        self._stream = self._file.open("wb")
        self._writer = new_writer(self._stream)
        self._index = IndexOnDisk(folder)
        self._writer.add_metadata(RUN_RECORD, {"run": self._run})
        schemas: dict[str, int] = {}
        self._channels = []
        for topic in self._topics:
            if topic.type not in schemas:
                text = definition(topic.type).encode()
                schemas[topic.type] = self._writer.register_schema(topic.type, "ros2msg", text)
            qos = yaml_text([topic.qos()])
            metadata = {"offered_qos_profiles": qos, "topic_type_hash": type_hash(topic.type)}
            self._channels.append(self._writer.register_channel(topic.name, "cdr", schemas[topic.type], metadata))
        self._flushed_s = time.monotonic()
        self._write_metadata()
        self._stream.flush()

    def write(self, topic: int, data: bytes, log_ns: int, stamp_ns: int) -> None:
        """Append one message of the topic with number `topic`."""
        self._writer.add_message(self._channels[topic], log_ns, data, stamp_ns, self.counts[topic])
        self.counts[topic] += 1
        if self._first_ns is None or log_ns < self._first_ns:
            self._first_ns = log_ns
        if log_ns > self._last_ns:
            self._last_ns = log_ns

    def flush_if_due(self) -> None:
        """Hand what has been written to the operating system now and then."""
        now = time.monotonic()
        if now - self._flushed_s >= FLUSH_PERIOD_S:
            self._flushed_s = now
            self._writer.flush()  # type: ignore[no-untyped-call]
            self._index.take_from(self._writer)

    def attach(self, name: str, data: bytes) -> None:
        """Store a file with the bag."""
        time_ns = self._last_ns
        self._writer.add_attachment(time_ns, time_ns, name, "application/octet-stream", data)

    def close(self) -> None:
        """Write index and metadata; the folder is a complete bag then."""
        self._index.take_from(self._writer)
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._stream.close()
        self._index.close()
        self._write_metadata()

    def _write_metadata(self) -> None:
        """``metadata.yaml``; also written at the start, so that a bag cut short is a bag still."""
        span = span_of(self._first_ns or 0, self._last_ns, sum(self.counts))
        content = {
            "version": 9,
            "storage_identifier": "mcap",
            **span,
            "topics_with_message_count": [
                {
                    "topic_metadata": {
                        "name": topic.name,
                        "type": topic.type,
                        "serialization_format": "cdr",
                        "offered_qos_profiles": [topic.qos()],
                        "type_description_hash": type_hash(topic.type),
                    },
                    "message_count": number,
                }
                for topic, number in zip(self._topics, self.counts, strict=True)
            ],
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [*(file.name for file in self._earlier), self._file.name],
            "files": [*({"path": file.name, **_NOTHING} for file in self._earlier), {"path": self._file.name, **span}],
            "custom_data": {"acftc_run": self._run},
            "ros_distro": "jazzy",
        }
        write_metadata_file(self.folder / "metadata.yaml", content)


class IndexOnDisk:
    """The index of a file's chunks, kept in a nameless file beside it until the end.

    The writer keeps some kilobytes for each chunk: at 50 Hz that is 10 kB a second of a run, for ever.
    """

    def __init__(self, folder: Path) -> None:
        self._file = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115  (open for as long as the bag is)

    def take_from(self, writer: Writer) -> None:
        """Move what the writer has in memory to the disk; at the end it finds all of it here."""
        kept: list[Any] = writer._Writer__chunk_indices  # type: ignore[attr-defined]  # no other way to it
        builder = RecordBuilder()
        for index in kept:
            if index is not self:
                index.write(builder)
        self._file.write(builder.end())  # type: ignore[no-untyped-call]
        kept[:] = [self]

    def write(self, builder: RecordBuilder) -> None:
        """Write all records, as the index of one chunk writes its own."""
        self._file.seek(0)
        builder.write(self._file.read())

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()


def bag_files(folder: Path) -> list[Path]:
    """Return the files of a bag in the order in which they were written."""

    def number(file: Path) -> tuple[int, str]:
        suffix = file.stem.rpartition("_")[2]
        return (int(suffix) if suffix.isdecimal() else -1, file.name)

    return sorted(folder.glob("*.mcap"), key=number)


def span_of(first_ns: int, last_ns: int, count: int) -> dict[str, Any]:
    """Return times and number of messages as the metadata of a bag has them."""
    return {
        "duration": {"nanoseconds": max(last_ns - first_ns, 0)},
        "starting_time": {"nanoseconds_since_epoch": first_ns},
        "message_count": count,
    }


_NOTHING = span_of(0, 0, 0)


def new_writer(stream: IO[bytes]) -> Writer:
    """Return a writer of a file of a bag, begun."""
    writer = Writer(stream, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD, use_summary_offsets=False)
    writer.start(profile="ros2", library="acftc")
    return writer


def write_metadata_file(path: Path, content: Mapping[str, Any]) -> None:
    """Write ``metadata.yaml``."""
    put_whole(path, yaml_text({"rosbag2_bagfile_information": dict(content)}))
