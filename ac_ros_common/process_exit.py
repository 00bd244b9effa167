"""How a process ends: with its parent, at once, and with an exit code that says why."""

import contextlib
import ctypes
import errno
import os
import select
import signal
import sys
import threading
from typing import NoReturn

from ac_ros_common.exit_watchdog import exit_within

#: Tells a node who started it: it ends when that process ends, however it ends.
PARENT_VARIABLE = "ACFTC_PARENT_PID"
#: How long a process that was told to end may take.
PATIENCE_S = 5.0

_PR_SET_PDEATHSIG = 1


def end_with_parent() -> None:
    """In a child: be told to end when the parent dies, and end at once when it is dead already.

    A child that has not ended some seconds after it was told to is ended: there is nobody left who could insist.
    """
    parent = os.environ.get(PARENT_VARIABLE)
    if parent is None:
        return
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != int(parent):
        sys.exit(1)
    with contextlib.suppress(OSError):  # a parent that has died since then has told us already
        threading.Thread(target=_end_after, args=(os.pidfd_open(int(parent)),), daemon=True).start()


def _end_after(parent: int) -> None:
    """End this process `PATIENCE_S` after the one of this file descriptor, whatever it does then."""
    select.select([parent], [], [])
    exit_within(1, PATIENCE_S)


def leave(code: int) -> NoReturn:
    """End this process without what the middleware does when the interpreter has gone.

    Its destructors of static objects have been seen to spin for ever, and to crash, when a message was under way.
    """
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except OSError:  # what is written to is on a disk that is full, or gone
        code = code or 1
    os._exit(code)


#: Exit code of a node that found the disk full, which takes neither the bag nor the words about it.
DISK_FULL = errno.ENOSPC
