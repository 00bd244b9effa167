"""Which nodes have died or hang, when each is started again, and which are back: plain bookkeeping on given times."""

from collections.abc import Collection

from ac_common.health import HealthReport, Restart
from bringup.launch.restart_policy import RestartPolicy

#: An active node reports each second. One that has not for so long hangs, s.
HUNG_S = 10.0
#: After a longer pause of this process itself nobody else is to blame for what was not heard, s.
PAUSE_S = 1.0


class Restarts:
    """The restarts of a run; times in s on the monotonic clock unless they are said to be of the run."""

    def __init__(self) -> None:
        self.all: list[Restart] = []
        self._policy = RestartPolicy()
        self._due_s: dict[str, float] = {}  # dead nodes, and when they are to be started again
        self._death_s: dict[str, float] = {}  # when each died last
        self._dead_pid: dict[str, int] = {}  # and which process that was: its last words may come after its end

    @property
    def waiting(self) -> list[str]:
        """Return the nodes that are not back yet."""
        return [restart.node for restart in self.all if not restart.is_back]

    def is_dead(self, node: str) -> bool:
        """Whether a node has died and has not been started again."""
        return node in self._due_s

    def is_of_dead(self, node: str, report: HealthReport) -> bool:
        """Whether a health report is of a process that has ended."""
        return self.is_dead(node) or (node in self._dead_pid and report.pid == self._dead_pid[node])

    def died(self, node: str, now_s: float) -> bool:
        """Note a death; whether the node is to be started again, or has had its chances."""
        wait_s = self._policy.wait_s(node, now_s)
        if wait_s is None:
            return False
        self._due_s[node] = now_s + wait_s
        self._death_s[node] = now_s
        return True

    def deaths(self, node: str) -> int:
        """Return how often a node died lately."""
        return self._policy.deaths(node)

    def add(self, node: str, pid: int, died_run_s: float, reason: str) -> None:
        """Begin the record of a restart: the process, when it died in the time of the run, and why."""
        self._dead_pid[node] = pid
        self.all.append(Restart(node, died_run_s, reason))

    def take_due(self, now_s: float) -> list[str]:
        """Return the nodes that are to be started now; they do not count as dead any more."""
        due = [node for node, due_s in self._due_s.items() if now_s >= due_s]
        for node in due:
            del self._due_s[node]
        return due

    def back(self, node: str, now_s: float) -> list[Restart]:
        """Note that a node works; return the restarts that are complete by that."""
        complete = [restart for restart in self.all if restart.node == node and not restart.is_back]
        for restart in complete:
            # Not by the time of the run again: after a pause the first tick is another.
            restart.back_s = round(restart.died_s + now_s - self._death_s[node], 3)
        return complete


class Silence:
    """Which nodes have stopped reporting."""

    def __init__(self, now_s: float) -> None:
        self._heard_s: dict[str, float] = {}  # when each node reported last
        self._looked_s = now_s
        self._ended: set[str] = set()  # nodes that were ended because they hang

    def heard(self, node: str, now_s: float) -> None:
        """Note that a node has reported."""
        self._heard_s[node] = now_s

    def look(self, now_s: float) -> None:
        """Forgive all nodes when this process itself has paused; to be called again and again."""
        if now_s - self._looked_s > PAUSE_S:
            self._heard_s = dict.fromkeys(self._heard_s, now_s)
        self._looked_s = now_s

    def hung(self, active: Collection[str], now_s: float) -> list[str]:
        """Return those of the `active` nodes that hang, each once; they are going to be ended."""
        silent = [node for node, heard_s in self._heard_s.items() if node in active and now_s - heard_s > HUNG_S]
        for node in silent:
            del self._heard_s[node]
        self._ended.update(silent)
        return silent

    def died(self, node: str) -> str:
        """Forget a node that has died; why it was ended, empty when it was not."""
        self._heard_s.pop(node, None)
        if node not in self._ended:
            return ""
        self._ended.remove(node)
        return f"ended, as it had not reported for {HUNG_S:g} s"
