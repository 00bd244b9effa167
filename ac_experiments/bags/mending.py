"""Makes a bag whole of which a writer was killed, or the power was lost: one file with its index and all messages.

Of a file that is damaged it keeps what is before the damage; the file itself stays beside, as `.mcap.damaged`.
"""

import contextlib
import struct
from collections import Counter
from collections.abc import Sequence
from os import SEEK_END
from pathlib import Path
from typing import Any

import zstandard
from mcap.exceptions import EndOfFile, McapError, UnsupportedCompressionError
from mcap.reader import make_reader
from mcap.records import Attachment, Channel, Footer, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC, Writer

from ac_common.errors import UserError
from ac_common.files import open_whole
from ac_common.yaml_file import parsed
from ac_experiments.bags.recorder import MENDED_RECORD, bag_files, new_writer, span_of, write_metadata_file

_METADATA = "metadata.yaml"
#: What reading raises where a file was cut short, and where it is damaged (RuntimeError: lz4).
_CUT = (EndOfFile, struct.error)
_DAMAGE = (*_CUT, McapError, zstandard.ZstdError, ValueError, KeyError, OverflowError, MemoryError, RuntimeError)


def mend(folder: Path) -> list[Path]:
    """Make a bag whole at the end of a run: one file with its end and its index, the metadata with all counts.

    What cannot be written (a full disk) or read stays as it is: `bags.reader` reads files that were cut short.

    Returns
    -------
    list of Path
        The files that were cut short.
    """
    cut = []
    with contextlib.suppress(OSError, TypeError, *_DAMAGE):
        files = bag_files(folder)
        cut = [file for file in files if not _has_end(file)]
        if cut or len(files) > 1:
            _join(files)
            _write_metadata(folder, files[0])
    return cut


def recover(bag: Path) -> tuple[list[Path], int, dict[Path, int]]:
    """Make a bag whole that was left without its end, damaged, or in several files; also one without metadata.

    Parameters
    ----------
    bag : Path
        Folder of a run, its bag, or an ``.mcap`` file.

    Returns
    -------
    files : list of Path
        What was cut short, damaged or joined; empty when the bag was whole.
    count : int
        Messages in it now.
    damaged : dict
        For each file with damage in it, how many of its messages are before it: these were kept.

    Raises
    ------
    UserError
        When there is no bag, or none that can be read or written.
    """
    is_file = bag.is_file()
    files = [bag] if is_file else bag_files(bag) or bag_files(bag / "bag")
    if not files:
        raise UserError(f"{bag}: no bag in this folder (no .mcap file)" if bag.exists() else f"{bag}: no such bag")
    folder = files[0].parent
    try:
        touched = files if len(files) > 1 or not _is_whole(files[0]) else []
        damaged = _join(files) if touched else {}
        if not is_file and (touched or not (folder / _METADATA).exists()):
            _write_metadata(folder, files[0])
        return touched, _statistics(files[0])[2], damaged
    except OSError as problem:
        raise UserError(f"{problem.filename or bag}: {problem.strerror}") from None
    except (TypeError, *_DAMAGE) as problem:
        raise UserError(f"{bag}: not a readable bag: {problem or type(problem).__name__}") from None


def _has_end(file: Path) -> bool:
    with file.open("rb") as stream:
        if stream.seek(0, SEEK_END) < 2 * len(MCAP0_MAGIC):
            return False
        stream.seek(-len(MCAP0_MAGIC), SEEK_END)
        return stream.read() == MCAP0_MAGIC


def _is_whole(file: Path) -> bool:
    """Tell whether a file can be read to its end, with the checksums that it has."""
    with file.open("rb") as source, contextlib.suppress(*_DAMAGE):
        return any(isinstance(record, Footer) for record in StreamReader(source, validate_crcs=True).records)
    return False


def _join(files: Sequence[Path]) -> dict[Path, int]:
    """Put what can be read of several files into the first of them, which ends as it should; remove the others.

    Returns the damaged ones, each with the number of messages before the damage; they stay, under another name.
    """
    with open_whole(files[0]) as target:
        copy = _Copy(new_writer(target))
        for file in files:
            copy.add(file)
        if not copy.is_whole:
            copy.writer.add_metadata(MENDED_RECORD, {})
        copy.writer.finish()  # type: ignore[no-untyped-call]
        target.flush()
        for file in copy.damaged:
            file.rename(file.with_name(f"{file.name}.damaged"))
    for file in files[1:]:
        file.unlink(missing_ok=True)
    return copy.damaged


