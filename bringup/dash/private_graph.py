"""A graph for the page alone: all nodes but the recorder, on the wall clock, for as long as the page is open."""

import os
import tempfile
import threading
import time
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from ac_common.errors import RunError, UserError, one_line
from ac_common.topics import PLANT, RECORDER, topics_in
from ac_experiments.scenario import check
from bringup.launch.beside import prepare_nodes
from bringup.launch.node_parameters import NodeStarter, node_parameters
from bringup.launch.process_table import ACTIVATION_ORDER, PROCESSES
from bringup.launch.processes import Child, Domain, ros_environment, stop

#: How long a graph that runs may take to be seen, s: discovery takes less than half a second.
LOOK_S = 1.5
#: How long one that is starting may take, s.
START_S = 30.0
#: What is played: nothing. The last row of a scenario stays on, so a short one lasts for ever.
AT_REST = {"name": "live", "description": "At rest until somebody does something.", "duration_s": 1.0}


class PrivateGraph:
    """Starts the nodes at once, activates them in the background, and watches them; a context manager.

    A node that dies is started again, as in a run on the wall clock.

    Parameters
    ----------
    domain : Domain
        The ROS domain, already taken; released at the end.
    point : str
        Operating point to start at.

    Attributes
    ----------
    problem : str
        One line, when a node would not start, or has died more often than it is started again; else empty.
    """

    def __init__(self, domain: Domain, point: str = "med") -> None:
        self.problem = ""
        self._domain = domain
        self._scenario = check({**AT_REST, "operating_point": point})
        self._folder = tempfile.TemporaryDirectory(prefix="acftc-dash-")
        self._starter = NodeStarter({}, self._log, {**ros_environment(), "ROS_DOMAIN_ID": str(domain.number)})
        self._ends, self._is_prepared = threading.Event(), threading.Event()
        self._thread: threading.Thread | None = None

    def __enter__(self) -> Self:
        # Processes first, and from this thread: a child ends with the thread that has started it.
        self._log.mkdir()
        parameters = node_parameters(self._scenario, Path(self._folder.name), "realtime", passive=False)
        parameters[PLANT]["ticks"] = 0  # it never stops
        self._starter = replace(self._starter, parameters=parameters)
        for name in PROCESSES:
            if name != RECORDER:
                self._starter.start(name)
        self._thread = threading.Thread(target=self._manage, name="private graph", daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, problem: BaseException | None, where: TracebackType | None
    ) -> None:
        self._ends.set()
        if self._thread is not None and self._is_prepared.is_set():
            self._thread.join()  # first: nodes that end all around it may make its own node hang (`exit_watchdog`)
        stop(list(self._starter.children.values()))
        self._folder.cleanup()
        self._domain.release()

    @property
    def _log(self) -> Path:
        return Path(self._folder.name) / "log"

    def _revive(self, name: str, changed: dict[str, Any]) -> Child:
        if self._ends.is_set():
            msg = "the page is being closed"
            raise RunError(msg)
        return self._starter.start_again(name, changed)

    def _manage(self) -> None:
        """Bring the nodes to life, then see that they stay alive."""
        from bringup.launch.supervisor import Supervisor

        try:
            prepare_nodes(self._scenario, self._log)  # takes long the first time; the page is there meanwhile
            self._is_prepared.set()
            children, environment = self._starter.children, self._starter.environment
            scenario = self._scenario
            topics = topics_in(scenario.car is not None, scenario.design, scenario.air_flow_sensor)
            with Supervisor(
                children, environment, revive=self._revive, is_over=self._ends.is_set, topics=topics
            ) as supervisor:
                supervisor.activate([name for name in ACTIVATION_ORDER if name in children])
                while True:
                    supervisor.spin()
        except UserError as problem:
            if not self._ends.is_set():
                self.problem = one_line(problem)
        except Exception as problem:
            if not self._ends.is_set():
                self.problem = f"{type(problem).__name__}: {one_line(problem)}"


def find_or_start(point: str = "med") -> tuple[int, PrivateGraph | None]:
    """Return the domain of a graph that runs, or of a private one, which the caller enters and leaves.

    Looks into ROS_DOMAIN_ID, 0 when it is not set. A domain that another run has taken, but in which nothing is to be
    seen yet, is given time: that run is starting.

    Raises
    ------
    UserError
        When ROS_DOMAIN_ID is no number of a domain, or a run that holds the domain shows no plant.
    """
    chosen = os.environ.get("ROS_DOMAIN_ID", "0")
    wanted = int(chosen) if chosen.isdecimal() else -1  # `Domain` complains of it below
    if _is_running(wanted, LOOK_S):
        return wanted, None
    try:
        taken = Domain()
    except UserError:
        if _is_running(wanted, START_S):
            return wanted, None
        raise
    if taken.number != wanted and _is_running(wanted, START_S):
        taken.release()
        return wanted, None
    return taken.number, PrivateGraph(taken, point)


def _is_running(domain: int, patience_s: float) -> bool:
    """Whether the plant of a graph is to be seen in a ROS domain within a while."""
    from ac_ros_common.client_node import client_node

    if domain not in range(233):
        return False
    os.environ.update(ros_environment())
    with client_node("acftc_dash_look", domain=domain) as (node, _executor):
        until = time.monotonic() + patience_s
        while time.monotonic() < until:
            if PLANT in node.get_node_names():
                return True
            time.sleep(0.05)
        return False
