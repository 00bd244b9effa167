"""Manages running nodes over ROS: life cycle, readiness, health, restarts. Processes are in `processes`."""

import os
import signal
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from typing import Any, Self

from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import parameter_value_to_python

from ac_common.errors import RunError
from ac_common.health import HealthReport, Restart
from ac_common.topics import BRINGUP, NAMESPACE, PLANT, RECORDER, TOPICS, Topic
from ac_ros_common.client_node import client_node
from ac_ros_common.qos import PLAIN_QOS
from bringup.launch.announcer import Announcer
from bringup.launch.graph_audit import GraphAudit
from bringup.launch.lifecycle_client import LifecycleClient, ParameterRequest
from bringup.launch.process_table import PROCESSES
from bringup.launch.processes import Child
from bringup.launch.reports import Reports
from bringup.launch.restarts import Restarts, Silence
from bringup.launch.user_nodes import UserNodes

#: How often the processes are looked at while nothing comes in, s.
LOOK_S = 0.05
#: How often the graph is looked at for what does not belong there, s.
GRAPH_PERIOD_S = 0.1
#: How often it is searched though nothing in it has come or gone, and bringup reports when it has something to, s.
REPORT_PERIOD_S = 0.5

#: After so long of waiting for a user's node the user is told what of it is missing, s.
TELL_AFTER_S = 5.0

Revive = Callable[[str, dict[str, Any]], Child]


