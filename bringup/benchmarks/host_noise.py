"""How late this machine wakes a process that has nothing else to do: what no program on it can do better than.

``python -m bringup.benchmarks.host_noise SECONDS [PROCESSOR]`` sleeps for a millisecond again and again, under
SCHED_FIFO above the loop's own priority where permitted, and prints how late it woke as JSON. It ends early when it is
told to (SIGTERM), and prints what it has seen until then.
"""

import gc
import json
import os
import signal
import sys
import time
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from ac_common.health import MissedTick
from ac_ros_common.process_exit import end_with_parent
from ac_ros_common.realtime import Latencies, set_priority

#: Above the loop's.
PRIORITY = 30
#: How long it sleeps. A machine that stands still between two wake-ups and goes on before the second one is not seen
#: to do so: this is how much of a stall, and how short a one, escapes.
PERIOD_S = 0.001
#: A machine that stands still for so much of a tick has taken the tick's time from the loop: half a tick at 100 Hz.
STALL_S = 0.005
#: A wake-up that is late by more than this is told, where nothing of ours can have been the reason.
TOLD_S = 0.001
#: So many of them are told one by one.
MOST_TOLD = 500_000


def main() -> int:
    """Measure and print."""
    end_with_parent()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    if len(sys.argv) > 2:
        os.sched_setaffinity(0, {int(sys.argv[2])})
    scheduling = set_priority(PRIORITY)
    told_s = STALL_S if scheduling.startswith("normal") else TOLD_S
    late = Latencies()
    stalls: list[tuple[float, float]] = []
    woke_s = time.monotonic()
    end_s = woke_s + float(sys.argv[1])
    gc.disable()  # a thousand times a second: as little as can be
    try:
        while woke_s < end_s:
            due_s = woke_s + PERIOD_S
            time.sleep(PERIOD_S)
            woke_s = time.monotonic()
            late.add(woke_s - due_s)
            if woke_s - due_s > told_s:
                stalls.append((due_s, woke_s))
    except KeyboardInterrupt:
        pass
    figures = {
        "scheduling": scheduling,
        "p99_ms": 1e3 * late.quantile_s(0.99),
        "max_ms": 1e3 * late.quantile_s(1.0),
        "stalls": sum(woke_s - due_s > STALL_S for due_s, woke_s in stalls),
        "stalls_at": stalls[-MOST_TOLD:],
    }
    print(json.dumps(figures), flush=True)
    return 0


def missed_by_us(
    missed: Iterable[MissedTick], sample_time_s: float, stalls: Sequence[tuple[float, float]]
) -> list[MissedTick]:
    """Return those of the missed ticks that our code has missed, not the machine that stood still.

    A process above the loop's priority that does nothing was not woken in time: that cannot be the loop's doing. A tick
    is the machine's when it stood still, on any processor, for `STALL_S` of it in all, or for as long as the command
    was late: the loop is a chain, and each of its links waits for the one before.

    Parameters
    ----------
    missed
        The missed ticks.
    sample_time_s
        Length of a tick.
    stalls
        (due, woken) of each late wake-up, on the same clock, in order.
    """
    ours = []
    known = np.reshape(stalls, (-1, 2))
    for tick in missed:
        end_s = tick.began_s + sample_time_s
        stood_still = lost_s(known, tick.began_s, end_s) >= STALL_S
        # Never true of a command that has not come.
        stood_still |= tick.late_s < lost_s(known, tick.began_s, end_s + tick.late_s)
        if not stood_still:
            ours.append(tick)
    return ours


def lost_s(stalls: NDArray[np.float64], began_s: float, end_s: float) -> float:
    """Return for how much of the time from `began_s` to `end_s` the machine stood still, on any processor.

    Parameters
    ----------
    stalls : ndarray, shape (n, 2)
        (due, woken) of each late wake-up, s, in order of the first.
    began_s, end_s
        On the same clock.
    """
    if len(stalls) == 0:
        return 0.0
    due_s, woke_s = stalls.T
    before_s = np.concatenate(([began_s], np.maximum.accumulate(woke_s)[:-1]))  # counted with an earlier one
    lost = np.minimum(woke_s, end_s) - np.maximum(np.maximum(due_s, before_s), began_s)
    return float(lost[lost > 0.0].sum())


if __name__ == "__main__":
    sys.exit(main())
