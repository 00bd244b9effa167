"""How late this machine wakes a process that has nothing else to do: what no program on it can do better than.

``python -m bringup.bench.host_noise SECONDS PERIOD_S [PROCESSOR]`` sleeps to an absolute deadline again and again,
under SCHED_FIFO above the loop's own priority where permitted, and prints how late it woke as JSON. It ends early when
it is told to (SIGTERM), and prints what it has seen until then.
"""

import json
import os
import signal
import sys
import time
from collections.abc import Iterable, Sequence

from bringup.ros.processes import end_with_parent
from bringup.ros.realtime import Latencies, set_priority, sleep_until

#: Above the loop's.
PRIORITY = 30
#: A wake-up that is later by this much has taken the tick's time from the loop as well: half a tick at 100 Hz.
STALL_S = 0.005
#: So many stalls are told one by one.
MOST_TOLD = 5000


def main() -> int:
    """Measure and print."""
    end_with_parent()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    duration_s, period_s = float(sys.argv[1]), float(sys.argv[2])
    if len(sys.argv) > 3:
        os.sched_setaffinity(0, {int(sys.argv[3])})
    scheduling = set_priority(PRIORITY)
    late = Latencies()
    stalls: list[tuple[float, float]] = []
    due_s = time.monotonic()
    end_s = due_s + duration_s
    try:
        while due_s < end_s:
            due_s += period_s
            sleep_until(due_s)
            woke_s = time.monotonic()
            late.add(woke_s - due_s)
            if woke_s - due_s > STALL_S:
                stalls.append((due_s, woke_s))
            # What was slept through is one stall, not one for each period.
            due_s = max(due_s, woke_s - period_s)
    except KeyboardInterrupt:
        pass
    figures = {
        "scheduling": scheduling,
        "p99_ms": 1e3 * late.quantile_s(0.99),
        "max_ms": 1e3 * late.quantile_s(1.0),
        "stalls": len(stalls),
        "stalls_at": stalls[-MOST_TOLD:],
    }
    print(json.dumps(figures), flush=True)
    return 0


def missed_by_us(
    missed_at_s: Iterable[float], sample_time_s: float, stalls: Sequence[tuple[float, float]]
) -> tuple[int, int]:
    """Tell the ticks that were missed while the machine stood still from those that our code missed.

    A process above the loop's priority that does nothing was not woken in time: that cannot be the loop's doing. A tick
    is the machine's when such a stall overlaps it.

    Parameters
    ----------
    missed_at_s
        Beginnings of the missed ticks, on the monotonic clock.
    sample_time_s
        Length of a tick.
    stalls
        (due, woken) of each late wake-up, on the same clock.

    Returns
    -------
    (int, int)
        Missed by the machine, missed by our code.
    """
    machine = ours = 0
    for began_s in missed_at_s:
        stood_still = any(due_s < began_s + sample_time_s and woke_s > began_s for due_s, woke_s in stalls)
        machine += stood_still
        ours += not stood_still
    return machine, ours


if __name__ == "__main__":
    sys.exit(main())
