"""Shared memory that dead processes have left: Fast DDS removes its own at a clean exit, not after a `kill -9`.

Each segment has a lock file beside it (``..._el``) that its process holds locked for as long as it lives; the system
lets go of the lock however the process ends. So a lock that can be had belongs to nobody any more.
"""

import contextlib
import fcntl
import os
import time
from pathlib import Path

SHARED_MEMORY = Path("/dev/shm")
#: Between the making of a lock file and its locking lie microseconds; what is younger is left alone, s.
YOUNG_S = 5.0
#: A segment that was made to see whether shared memory works, and forgotten: one byte, no lock.
_TRIAL_BYTES = 1


def sweep(folder: Path = SHARED_MEMORY, young_s: float = YOUNG_S) -> int:
    """Remove this user's Fast DDS segments whose process is gone; how many files that were."""
    removed = 0
    for lock in folder.glob("fastrtps_*_el"):
        name = lock.name.removesuffix("_el")
        if _is_ours_and_old(lock, young_s) and _is_nobodys(lock):
            removed += sum(_remove(folder / left) for left in (name, f"{name}_el", f"{name}_sl", f"sem.{name}_mutex"))
    for trial in folder.glob("fastrtps_*"):
        with contextlib.suppress(OSError):
            if trial.stat().st_size <= _TRIAL_BYTES and not trial.name.endswith(("_el", "_sl")):
                has_lock = trial.with_name(f"{trial.name}_el").exists()
                removed += not has_lock and _is_ours_and_old(trial, young_s) and _remove(trial)
    return removed


def _is_ours_and_old(file: Path, young_s: float) -> bool:
    try:
        about = file.stat()
    except OSError:
        return False
    return about.st_uid == os.getuid() and time.time() - about.st_mtime > young_s


def _is_nobodys(lock: Path) -> bool:
    try:
        with lock.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
    except OSError:
        return False


def _remove(file: Path) -> bool:
    try:
        file.unlink()
    except OSError:
        return False
    return True
