"""Files that are either whole or not there: written under another name, then renamed."""

import contextlib
import os
import tempfile
from pathlib import Path

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
    """As `write_whole`, with the OSError as it comes."""
    data = content.encode() if isinstance(content, str) else content
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}-")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(handle)
        Path(temporary).chmod(0o666 & ~_umask())
        Path(temporary).replace(path)
    except OSError:
        with contextlib.suppress(OSError):
            Path(temporary).unlink()
        raise


def _umask() -> int:
    """Return the process's mask of permissions, which can only be read by setting it."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
