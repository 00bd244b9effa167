"""The end of a process that hangs in the middleware, with the exit code that it would have had.

Fast DDS 2.14 can lock up for ever when a node is destroyed: `DomainParticipant::set_listener` waits for the end of a
callback of the discovery, which waits for a lock that the destroying thread has. Seen about once in two hundred nodes
when all of a graph end together on a busy machine. rclpy keeps the interpreter's lock meanwhile: no Python runs.
"""

import ctypes
import faulthandler
import time
from collections.abc import Iterator
from contextlib import contextmanager

#: How the interpreter's words about where a process stood begin.
STOOD = "Timeout ("
#: Of the time that is left, what the words about where it stood have before the end.
_WORDS = 0.1
_SIGEV_THREAD = 2


class _SigEvent(ctypes.Structure):
    """`struct sigevent` of the C library on 64 bits (sigevent(3type)), as far as it is used."""

    _fields_ = (
        ("value", ctypes.c_void_p),
        ("signo", ctypes.c_int),
        ("notify", ctypes.c_int),
        ("function", ctypes.c_void_p),
        ("attributes", ctypes.c_void_p),
        ("unused", ctypes.c_byte * 32),
    )


class _ITimerSpec(ctypes.Structure):
    """`struct itimerspec` (itimerspec(3type))."""

    _fields_ = tuple((name, ctypes.c_long) for name in ("every_s", "every_ns", "first_s", "first_ns"))


def exit_within(code: int, patience_s: float) -> ctypes.c_void_p:
    """See that this process has ended `patience_s` from now, whatever it does then; it says where it stood.

    A thread of the interpreter that needs no lock writes the traceback on standard error, and a timer of the C library
    calls ``_exit(code)``. Returns the timer. Several at once each have a timer; the words are told for the last.
    """
    libc = ctypes.CDLL(None)
    ends = _SigEvent(value=code, notify=_SIGEV_THREAD, function=ctypes.cast(libc._exit, ctypes.c_void_p))
    timer = ctypes.c_void_p()
    when = _ITimerSpec(first_s=int(patience_s), first_ns=int(patience_s % 1.0 * 1e9))
    made = libc.timer_create(time.CLOCK_MONOTONIC, ctypes.byref(ends), ctypes.byref(timer)) == 0
    if made:
        libc.timer_settime(timer, 0, ctypes.byref(when), None)
    # Without a timer (a user may have so many, and no more) the interpreter's thread ends it, with exit code 1.
    faulthandler.dump_traceback_later((1.0 - _WORDS) * patience_s, file=2, exit=not made)
    return timer


@contextmanager
def bounded(patience_s: float) -> Iterator[None]:
    """See that this process ends, with exit code 1, when what is done here is not over in time."""
    timer = exit_within(1, patience_s)
    try:
        yield
    finally:
        if timer:
            ctypes.CDLL(None).timer_delete(timer)
        faulthandler.cancel_dump_traceback_later()
