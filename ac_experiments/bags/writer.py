"""The one place that touches what mcap's writer keeps to itself: it takes a message in a quarter of the time."""

import struct
import tempfile
from pathlib import Path
from typing import IO, Any

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.writer import CompressionType, Writer

#: Small chunks: what is lost in a crash, and how long the writer stands still to compress one.
CHUNK_BYTES = 64 * 1024

#: Of a message: opcode, length, channel, sequence, times of arrival and of sending. Of an index: ..., channel, length.
_MESSAGE, _INDEX = struct.Struct("<BQHIQQ"), struct.Struct("<BQHI")
_HEAD = _MESSAGE.size - 9  # what a length counts of it


class _Index:
    """Where the messages of a channel are in a chunk: time and place in turn."""

    def __init__(self, channel: int) -> None:
        self._channel = channel
        self.entries: list[int] = []

    def write(self, builder: RecordBuilder) -> None:
        """Write the record."""
        length = 8 * len(self.entries)
        builder.write(_INDEX.pack(Opcode.MESSAGE_INDEX, 6 + length, self._channel, length))
        builder.write(struct.pack(f"<{len(self.entries)}Q", *self.entries))


class BagFile(Writer):
    """Writes a file of a bag, begun; mcap's writer with a quick way for messages.

    A message goes into the chunk as its bytes; mcap makes an object of it first, and writes that field by field.
    """

    def __init__(self, stream: IO[bytes]) -> None:
        super().__init__(stream, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD, use_summary_offsets=False)
        self._chunk: Any = self._Writer__chunk_builder  # type: ignore[attr-defined]
        self._statistics: Any = self._Writer__statistics  # type: ignore[attr-defined]
        self.start(profile="ros2", library="acftc")

    def add_message(self, channel_id: int, log_time: int, data: bytes, publish_time: int, sequence: int = 0) -> None:
        """Append a message; see `mcap.writer.Writer`."""
        chunk, builder, statistics = self._chunk, self._chunk.record_writer, self._statistics
        if chunk.num_messages == 0:
            chunk.message_start_time = chunk.message_end_time = log_time
        elif log_time < chunk.message_start_time:
            chunk.message_start_time = log_time
        elif log_time > chunk.message_end_time:
            chunk.message_end_time = log_time
        if statistics.message_count == 0 or log_time < statistics.message_start_time:
            statistics.message_start_time = log_time
        if log_time > statistics.message_end_time:
            statistics.message_end_time = log_time
        chunk.num_messages += 1
        statistics.message_count += 1
        statistics.channel_message_counts[channel_id] += 1
        index = chunk.message_indices.get(channel_id)
        if index is None:
            index = chunk.message_indices[channel_id] = _Index(channel_id)
        at = builder.count
        index.entries += (log_time, at)
        head = _MESSAGE.pack(Opcode.MESSAGE, _HEAD + len(data), channel_id, sequence, log_time, publish_time)
        builder.write(head + data)
        if at + len(head) + len(data) > CHUNK_BYTES:
            self._Writer__maybe_finalize_chunk()  # type: ignore[attr-defined]


class IndexOnDisk:
    """The index of a file's chunks, kept in a nameless file beside it until the end.

    The writer keeps some kilobytes for each chunk: at 50 Hz that is 10 kB a second of a run, for ever.
    """

    def __init__(self, folder: Path) -> None:
        self._file = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115  (open for as long as the bag is)

    def take_from(self, writer: Writer) -> None:
        """Move what the writer has in memory to the disk; at the end it finds all of it here."""
        kept: list[Any] = writer._Writer__chunk_indices  # type: ignore[attr-defined]
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
