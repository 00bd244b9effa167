"""What the tests do to a running graph."""

import os
import signal
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from bringup.bench.children import node_pids


def pid_of(node: str) -> int:
    """Process of a node that this process has started."""
    pids = node_pids()
    if node not in pids:
        raise ProcessLookupError(node)
    return pids[node]


@dataclass
class Mischief:
    """A progress function of `run_graph` that does something at some ticks, and notes at which it did."""

    plan: Sequence[tuple[int, Callable[[], object]]]
    done: list[int] = field(default_factory=list)

    def __call__(self, tick: int, _ticks: int) -> None:
        while len(self.done) < len(self.plan) and tick >= self.plan[len(self.done)][0]:
            act = self.plan[len(self.done)][1]
            self.done.append(tick)
            act()


def killing(node: str, number: signal.Signals = signal.SIGKILL) -> Callable[[], None]:
    """Send a signal to a node."""
    return lambda: os.kill(pid_of(node), number)
