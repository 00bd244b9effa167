"""Checkpoints: what a node on the wall clock keeps in a file, for the one that takes its place after a crash.

What has a state that a successor needs (the detector, the compensator) is a `Checkpoint`: it tells its state, restores
another's, and starts warm, which is to go on in the middle of a run after ticks that it has not seen.
"""

import json
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Protocol

from ac_common.files import put_whole

#: How often the file is written, and how old it may be to be of use, s.
PERIOD_S, AGE_S = 0.5, 30.0


class Checkpoint(Protocol):
    """What can be saved between two ticks and gone on with by another of its design."""

    def state(self) -> Mapping[str, Any]:
        """Return all that a successor has to know, fit for JSON (nan included)."""

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take the place of the one whose `state` this is; a ValueError when it is none of this design's."""

    def warm_restart(self, *now: Any, **missed: Any) -> None:
        """Go on in the middle of a run: from what is known of the present tick, over the ticks that were missed."""


class CheckpointFile:
    """The file in which a node's state is kept; it is written by a thread of its own: a disk may take its time.

    Parameters
    ----------
    file : Path or None
        None: nothing is kept.
    failed : callable
        Told why the file could not be written; a full disk must not end the loop, a successor just knows less.
    """

    def __init__(self, file: Path | None, failed: Callable[[str], None]) -> None:
        self._file = file
        self._failed = failed
        self._saved_ns = 0
        self._contents: SimpleQueue[str | None] = SimpleQueue()
        self._writer: threading.Thread | None = None
        self._is_writing = False

    def open(self) -> None:
        """Start the thread; not within a tick, as who starts a thread waits until it runs."""
        if self._file is not None:
            self._writer = threading.Thread(target=self._write_all, daemon=True)
            self._writer.start()

    def close(self) -> None:
        """End the thread when everything is written."""
        if self._writer is not None:
            self._contents.put(None)
            self._writer.join()
            self._writer = None

    def forget(self) -> None:
        """Remove the file."""
        if self._file is not None:
            self._file.unlink(missing_ok=True)

    def save(self, time_ns: int, subject: Checkpoint) -> None:
        """Write the state of this tick, when it is time to and the disk is not busy with the last one."""
        if self._writer is None or self._is_writing or time_ns - self._saved_ns < PERIOD_S * 1e9:
            return
        self._saved_ns = time_ns
        self._is_writing = True
        self._contents.put(json.dumps({"time_ns": time_ns, **subject.state()}))

    def load(self, time_ns: int, subject: Checkpoint) -> int | None:
        """Restore what was saved before a crash and return the stamp of its tick.

        None when there is nothing recent, or nothing that `subject` takes.
        """
        if self._file is None:
            return None
        try:
            state: dict[str, Any] = json.loads(self._file.read_text(encoding="utf-8"))
            saved_ns = int(state["time_ns"])
            if not 0 < time_ns - saved_ns < AGE_S * 1e9:
                return None
            subject.restore(state)
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return saved_ns

    def _write_all(self) -> None:
        while (content := self._contents.get()) is not None:
            self._write(content)
            self._is_writing = False

    def _write(self, content: str) -> None:
        assert self._file is not None
        try:
            put_whole(self._file, content)
        except OSError as problem:
            self._failed(f"memory_file: {problem.strerror}")
