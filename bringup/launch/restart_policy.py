"""How often a dead node is started again, and after which wait: plain bookkeeping."""

from dataclasses import dataclass, field

#: A node that dies more often than `MOST` times within `WINDOW_S` ends the run.
MOST, WINDOW_S = 3, 30.0
#: Wait before the first, second, ... restart within that time, s.
BACKOFF_S = (0.0, 0.5, 2.0)


@dataclass
class RestartPolicy:
    """Bounded restarts with a growing wait."""

    _deaths_s: dict[str, list[float]] = field(default_factory=dict)

    def wait_s(self, node: str, now_s: float) -> float | None:
        """Return how long to wait before `node`, which just died, is started again; None when it had its chances."""
        recent = [death for death in self._deaths_s.get(node, []) if now_s - death < WINDOW_S]
        self._deaths_s[node] = [*recent, now_s]
        return BACKOFF_S[len(recent)] if len(recent) < MOST else None

    def deaths(self, node: str) -> int:
        """Return how often it died within the last `WINDOW_S`."""
        return len(self._deaths_s.get(node, []))
