"""What the tests do to a running graph."""

import os
import signal
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from bringup.benchmarks.children import node_processes


def pid_of(node: str) -> int:
    """Process of a node that this process has started."""
    processes = node_processes()
    if node not in processes:
        raise ProcessLookupError(node)
    return processes[node].pid


@dataclass
class Mischief:
    """A progress function of `run_graph` that does something at some ticks, and notes at which it did.

    What is due waits until all nodes that have died are in service again, and for `rest` ticks more.
    """

    plan: Sequence[tuple[int, Callable[[], object]]]
    rest: int = 0
    done: list[int] = field(default_factory=list)
    done_s: list[float] = field(default_factory=list)  # when, on the monotonic clock: a tick is told some time later
    said: list[str] = field(default_factory=list)
    _disturbed: int = -1
    _back: int = 0

    def say(self, line: str) -> None:
        """Be told what bringup tells the user."""
        self.said.append(line)

    def __call__(self, tick: int, _ticks: int) -> None:
        died = sum("is started again" in line for line in self.said)
        back = sum("back in service" in line for line in self.said)
        if died > back or back > self._back:
            self._disturbed, self._back = tick, back
        while len(self.done) < len(self.plan) and tick >= max(
            self.plan[len(self.done)][0], self._disturbed + self.rest
        ):
            act = self.plan[len(self.done)][1]
            self.done.append(tick)
            self.done_s.append(time.monotonic())
            self._disturbed = tick
            act()


def killing(node: str, number: signal.Signals = signal.SIGKILL) -> Callable[[], None]:
    """Send a signal to a node."""
    return lambda: os.kill(pid_of(node), number)
