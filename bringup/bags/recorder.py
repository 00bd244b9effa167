"""A ROS 2 bag folder (MCAP and ``metadata.yaml``), written so that little is lost when the writer is killed."""

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from mcap.writer import CompressionType, Writer

from bringup.ros.definitions import definition, type_hash

#: Small chunks: what is lost in a crash, and how long the writer stands still to compress one.
CHUNK_BYTES = 64 * 1024
#: What a killed recorder can lose at most, s.
FLUSH_PERIOD_S = 0.25
#: Name of the MCAP metadata record that says what was run.
RUN_RECORD = "acftc"

_FOREVER = {"sec": 9223372036, "nsec": 854775807}


@dataclass(frozen=True)
class RecordedTopic:
    """A topic with its full name, and its deadline (None: no deadline)."""

    name: str
    type: str
    depth: int
    deadline_s: float | None = None

    def qos(self) -> dict[str, Any]:
        """Offered QoS, as the metadata of a bag spells it."""
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


class BagWriter:
    """Writes raw CDR messages; `close` makes the folder complete."""

    def __init__(self, folder: Path, topics: Sequence[RecordedTopic], run: Mapping[str, Any]) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.glob("*.mcap")):
            msg = f"{folder}: holds a bag already"
            raise ValueError(msg)
        self._file = folder / f"{folder.name}_0.mcap"
        self._topics = list(topics)
        self._run = json.dumps(run)
        self.counts = [0] * len(self._topics)
        self._first_ns: int | None = None
        self._last_ns = 0
        self._stream = self._file.open("wb")
        self._writer = Writer(
            self._stream, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD, use_summary_offsets=False
        )
        self._writer.start(profile="ros2", library="acftc")
        self._writer.add_metadata(RUN_RECORD, {"run": self._run})
        schemas: dict[str, int] = {}
        self._channels = []
        for topic in self._topics:
            if topic.type not in schemas:
                text = definition(topic.type).encode()
                schemas[topic.type] = self._writer.register_schema(topic.type, "ros2msg", text)
            qos = yaml.safe_dump([topic.qos()], sort_keys=False)
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

    def attach(self, name: str, data: bytes) -> None:
        """Store a file with the bag."""
        time_ns = self._last_ns
        self._writer.add_attachment(time_ns, time_ns, name, "application/octet-stream", data)

    def close(self) -> None:
        """Write index and metadata; the folder is a complete bag then."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._stream.close()
        self._write_metadata()

    def _write_metadata(self) -> None:
        """``metadata.yaml``; also written at the start, so that a bag cut short is a bag still."""
        start = self._first_ns or 0
        duration = max(self._last_ns - start, 0)
        count = sum(self.counts)
        span = {
            "duration": {"nanoseconds": duration},
            "starting_time": {"nanoseconds_since_epoch": start},
            "message_count": count,
        }
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
            "relative_file_paths": [self._file.name],
            "files": [{"path": self._file.name, **span}],
            "custom_data": {"acftc_run": self._run},
            "ros_distro": "jazzy",
        }
        text = yaml.dump({"rosbag2_bagfile_information": content}, Dumper=_NoAliases, sort_keys=False)
        (self.folder / "metadata.yaml").write_text(text, encoding="utf-8")


class _NoAliases(yaml.SafeDumper):
    """Writes repeated content out instead of referring to it, as rosbag2 does."""

    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002
        return True