class _Copy:
    """Files of a bag on their way into one: each topic is one channel there."""

    def __init__(self, writer: Writer) -> None:
        self.writer = writer
        self._schemas: dict[tuple[str, bytes], int] = {}
        self._channels: dict[tuple[str, int], int] = {}
        self._said: set[tuple[str, str]] = set()
        #: Whether all files were read to their ends; the damaged ones, with the messages that they gave.
        self.is_whole = True
        self.damaged: dict[Path, int] = {}

    def add(self, file: Path) -> None:
        """Add what can be read of a file: all of it, or what is before its early end or its damage.

        Raises
        ------
        McapError
            When the file does not begin as an MCAP file does, or is compressed in a way that cannot be read here.
        """
        schemas: dict[int, int] = {0: 0}
        channels: dict[int, int] = {}
        has_begun, messages = False, 0
        with file.open("rb") as source:
            try:
                for record in StreamReader(source, validate_crcs=True).records:
                    has_begun = True
                    self._take(record, schemas, channels)
                    messages += isinstance(record, Message)
            except UnsupportedCompressionError:
                raise
            except _DAMAGE as problem:
                self.is_whole = False
                is_cut = isinstance(problem, _CUT) and not _has_end(file)
                if not is_cut and not has_begun:
                    raise
                if not is_cut:
                    self.damaged[file] = messages

    def _take(self, record: McapRecord, schemas: dict[int, int], channels: dict[int, int]) -> None:
        """Add a record; `schemas` and `channels` tell the numbers of its file and learn new ones."""
        if isinstance(record, Schema):
            schemas[record.id] = self._schema(record)
        elif isinstance(record, Channel):
            channels[record.id] = self._channel(record, schemas[record.schema_id])
        elif isinstance(record, Metadata):
            self._metadata(record)
        elif isinstance(record, Attachment):
            self.writer.add_attachment(record.create_time, record.log_time, record.name, record.media_type, record.data)
        elif isinstance(record, Message):
            number = channels[record.channel_id]
            self.writer.add_message(number, record.log_time, record.data, record.publish_time, record.sequence)

    def _schema(self, record: Schema) -> int:
        key = (record.name, record.data)
        if key not in self._schemas:
            self._schemas[key] = self.writer.register_schema(record.name, record.encoding, record.data)
        return self._schemas[key]

    def _channel(self, record: Channel, schema: int) -> int:
        key = (record.topic, schema)
        if key not in self._channels:
            self._channels[key] = self.writer.register_channel(
                record.topic, record.message_encoding, schema, record.metadata
            )
        return self._channels[key]

    def _metadata(self, record: Metadata) -> None:
        key = (record.name, str(record.metadata))
        if key not in self._said and record.name != MENDED_RECORD:
            self._said.add(key)
            self.writer.add_metadata(record.name, record.metadata)


def _statistics(file: Path) -> tuple[int, int, int, dict[str, int], dict[str, tuple[Channel, str]]]:
    """Return first and last time, number of messages, their number by topic, and channel and type of each topic."""
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    if summary is None or summary.statistics is None:
        raise ValueError("without statistics")
    found = summary.statistics
    counts: Counter[str] = Counter()
    channels = {}
    for number, channel in summary.channels.items():
        counts[channel.topic] += found.channel_message_counts.get(number, 0)
        schema = summary.schemas.get(channel.schema_id)
        channels[channel.topic] = (channel, schema.name if schema is not None else "")
    return found.message_start_time, found.message_end_time, found.message_count, dict(counts), channels


def _write_metadata(folder: Path, file: Path) -> None:
    """Write the metadata of a bag of one file anew; what they said of the topics stays, where they were there."""
    path = folder / _METADATA
    first_ns, last_ns, count, counts, channels = _statistics(file)
    content: dict[str, Any] = {}
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        content = parsed(path.read_text(encoding="utf-8"), str(path))["rosbag2_bagfile_information"]
    if not isinstance(content, dict) or "topics_with_message_count" not in content:
        content = _bare_metadata(channels)
    span = span_of(first_ns, last_ns, count)
    content.update(span)
    content["relative_file_paths"] = [file.name]
    content["files"] = [{"path": file.name, **span}]
    for topic in content["topics_with_message_count"]:
        topic["message_count"] = counts.get(topic["topic_metadata"]["name"], 0)
    write_metadata_file(path, content)


def _bare_metadata(channels: dict[str, tuple[Channel, str]]) -> dict[str, Any]:
    """Return metadata made from what the file itself says of its topics."""
    topics = []
    for name, (channel, type_) in channels.items():
        offered = channel.metadata.get("offered_qos_profiles", "")
        described = {
            "name": name,
            "type": type_,
            "serialization_format": channel.message_encoding,
            "offered_qos_profiles": parsed(offered, name) if offered else [],
            "type_description_hash": channel.metadata.get("topic_type_hash", ""),
        }
        topics.append({"topic_metadata": described, "message_count": 0})
    return {
        "version": 9,
        "storage_identifier": "mcap",
        "topics_with_message_count": topics,
        "compression_format": "",
        "compression_mode": "",
        "custom_data": None,
        "ros_distro": "jazzy",
    }
