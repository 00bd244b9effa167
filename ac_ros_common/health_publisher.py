"""What a node counts about its own work, for its health reports."""

import json
import math
import time
from collections import Counter, deque

#: How long, s, and how many of them at most, announcements are told again: a recorder that was away finds them, too.
AGAIN_S, MOST_AGAIN = 10.0, 16


class Health:
    """What a node has to say on /diagnostics about its own work since the last report."""

    def __init__(self) -> None:
        self.ticks = 0
        self.rejected: Counter[str] = Counter()  # by reason
        self.last_rejected = ""
        self.mode = ""  # what the node does other than usual
        self._announced: list[tuple[float, str]] = []  # and not reported yet
        self._told: deque[tuple[float, tuple[float, str]]] = deque(maxlen=MOST_AGAIN)  # first reported when
        self.overruns = 0  # ticks whose own work took longer than a sample time
        self.longest_s = 0.0
        self._latencies_s: list[float] = []
        self._last_input_s = math.nan
        self._reported = (time.monotonic(), 0)

    def worked(self, started_s: float, budget_s: float = math.inf) -> None:
        """Count one tick whose inputs were complete at `started_s` (monotonic clock); the watchdog of the loop.

        A tick that took longer than `budget_s` is an overrun.
        """
        took_s = time.monotonic() - started_s
        self.ticks += 1
        self.overruns += took_s > budget_s
        self.longest_s = max(self.longest_s, took_s)
        self._last_input_s = started_s
        self._latencies_s.append(took_s)

    def announce(self, time_s: float, text: str) -> None:
        """Have a change of what the node does (at a tick's time) in the next report, and in those soon after it."""
        self._announced.append((time_s, text))

    def forget(self) -> None:
        """Tell nothing of it again: what comes next is another run, with times of its own."""
        self._announced.clear()
        self._told.clear()

    def report(self) -> dict[str, str]:
        """Figures since the last call."""
        now = time.monotonic()
        since, ticks = self._reported
        self._reported = (now, self.ticks)
        latencies, self._latencies_s = sorted(self._latencies_s), []
        while self._told and now - self._told[0][0] > AGAIN_S:
            self._told.popleft()
        announced = [*(item for _, item in self._told), *self._announced]
        self._told.extend((now, item) for item in self._announced)
        self._announced = []
        return {
            "ticks": str(self.ticks),
            "rate_hz": f"{(self.ticks - ticks) / max(now - since, 1e-9):.1f}",
            "latency_p50_ms": f"{1e3 * latencies[len(latencies) // 2]:.3f}" if latencies else "nan",
            "latency_max_ms": f"{1e3 * latencies[-1]:.3f}" if latencies else "nan",
            "overruns": str(self.overruns),
            "longest_tick_ms": f"{1e3 * self.longest_s:.3f}",
            "input_age_s": f"{now - self._last_input_s:.3f}",
            "rejected_inputs": str(self.rejected.total()),
            "last_rejected": self.last_rejected,
            **{f"rejected/{reason}": str(n) for reason, n in sorted(self.rejected.items())},
            "mode": self.mode,
            "announced": json.dumps(announced),
        }
