"""How often a dead node is started again, and after which wait: plain bookkeeping."""

import json
import math
from dataclasses import dataclass, field

#: A node that dies more often than `MOST` times within `WINDOW_S` ends the run.
MOST, WINDOW_S = 3, 30.0
#: Wait before the first, second, ... restart within that time, s.
BACKOFF_S = (0.0, 0.5, 2.0)


@dataclass
class Restart:
    """One restart of a node, times in s since the first tick.

    Attributes
    ----------
    died_s : when bringup saw that the process was gone.
    back_s : when the node was back in service; nan while it is not.
    reason : signal or exit code, and its last words.
    """

    node: str
    died_s: float
    reason: str
    back_s: float = float("nan")

    @property
    def is_back(self) -> bool:
        """Whether the node is back in service."""
        return math.isfinite(self.back_s)

    def __str__(self) -> str:
        """What happened, in words, without the node's name."""
        then = f"back in service {self.back_s - self.died_s:.1f} s later" if self.is_back else "not back in service"
        return f"died ({self.reason}) and was started again; {then}"


def read_restarts(text: str) -> list[Restart]:
    """All restarts of bringup's health report, in order; none where it holds something else."""
    try:
        return [
            Restart(str(item["node"]), float(item["died_s"]), str(item["reason"]), float(item["back_s"]))
            for item in json.loads(text)
        ]
    except (ValueError, TypeError, KeyError):
        return []


@dataclass
class RestartPolicy:
    """Bounded restarts with a growing wait."""

    _deaths_s: dict[str, list[float]] = field(default_factory=dict)

    def wait_s(self, node: str, now_s: float) -> float | None:
        """How long to wait before `node`, which has just died, is started again; None when it has had its chances."""
        recent = [death for death in self._deaths_s.get(node, []) if now_s - death < WINDOW_S]
        self._deaths_s[node] = [*recent, now_s]
        return BACKOFF_S[len(recent)] if len(recent) < MOST else None

    def deaths(self, node: str) -> int:
        """How often it died within the last `WINDOW_S`."""
        return len(self._deaths_s.get(node, []))
