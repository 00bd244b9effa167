"""A node's own health: what it counts about its work, and the reports of it on /diagnostics."""

import math
import os
import platform
import time
from collections import Counter, deque
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.time import Time

from ac_common.health import HealthPart, HealthReport

#: The machine that a node runs on, as `hardware_id`.
HARDWARE = platform.node() or "unknown"
#: How long, s, and how many of them at most, announcements are told again: a recorder that was away finds them, too.
AGAIN_S, MOST_AGAIN = 10.0, 16


class Health:
    """What a node counts about its own work; some of it since the last report."""

    def __init__(self) -> None:
        self.problem = ""  # why the last transition failed
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

    def timed(self, act: Callable[..., None], budget_s: float, first: Callable[[], None]) -> Callable[..., None]:
        """Return `act` with its ticks counted, and `first` called after the first of them: the node is in service.

        A tick that takes longer than `budget_s` is an overrun.
        """

        def timed(*arguments: object) -> None:
            started_s = time.monotonic()
            act(*arguments)
            self.worked(started_s, budget_s)
            if self.ticks == 1:
                first()

        return timed

    def not_kept(self, problem: str) -> None:
        """Take note of why a checkpoint could not be kept or used."""
        self.last_rejected = problem

    def worked(self, started_s: float, budget_s: float = math.inf) -> None:
        """Count one tick whose inputs were complete at `started_s` (monotonic clock); the watchdog of the loop."""
        took_s = time.monotonic() - started_s
        self.ticks += 1
        self.overruns += took_s > budget_s
        self.longest_s = max(self.longest_s, took_s)
        self._last_input_s = started_s
        self._latencies_s.append(took_s)

    def reject(self, topic: str, reason: str, text: str) -> None:  # noqa: ARG002
        """Count a message that is not acted upon, by a word for the reason; keep what was wrong with it."""
        self.rejected[reason] += 1
        self.last_rejected = text

    def announce(self, time_s: float, text: str) -> None:
        """Have a change of what the node does (at a tick's time) in the next report, and in those soon after it."""
        self._announced.append((time_s, text))

    def forget(self) -> None:
        """Tell nothing of it again: what comes next is another run, with times of its own."""
        self._announced.clear()
        self._told.clear()

    def report(self, **further: Any) -> HealthReport:
        """Return the figures since the last call, with `further` fields of the report."""
        now = time.monotonic()
        since, ticks = self._reported
        self._reported = (now, self.ticks)
        latencies, self._latencies_s = sorted(self._latencies_s), []
        while self._told and now - self._told[0][0] > AGAIN_S:
            self._told.popleft()
        announced = (*(item for _, item in self._told), *self._announced)
        self._told.extend((now, item) for item in self._announced)
        self._announced = []
        return HealthReport(
            pid=os.getpid(),
            ticks=self.ticks,
            rate_hz=(self.ticks - ticks) / max(now - since, 1e-9),
            latency_p50_ms=1e3 * latencies[len(latencies) // 2] if latencies else math.nan,
            latency_max_ms=1e3 * latencies[-1] if latencies else math.nan,
            overruns=self.overruns,
            longest_tick_ms=1e3 * self.longest_s,
            input_age_s=now - self._last_input_s,
            rejected_inputs=self.rejected.total(),
            last_rejected=self.last_rejected,
            rejected=dict(sorted(self.rejected.items())),
            mode=self.mode,
            announced=announced,
            **further,
        )


class HealthPublisher:
    """Publishes a node's health on /diagnostics: in a node's name, with a level, a sentence, and all figures.

    Parameters
    ----------
    node : Node
    publisher : Publisher
        Of /diagnostics.
    """

    def __init__(self, node: Node, publisher: Publisher) -> None:
        self._node = node
        self._publisher = publisher
        self._refused = 0  # messages of which the log has told

    def publish(self, time_ns: int, report: HealthReport, further: HealthPart | None, problem: str) -> None:
        """Publish a report and what belongs to it; `problem` is why the node cannot work, empty: it can."""
        parts = [report] if further is None else [report, further]
        if (report.rejected_inputs or 0) > self._refused:
            self._refused = report.rejected_inputs or 0
            self._node.get_logger().warning(f"{self._refused} messages refused, the last: {report.last_rejected}")
        message = DiagnosticArray()
        message.header.stamp = Time(nanoseconds=time_ns).to_msg()
        level = DiagnosticStatus.WARN if report.mode else DiagnosticStatus.OK
        message.status = [
            DiagnosticStatus(
                level=bytes(DiagnosticStatus.ERROR if problem else level),
                name=self._node.get_fully_qualified_name(),
                message=problem or report.mode or report.state,
                hardware_id=HARDWARE,
                values=[KeyValue(key=key, value=value) for part in parts for key, value in part.values().items()],
            )
        ]
        self._publisher.publish(message)
