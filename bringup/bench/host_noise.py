"""How late this machine wakes a process that has nothing else to do: what no program on it can do better than.

``python -m bringup.bench.host_noise SECONDS PERIOD_S [PROCESSOR]`` sleeps to an absolute deadline again and again,
under SCHED_FIFO above the loop's own priority where permitted, and prints how late it woke as JSON.
"""

import json
import os
import sys
import time

from bringup.ros.node_shell import set_priority, sleep_until
from bringup.ros.processes import end_with_parent

#: Above the loop's.
PRIORITY = 30
#: A wake-up that is later by this much has taken the tick's time from the loop as well: half a tick at 100 Hz.
STALL_S = 0.005


def main() -> int:
    """Measure and print."""
    end_with_parent()
    duration_s, period_s = float(sys.argv[1]), float(sys.argv[2])
    if len(sys.argv) > 3:
        os.sched_setaffinity(0, {int(sys.argv[3])})
    set_priority(PRIORITY)
    late_s = []
    due_s = time.monotonic()
    for _ in range(round(duration_s / period_s)):
        due_s += period_s
        sleep_until(due_s)
        late_s.append(time.monotonic() - due_s)
    late_s.sort()
    stalls = sum(late > STALL_S for late in late_s)
    figures = {"p99_ms": 1e3 * late_s[int(0.99 * (len(late_s) - 1))], "max_ms": 1e3 * late_s[-1], "stalls": stalls}
    print(json.dumps(figures), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
