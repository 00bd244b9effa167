"""What the operating system can do for a loop on the wall clock, most of it off unless asked for.

A node says in its health report (``realtime_care``) what it has got; a system that does not permit it is no failure.
"""

import contextlib
import ctypes
import gc
import math
import os
import struct
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

#: Says which driver puts idle processors to sleep; "none": they are just halted.
IDLE_DRIVER = Path("/sys/devices/system/cpu/cpuidle/current_driver")
#: Set for nodes whose bringup keeps the processors awake.
AWAKE_VARIABLE = "ACFTC_PROCESSORS_AWAKE"
#: Lock what is there and what comes, but only pages that are touched: the whole address space would be ten times more.
_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4
CPU_DMA_LATENCY = Path("/dev/cpu_dma_latency")


def has_idle_driver() -> bool:
    """Whether the kernel can be asked not to let processors doze."""
    with contextlib.suppress(OSError):
        return IDLE_DRIVER.read_text().strip() != "none"
    return False


class RealtimeSettings:
    """What a node asks of the operating system and of Python while it is active, from `begin` to `end`.

    Attributes
    ----------
    scheduling : str
        How the process is scheduled.
    state : str
        What has come of the care: locked memory, and processors that do not doze.
    """

    def __init__(self) -> None:
        self._latency_file: int | None = None
        self._locked = False
        self._fifo = 0  # the priority that the system has permitted
        self.scheduling = "normal"
        self.state = "none"

    def begin(self, priority: int = 0, care: bool = True) -> str:
        """Ask for the SCHED_FIFO priority, and with `care` for the rest; return what has come of that."""
        # What exists now lives as long as the node; the collector need not walk through it in a tick.
        gc.collect()
        gc.freeze()
        gc.disable()
        self.scheduling = set_priority(priority)
        self._fifo = priority if self.scheduling.startswith("SCHED_FIFO") else 0
        if care:
            self.state = f"{self._lock_memory()}, {self._keep_awake()}"
        return self.state

    def end(self) -> None:
        """Give everything back."""
        gc.enable()
        self._fifo = 0
        set_priority(0)
        if self._locked:
            _LIBC.munlockall()
            self._locked = False
        if self._latency_file is not None:
            os.close(self._latency_file)
            self._latency_file = None
        self.state = "none"

    @contextlib.contextmanager
    def behind_the_loop(self) -> Iterator[None]:
        """Schedule what is done here a step behind the loop, lest it holds up a tick in another node."""
        if self._fifo > 1:
            set_own_priority(self._fifo - 1)
        yield
        if self._fifo > 1:  # and not deactivated meanwhile
            set_own_priority(self._fifo)

    def _lock_memory(self) -> str:
        if _LIBC.mlockall(_MCL_CURRENT | _MCL_FUTURE | _MCL_ONFAULT) != 0:
            return f"memory not locked ({os.strerror(ctypes.get_errno())})"
        self._locked = True
        return "memory locked"

    def _keep_awake(self) -> str:
        """Hold the latency of a processor's waking at 0 us, for as long as the file is open."""
        if AWAKE_VARIABLE in os.environ:
            return "processors kept awake by idle processes"
        if not has_idle_driver():
            return "processors may doze (no cpuidle driver)"
        try:
            self._latency_file = os.open(CPU_DMA_LATENCY, os.O_WRONLY)
            os.write(self._latency_file, struct.pack("<i", 0))
        except OSError as problem:
            with contextlib.suppress(OSError, TypeError):
                os.close(self._latency_file)  # type: ignore[arg-type]
            self._latency_file = None
            return f"processors may doze ({problem.strerror})"
        return "processors kept awake"


def sleep_until(monotonic_s: float) -> None:
    """Sleep until an absolute time of the monotonic clock, which no delay on the way there can shift."""
    seconds = int(monotonic_s)
    time_ = _Timespec(seconds, int((monotonic_s - seconds) * 1e9))
    _LIBC.clock_nanosleep(time.CLOCK_MONOTONIC, _TIMER_ABSTIME, ctypes.byref(time_), None)


def set_priority(priority: int) -> str:
    """Schedule all threads of this process by SCHED_FIFO (0: normally); what has come of it."""
    policy = os.SCHED_FIFO if priority > 0 else os.SCHED_OTHER
    try:
        for thread in Path("/proc/self/task").iterdir():  # the middleware's threads, too
            os.sched_setscheduler(int(thread.name), policy, os.sched_param(priority))
    except OSError as problem:
        return f"normal ({problem.strerror})"
    return f"SCHED_FIFO {priority}" if priority > 0 else "normal"


def set_own_priority(priority: int) -> None:
    """Schedule the calling thread alone by SCHED_FIFO with this priority, which the process must be permitted."""
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))


class Latencies:
    """Quantiles of many durations in a fixed amount of memory: logarithmic bins, 2.3 % wide, from 1 us to 1000 s."""

    _LOWEST_S, _DECADES, _BINS = 1e-6, 9, 100

    def __init__(self) -> None:
        self._counts = np.zeros(self._DECADES * self._BINS + 1, dtype=np.int64)
        self._largest_s = 0.0

    def add(self, duration_s: float) -> None:
        """Count one."""
        self._largest_s = max(self._largest_s, duration_s)
        bins = math.log10(max(duration_s, self._LOWEST_S) / self._LOWEST_S) * self._BINS
        self._counts[min(int(bins), len(self._counts) - 1)] += 1

    def quantile_s(self, share: float) -> float:
        """Return the duration that `share` of them do not exceed, to a bin; of 1 the largest itself; nan for none."""
        total = int(self._counts.sum())
        if total == 0:
            return math.nan
        if share >= 1.0:
            return self._largest_s
        number = int(np.searchsorted(np.cumsum(self._counts), max(share * total, 1)))
        middle_s: float = self._LOWEST_S * 10.0 ** ((number + 0.5) / self._BINS)
        return min(middle_s, self._largest_s)


class _Timespec(ctypes.Structure):
    _fields_ = (("tv_sec", ctypes.c_long), ("tv_nsec", ctypes.c_long))


_LIBC = ctypes.CDLL(None, use_errno=True)
_TIMER_ABSTIME = 1
