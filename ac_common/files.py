"""Files that are either whole or not there: written under another name, then renamed."""

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from ac_common.errors import RunError


def write_whole(path: Path, content: str | bytes) -> None:
    """Write `content` to `path`; whoever reads it, now or after a crash, finds the old content or all of the new.

    Raises
    ------
    RunError
        When it cannot be written (a full disk, no permission): one line. What was there before is still there.
    """
    try:
        put_whole(path, content)
    except OSError as problem:
        msg = f"{path}: cannot be written: {problem.strerror}"
        raise RunError(msg) from None


def put_whole(path: Path, content: str | bytes) -> None:
    """Write as `write_whole` does, with the OSError as it comes."""
    with open_whole(path) as file:
        file.write(content.encode() if isinstance(content, str) else content)


@contextlib.contextmanager
def open_whole(path: Path) -> Iterator[IO[bytes]]:
    """Give a file to write to that takes the place of `path` at the end, unless anything goes wrong."""
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}-")
    try:
        with os.fdopen(handle, "wb") as file:
            yield file
            file.flush()
            os.fsync(handle)
        Path(temporary).chmod(0o666 & ~_umask())
        Path(temporary).replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            Path(temporary).unlink()
        raise


def _umask() -> int:
    """Return the process's mask of permissions, which can only be read by setting it."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