class Supervisor:
    """Brings nodes to life and follows them until the run is over.

    A node reports its state and how many subscribers its outputs have found on /diagnostics whenever either changes;
    so readiness is an event, and a loop starts only when every writer knows every reader.

    Of a user's node less is asked. One that reports like acftc's is treated like those, a managed one is driven through
    its life cycle, any other counts as ready when its topics are there; it suits the wall clock only.
    """

    #: How long all nodes together may take for one step; they only load, but the machine may have much else to do.
    patience_s = 180.0

    def __init__(
        self,
        children: Mapping[str, Child | None],
        environment: Mapping[str, str],
        user: UserNodes | None = None,
        revive: Revive | None = None,
        is_over: Callable[[], bool] = lambda: False,
        say: Callable[[str], None] = lambda _: None,
        topics: Sequence[Topic] = TOPICS,
    ) -> None:
        """Manage `children` by name; None stands for a node whose process is somebody else's.

        `revive` starts a node that has died again, with some parameters changed; without it such a node is the end.
        `is_over` ends every wait with a `RunError` once it is true. `say` is told at once, in a line each, which node
        died, that it is back in service, and what is in the graph and does not belong there. `topics` are those that
        have messages in this run.
        """
        self._children = dict(children)
        self._users = user.names if user is not None else ()
        self._revive = revive
        self._is_over = is_over
        self._restarts = Restarts()
        self._silence = Silence(time.monotonic())
        self._changed: dict[str, dict[str, Any]] = {}  # parameters that were set while nodes ran
        self._is_running = False
        self._looked_s = self._searched_s = 0.0
        self.unexpected: list[str] = []
        self.health = Reports()
        # The middleware reads its settings from this process's environment.
        domain = environment.get("ROS_DOMAIN_ID")
        os.environ.update({name: value for name, value in environment.items() if name != "ROS_DOMAIN_ID"})
        self._stack = ExitStack()
        self.node, self._executor = self._stack.enter_context(
            client_node(BRINGUP, NAMESPACE, None if domain is None else int(domain))
        )
        self._audit = GraphAudit(self.node, tuple(self._children), self._users, self.health, topics)
        self._lifecycle = LifecycleClient(self.node, self._children)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._heard, PLAIN_QOS)
        self.node.create_subscription(ParameterEvent, "/parameter_events", self._parameters_changed, PLAIN_QOS)
        self._announcer = Announcer(self.node, self.health, say)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    @property
    def restarts(self) -> list[Restart]:
        """Return the nodes that have died and were started again, in order."""
        return self._restarts.all

    # -- steps --------------------------------------------------------------------------------------------------

    def activate(self, order: Iterable[str]) -> None:
        """Configure all nodes, wait until they have found each other, then activate them in `order`."""
        order = list(order)
        self.connect(order, lambda: all(self._audit.is_connected(name) for name in order))
        for name in order:
            self.change([name], Transition.TRANSITION_ACTIVATE, "active")
        self._is_running = True

    def connect(self, names: Iterable[str], connected: Callable[[], bool]) -> None:
        """Configure nodes (those that are not yet) and wait until `connected`."""
        unconfigured = [name for name in names if self.state(name) != "inactive"]
        self.change(unconfigured, Transition.TRANSITION_CONFIGURE, "inactive")
        self._until(connected, lambda: f"{self._audit.unconnected()} not connected")

    def wait_for(self, states: Mapping[str, str]) -> None:
        """Wait until nodes that manage themselves have reached these states."""
        wanted = states.items()
        self._until(lambda: all(self.state(name) == state for name, state in wanted), lambda: f"no {dict(states)}")

    def state(self, name: str) -> str:
        """Return the life-cycle state of a node as it last reported it; empty as long as it has not."""
        return self.health.of(name).state

    def meet(self, names: Iterable[str]) -> None:
        """Wait until all these nodes, which run already, have reported their state."""
        self._until(
            lambda: all(self.state(name) for name in names),
            lambda: f"{', '.join(name for name in names if not self.state(name))} not heard of",
        )

    def set_parameters(self, name: str, values: Mapping[str, Any]) -> None:
        """Set parameters of a node, all of them or none."""
        with ParameterRequest(self.node, name, values) as request:
            self._until(request.is_possible, lambda: f"{name} takes no parameters")
            self._until(request.is_answered, lambda: f"{name} does not answer")
            if request.refusal is not None:
                raise RunError(f"node {name}: {request.refusal}")

    def let_go(self, names: Iterable[str]) -> None:
        """Leave nodes as they were before the run, ready for the next."""
        names = [name for name in names if self._lifecycle.is_managed(name)]
        self.change(names, Transition.TRANSITION_DEACTIVATE, "inactive")
        self.change(names, Transition.TRANSITION_CLEANUP, "unconfigured")

    def change(self, names: list[str], transition: int, state: str) -> None:
        """Request `transition` of each node as soon as its service is there; until all report `state`."""
        self._lifecycle.forget(names, transition)

        def done() -> bool:
            for name in names:
                if self._is_plain(name):
                    continue
                self._lifecycle.request(name, transition)
                if self._lifecycle.has_refused(name, transition):
                    raise RunError(self._failed(name, "cannot start"))
            return all(reached(name) for name in names)

        def reached(name: str) -> bool:
            if self._is_plain(name):
                return True
            if name in self._users and not self._audit.reports(name):
                return self._lifecycle.has_answered(name, transition)
            return self.state(name) == state

        self._until(done, lambda: f"{', '.join(n for n in names if not reached(n))} not {state}")

    def spin(self) -> None:
        """Handle one message or event; complain when a process has died."""
        self._executor.spin_once(timeout_sec=LOOK_S)
        if self._is_over():
            raise RunError("it was told to end")
        now_s = time.monotonic()
        for name, child in self._children.items():
            if child is not None and not self._restarts.is_dead(name) and child.process.poll() is not None:
                self._died(child, now_s)
        self._end_what_hangs(now_s)
        for name in self._restarts.take_due(now_s):
            self._start_again(name)
        if self._is_running and now_s - self._looked_s >= GRAPH_PERIOD_S:
            self._looked_s = now_s
            if self._audit.has_changed() or now_s - self._searched_s >= REPORT_PERIOD_S:
                self._searched_s = now_s
                self._look_for_unexpected()

    # -- details ------------------------------------------------------------------------------------------------

    def _heard(self, message: DiagnosticArray) -> None:
        """Take the health reports of the graph's nodes."""
        for status in message.status:
            name = status.name.rsplit("/", 1)[-1]
            said = {item.key: item.value for item in status.values}
            if status.name != f"{NAMESPACE}/{name}" or name not in self._children:
                continue
            if not self._restarts.is_of_dead(name, HealthReport.read(said)):
                self.health[name] = said
                if name == PLANT:
                    self._announcer.plant_stamp = message.header.stamp
                self._silence.heard(name, time.monotonic())
                self._note_return(name)

    def _is_plain(self, name: str) -> bool:
        """Whether a user's node is there and has no life cycle."""
        return name in self._users and not self._lifecycle.is_managed(name) and self._audit.publishes_all(name)

    def _until(self, condition: Callable[[], bool], what: Callable[[], str]) -> None:
        started_s = time.monotonic()
        is_told = not self._users
        while not condition():
            self.spin()
            waited_s = time.monotonic() - started_s
            if not is_told and waited_s > TELL_AFTER_S:
                is_told = True
                for name in (user for user in self._users if not self._lifecycle.is_managed(user)):
                    if lacking := self._audit.lacking(name):
                        self._announcer.tell(f"waiting for your {name}: {'; '.join(lacking)}")
            if waited_s > self.patience_s:
                raise RunError(f"the nodes did not get ready in {self.patience_s:g} s: {what()}")

    def _end_what_hangs(self, now_s: float) -> None:
        """End active nodes that have stopped reporting: they are started again, as dead ones are."""
        self._silence.look(now_s)
        if not self._is_running or self._revive is None:
            return
        active = {
            name: child
            for name, child in self._children.items()
            if child is not None and PROCESSES[name].is_restarted and self.state(name) == "active"
        }
        for name in self._silence.hung(active, now_s):
            with suppress(ProcessLookupError):
                os.killpg(active[name].process.pid, signal.SIGKILL)  # whoever hangs does not listen

    def _died(self, child: Child, now_s: float) -> None:
        """Have a dead node started again, where that helps; else the run is over."""
        name = child.name
        if not self._is_running or self._revive is None or not PROCESSES[name].is_restarted:
            raise RunError(self._failed(name, "died"))
        if not self._restarts.died(name, now_s):
            raise RunError(self._failed(name, f"died {self._restarts.deaths(name)} times"))
        pid = self.health.of(name).pid or child.process.pid
        self.health.pop(name, None)
        reason = self._silence.died(name) or f"{child.end}: {child.last_words()}"
        # In the time of the run, by the plant's word for when it began on the monotonic clock.
        run_s = round(time.monotonic() - self.health.of_plant().epoch_monotonic_s, 3)
        self._restarts.add(name, pid, run_s, reason)
        self._announcer.tell(f"node {name} died ({reason}) and is started again")

    def _start_again(self, name: str) -> None:
        assert self._revive is not None
        first_ns = self.health.of_plant().first_ns
        changed = {"run_start_ns": first_ns} if first_ns is not None and name != RECORDER else {}
        self._children[name] = self._revive(name, {**self._changed.get(name, {}), **changed})
        self._announcer.report(self._restarts, self.unexpected)

    def _note_return(self, name: str) -> None:
        """Note that a node that had died works again."""
        if (self.health.of(name).ticks or 0) > 0:
            for restart in self._restarts.back(name, time.monotonic()):
                self._announcer.tell(f"node {name} is back in service after {restart.back_s - restart.died_s:.1f} s")
                self._announcer.report(self._restarts, self.unexpected)

    def _look_for_unexpected(self) -> None:
        """Say what is new in the graph and does not belong there, and report as long as there is something to."""
        found = self._audit.unexpected([restart.node for restart in self.restarts])
        if found or found != self.unexpected or self.restarts:
            for line in sorted(set(found) - set(self.unexpected)):
                self._announcer.tell(line)
            self.unexpected = found
            self._announcer.report(self._restarts, self.unexpected)

    def _parameters_changed(self, event: ParameterEvent) -> None:
        """Remember what was set while a node ran: it must hold after a restart."""
        name = event.node.rsplit("/", 1)[-1]
        if self._is_running and event.node == f"{NAMESPACE}/{name}" and name in self._children:
            new = {parameter.name: parameter_value_to_python(parameter.value) for parameter in event.changed_parameters}
            self._changed.setdefault(name, {}).update(new)

    def _failed(self, name: str, how: str) -> str:
        child = self._children[name]
        if child is None:
            return f"node {name} {how}: see its own output; a run wants it unconfigured (parameter autostart: false)"
        return f"node {name} {how}: {child.last_words()} (log: {child.log})"
