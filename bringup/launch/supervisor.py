"""Manages running nodes over ROS: life cycle, readiness, health, restarts. Processes are in `processes`."""

import math
import os
import signal
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack, suppress
from typing import Any, Self

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter, parameter_value_to_python

from ac_common.errors import RunError
from ac_common.health import BringupReport, HealthReport, PlantReport, RecorderReport, Restart
from ac_common.topics import BRINGUP, NAMESPACE, OCCASIONAL, PAGE, PLANT, RECORDER, TOPICS, Topic
from ac_ros_common.client_node import client_node
from ac_ros_common.qos import PLAIN_QOS
from ac_ros_common.type_definitions import type_hash
from bringup.launch.processes import Child
from bringup.launch.restart_policy import RestartPolicy
from bringup.launch.user_nodes import OwnNodes

#: How often the processes are looked at while nothing comes in, s.
LOOK_S = 0.05
STUCK_S = 30.0
#: Parameters that were not answered are set again after this, s.
ASK_AGAIN_S = 5.0
#: An active node reports each second. One that has not for so long hangs, s.
HUNG_S = 10.0
#: After a longer pause of this process itself nobody else is to blame for what was not heard, s.
PAUSE_S = 1.0
#: How often the graph is searched for strangers, and bringup itself reports when there is something to report, s.
REPORT_PERIOD_S = 0.5
#: How long after the last tick the recorder may take to have everything, s.
RECORDER_PATIENCE_S = 10.0


#: Of a node that has not been heard of.
NOTHING = HealthReport()


class Supervisor:
    """Brings nodes to life and follows them until the run is over.

    A node reports its state and how many subscribers its outputs have found on /diagnostics whenever either changes;
    so readiness is an event, and a loop starts only when every writer knows every reader.

    Of a node that is not ours (`own`) less is asked. One that reports like ours is treated like ours. A managed node is
    driven through its life cycle. Any other counts as ready when its topics are there; it suits the wall clock only.
    """

    def __init__(
        self,
        children: Mapping[str, Child | None],
        environment: Mapping[str, str],
        own: OwnNodes | None = None,
        revive: Callable[[str, dict[str, Any]], Child] | None = None,
        is_over: Callable[[], bool] = lambda: False,
        say: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Manage `children` by name; None stands for a node whose process is somebody else's.

        `revive` starts a node that has died again, with some parameters changed; without it such a node is the end.
        `is_over` ends every wait with a `RunError` once it is true. `say` is told at once, in a line each, which node
        died, that it is back in service, and what is in the graph and does not belong there.
        """
        self._children = dict(children)
        self._strange = own.strange if own is not None else ()
        self._revive = revive
        self._is_over = is_over
        self._say = say
        self._policy = RestartPolicy()
        self._due_s: dict[str, float] = {}  # dead nodes, and when they are to be started again
        self._death_s: dict[str, float] = {}  # when each died last, on the monotonic clock
        self._dead_pid: dict[str, int] = {}  # and which process that was: its last words may come after its end
        self.restarts: list[Restart] = []
        self._changed: dict[str, dict[str, Any]] = {}  # parameters that were set while nodes ran
        self._is_running = False
        self._looked_s = 0.0
        self.strangers: list[str] = []  # what is in the graph and does not belong there
        self.health: dict[str, dict[str, str]] = {}
        self._reported: dict[str, HealthReport] = {}
        self._heard_s: dict[str, float] = {}  # when each node reported last
        self._spun_s = time.monotonic()
        self._hung: set[str] = set()  # nodes that were ended because they hang
        self._replies: dict[tuple[str, int], Any] = {}
        # The middleware reads its settings from this process's environment.
        domain = environment.get("ROS_DOMAIN_ID")
        os.environ.update({name: value for name, value in environment.items() if name != "ROS_DOMAIN_ID"})
        self._stack = ExitStack()
        self.node, self._executor = self._stack.enter_context(
            client_node(BRINGUP, NAMESPACE, None if domain is None else int(domain))
        )
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._heard, PLAIN_QOS)
        self.node.create_subscription(ParameterEvent, "/parameter_events", self._parameters_changed, PLAIN_QOS)
        self._diagnostics = self.node.create_publisher(DiagnosticArray, "/diagnostics", PLAIN_QOS)
        self._clients = {
            name: self.node.create_client(ChangeState, f"{NAMESPACE}/{name}/change_state") for name in self._children
        }

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    # -- steps --------------------------------------------------------------------------------------------------

    def activate(self, order: Iterable[str]) -> None:
        """Configure all nodes, wait until they have found each other, then activate them in `order`."""
        order = list(order)
        self.connect(order, lambda: all(self._connected(name) for name in order))
        for name in order:
            self.change([name], Transition.TRANSITION_ACTIVATE, "active")
        self._is_running = True

    def connect(self, names: Iterable[str], connected: Callable[[], bool]) -> None:
        """Configure nodes (those that are not yet) and wait until `connected`."""
        self.change(
            [name for name in names if self.state(name) != "inactive"],
            Transition.TRANSITION_CONFIGURE,
            "inactive",
        )
        self._until(connected, self._unconnected)

    def wait_for(self, states: Mapping[str, str]) -> None:
        """Wait until nodes that manage themselves have reached these states."""
        self._until(
            lambda: all(self.state(name) == state for name, state in states.items()),
            lambda: f"waiting for {dict(states)}",
        )

    def wait_until_done(self, ticks: int, progress: Callable[[int, int], None] | None) -> None:
        """Wait for the plant's last tick, then until the recorder has every message."""
        shown = -1
        moved_s = time.monotonic()
        while not self._finished():
            self.spin()
            tick = self._plant().tick or self._report_of(RECORDER).ticks or 0
            if tick != shown:
                shown, moved_s = tick, time.monotonic()
                if progress is not None:
                    progress(tick, ticks)
            elif self.state(PLANT) not in ("active", ""):
                moved_s = time.monotonic()  # paused, by whoever has the right to
            elif time.monotonic() - moved_s > STUCK_S:
                msg = f"the loop has stood still at tick {tick} for {STUCK_S:g} s{self._refusals()}"
                raise RunError(msg)
        deadline = time.monotonic() + RECORDER_PATIENCE_S
        while not self._recorder().complete:
            if time.monotonic() > deadline:
                msg = f"messages are missing in the bag: {self._recorder().missing}"
                raise RunError(msg)
            self.spin()
        if progress is not None:
            progress(ticks, ticks)

    def state(self, name: str) -> str:
        """Life-cycle state of a node as it last reported it; empty as long as it has not."""
        return self._report_of(name).state

    def meet(self, names: Iterable[str]) -> None:
        """Wait until all these nodes, which run already, have reported their state."""
        self._until(
            lambda: all(self.state(name) for name in names),
            lambda: f"{', '.join(name for name in names if not self.state(name))} not heard of",
        )

    def set_parameters(self, name: str, values: Mapping[str, Any]) -> None:
        """Set parameters of a node, all of them or none."""
        client = self.node.create_client(SetParametersAtomically, f"{NAMESPACE}/{name}/set_parameters_atomically")
        try:
            self._until(client.service_is_ready, lambda: f"{name} takes no parameters")
            parameters = [Parameter(key, value=value).to_parameter_msg() for key, value in values.items()]
            request = SetParametersAtomically.Request(parameters=parameters)
            replies: list[Any] = []

            def answered() -> bool:
                # A node that has not found this client yet answers into the void.
                if time.monotonic() - asked_s >= ASK_AGAIN_S * len(replies):
                    replies.append(client.call_async(request))
                return any(reply.done() for reply in replies)

            asked_s = time.monotonic()
            self._until(answered, lambda: f"{name} does not answer")
            result = next(reply for reply in replies if reply.done()).result().result
            if not result.successful:
                msg = f"node {name}: {result.reason}"
                raise RunError(msg)
        finally:
            self.node.destroy_client(client)

    def let_go(self, names: Iterable[str]) -> None:
        """Leave nodes as they were before the run, ready for the next."""
        names = [name for name in names if self._is_managed(name)]
        self.change(names, Transition.TRANSITION_DEACTIVATE, "inactive")
        self.change(names, Transition.TRANSITION_CLEANUP, "unconfigured")

    # -- details ------------------------------------------------------------------------------------------------

    def _finished(self) -> bool:
        """Whether the plant has had its last tick; when it says nothing, whether the bag has."""
        plant = self._plant()
        return plant.finished or (plant.tick is None and self._recorder().complete)

    def _heard(self, message: DiagnosticArray) -> None:
        for status in message.status:
            name = status.name.rsplit("/", 1)[-1]
            if status.name != f"{NAMESPACE}/{name}" or name not in self._children or name in self._due_s:
                continue
            said = {item.key: item.value for item in status.values}
            report = HealthReport.read(said)
            if name in self._dead_pid and report.pid == self._dead_pid[name]:
                continue
            self.health[name], self._reported[name] = said, report
            self._heard_s[name] = time.monotonic()
            self._is_back(name)

    def _report_of(self, name: str) -> HealthReport:
        """Return what a node reported last."""
        return self._reported.get(name, NOTHING)

    def _plant(self) -> PlantReport:
        return PlantReport.read(self.health.get(PLANT, {}))

    def _recorder(self) -> RecorderReport:
        return RecorderReport.read(self.health.get(RECORDER, {}))

    def change(self, names: list[str], transition: int, state: str) -> None:
        """Request `transition` of each node as soon as its service is there; until all report `state`."""
        for name in names:
            self._replies.pop((name, transition), None)

        def done() -> bool:
            for name in names:
                reply = self._replies.get((name, transition))
                if self._is_plain(name):
                    continue
                if reply is None:
                    if self._clients[name].service_is_ready():
                        request = ChangeState.Request(transition=Transition(id=transition))
                        self._replies[name, transition] = self._clients[name].call_async(request)
                elif reply.done() and not reply.result().success:
                    raise RunError(self._failed(name, "cannot start"))
            return all(reached(name) for name in names)

        def reached(name: str) -> bool:
            if self._is_plain(name):
                return True
            if name in self._strange and not self._reports(name):
                reply = self._replies.get((name, transition))
                return reply is not None and reply.done()
            return self.state(name) == state

        self._until(done, lambda: f"{', '.join(n for n in names if not reached(n))} not {state}")

    def _connected(self, name: str) -> bool:
        """Whether every output of a node has the subscribers that this graph holds, on top of strangers' ones."""
        if name in self._strange:
            reads = sum(self._reads(name, topic) for topic in (*TOPICS, *OCCASIONAL))
            if not self._reports(name):
                return self._publishes_all(name)
            if reads < (self._report_of(name).subscriptions or 0):
                return False  # not all of them have been discovered here
        found = self._report_of(name).subscribers
        return all(found.get(topic, 0) >= n + self._strangers(topic) for topic, n in self._wanted(name).items())

    def _reads(self, name: str, topic: Topic) -> bool:
        """Whether a node subscribes to a topic: our own as the table says, somebody else's as the graph shows."""
        if name not in self._strange:
            return name in topic.subscribers
        readers = self.node.get_subscriptions_info_by_topic(f"{NAMESPACE}/{topic.name}")
        return any(_is(name, reader) for reader in readers)

    def _reports(self, name: str) -> bool:
        """Whether a node tells its state on /diagnostics, as ours do."""
        return any(_is(name, writer) for writer in self.node.get_publishers_info_by_topic("/diagnostics"))

    def _publishes_all(self, name: str) -> bool:
        """Whether every topic that is a node's to publish has it for a publisher."""
        return all(
            any(_is(name, writer) for writer in self.node.get_publishers_info_by_topic(f"{NAMESPACE}/{topic.name}"))
            for topic in TOPICS
            if topic.publisher == name
        )

    def _is_managed(self, name: str) -> bool:
        return bool(self._clients[name].service_is_ready())

    def _is_plain(self, name: str) -> bool:
        """Whether a node of somebody else's is there and has no life cycle."""
        return name in self._strange and not self._is_managed(name) and self._publishes_all(name)

    def _strangers(self, topic: str) -> int:
        """Subscribers of a topic that are none of our nodes, such as `ros2 topic echo` or `acftc topics`."""
        full = "/clock" if topic == "clock" else f"{NAMESPACE}/{topic}"
        readers = self.node.get_subscriptions_info_by_topic(full)
        return sum(reader.node_name not in self._children or reader.node_namespace != NAMESPACE for reader in readers)

    def _wanted(self, name: str) -> dict[str, int]:
        recorded = 1 if RECORDER in self._children else 0
        wanted = {
            topic.name: recorded + sum(self._reads(reader, topic) for reader in self._children)
            for topic in TOPICS
            if topic.publisher == name
        }
        if name == PLANT and "clock" in self._report_of(name).subscribers:
            wanted["clock"] = recorded
        return wanted

    def _unconnected(self) -> str:
        return ", ".join(name for name in self._children if not self._connected(name)) + " not connected"

    def _until(self, condition: Callable[[], bool], what: Callable[[], str]) -> None:
        started_s = time.monotonic()
        while not condition():
            self.spin()
            if time.monotonic() - started_s > self.patience_s:
                msg = f"the nodes did not get ready in {self.patience_s:g} s: {what()}"
                raise RunError(msg)

    #: How long all nodes together may take for one step; they only load, but the machine may have much else to do.
    patience_s = 60.0

    def spin(self) -> None:
        """Handle one message or event; complain when a process has died."""
        self._executor.spin_once(timeout_sec=LOOK_S)
        if self._is_over():
            msg = "it was told to end"
            raise RunError(msg)
        now_s = time.monotonic()
        for name, child in self._children.items():
            if child is not None and name not in self._due_s and child.process.poll() is not None:
                self._died(child, now_s)
        self._end_what_hangs(now_s)
        for name, due_s in list(self._due_s.items()):
            if now_s >= due_s:
                self._start_again(name)
        if self._is_running and now_s - self._looked_s >= REPORT_PERIOD_S:
            self._looked_s = now_s
            strangers = self._look_for_strangers()
            if strangers or strangers != self.strangers or self.restarts:
                for stranger in sorted(set(strangers) - set(self.strangers)):
                    self._say(stranger)
                self.strangers = strangers
                self._report()

    # -- restarts -----------------------------------------------------------------------------------------------

    def _end_what_hangs(self, now_s: float) -> None:
        """End active nodes that have stopped reporting: they are started again, as dead ones are."""
        if now_s - self._spun_s > PAUSE_S:
            self._heard_s = dict.fromkeys(self._heard_s, now_s)
        self._spun_s = now_s
        if not self._is_running or self._revive is None:
            return
        for name, heard_s in list(self._heard_s.items()):
            child = self._children[name]
            if now_s - heard_s > HUNG_S and self.state(name) == "active" and child is not None and name != PLANT:
                del self._heard_s[name]
                self._hung.add(name)
                with suppress(ProcessLookupError):
                    os.killpg(child.process.pid, signal.SIGKILL)  # whoever hangs does not listen

    def _died(self, child: Child, now_s: float) -> None:
        """Have a dead node started again, where that helps; else the run is over."""
        wait_s = None
        if self._is_running and self._revive is not None and child.name != PLANT:
            wait_s = self._policy.wait_s(child.name, now_s)
            if wait_s is None:
                raise RunError(self._failed(child.name, f"died {self._policy.deaths(child.name)} times"))
        if wait_s is None:
            raise RunError(self._failed(child.name, "died"))
        self._due_s[child.name] = now_s + wait_s
        self._death_s[child.name] = now_s
        self._heard_s.pop(child.name, None)
        self._dead_pid[child.name] = self._report_of(child.name).pid or child.process.pid
        self.health.pop(child.name, None)
        self._reported.pop(child.name, None)
        reason = f"{child.end}: {child.last_words()}"
        if child.name in self._hung:
            self._hung.remove(child.name)
            reason = f"ended, as it had not reported for {HUNG_S:g} s"
        restart = Restart(child.name, self._run_s(), reason)
        self.restarts.append(restart)
        self._say(f"node {restart.node} died ({restart.reason}) and is started again")

    def _start_again(self, name: str) -> None:
        assert self._revive is not None
        del self._due_s[name]
        first_ns = self._plant().first_ns
        changed = {"run_start_ns": first_ns} if first_ns is not None and name != RECORDER else {}
        self._children[name] = self._revive(name, {**self._changed.get(name, {}), **changed})
        self._report()

    def _is_back(self, name: str) -> None:
        """Note that a node that had died works again."""
        for restart in self.restarts:
            if restart.node == name and math.isnan(restart.back_s) and (self._report_of(name).ticks or 0) > 0:
                # Not by `_run_s` again: after a pause the first tick is another.
                restart.back_s = round(restart.died_s + time.monotonic() - self._death_s[name], 3)
                self._say(f"node {name} is back in service after {restart.back_s - restart.died_s:.1f} s")
                self._report()

    def _run_s(self) -> float:
        """Time since the first tick, by the plant's word for when that was on the monotonic clock."""
        return round(time.monotonic() - self._plant().epoch_monotonic_s, 3)

    def _report(self) -> None:
        """Tell on /diagnostics, and so in the bag, what was done."""
        waiting = [restart.node for restart in self.restarts if math.isnan(restart.back_s)]
        told = BringupReport(tuple(self.restarts), tuple(self.strangers))
        message = DiagnosticArray()
        message.header.stamp = self.node.get_clock().now().to_msg()
        message.status = [
            DiagnosticStatus(
                level=DiagnosticStatus.WARN if waiting or self.strangers else DiagnosticStatus.OK,
                name=f"{NAMESPACE}/{BRINGUP}",
                message=f"restarting {', '.join(waiting)}" if waiting else "; ".join(self.strangers) or "all is well",
                values=[KeyValue(key=key, value=value) for key, value in told.values().items()],
            )
        ]
        self._diagnostics.publish(message)

    def _parameters_changed(self, event: ParameterEvent) -> None:
        """Remember what was set while a node ran: it must hold after a restart."""
        name = event.node.rsplit("/", 1)[-1]
        if self._is_running and event.node == f"{NAMESPACE}/{name}" and name in self._children:
            new = {parameter.name: parameter_value_to_python(parameter.value) for parameter in event.changed_parameters}
            self._changed.setdefault(name, {}).update(new)

    def _look_for_strangers(self) -> list[str]:
        """Nodes and publishers that do not belong to this graph, one line each."""
        known = {*self._children, BRINGUP, PAGE}
        found = [
            f"foreign node {NAMESPACE}/{name}"
            for name, namespace in sorted(set(self.node.get_node_names_and_namespaces()))
            if namespace == NAMESPACE and name not in known
        ]
        for topic in (*TOPICS, *OCCASIONAL):
            full = f"{NAMESPACE}/{topic.name}"
            writers = self.node.get_publishers_info_by_topic(full)
            own = [writer for writer in writers if _is(topic.publisher, writer)]
            if len(own) > 1 and not any(restart.node == topic.publisher for restart in self.restarts):
                found.append(f"{full}: {len(own)} publishers called {topic.publisher}")
            found += [
                f"{full}: second publisher {_called(writer)}"
                for writer in writers
                if not _is(topic.publisher, writer) and "UNKNOWN" not in writer.node_name
            ]
            ours = type_hash(topic.type)
            for endpoint in (*writers, *self.node.get_subscriptions_info_by_topic(full)):
                if endpoint.topic_type != topic.type:
                    found.append(f"{full}: {_called(endpoint)} has type {endpoint.topic_type} instead of {topic.type}")
                elif str(endpoint.topic_type_hash).startswith("RIHS") and str(endpoint.topic_type_hash) != ours:
                    found.append(f"{full}: {_called(endpoint)} has another version of {topic.type}")
        return found

    def _refusals(self) -> str:
        """What the nodes have refused: why a loop may stand still."""
        said = [
            f"{name} refused {report.rejected_inputs} messages, the last: {report.last_rejected}"
            for name, report in self._reported.items()
            if report.rejected_inputs
        ]
        return "; " + "; ".join(said) if said else ""

    def _failed(self, name: str, how: str) -> str:
        child = self._children[name]
        if child is None:
            return f"node {name} {how}: see its own output; a run wants it unconfigured (parameter autostart: false)"
        return f"node {name} {how}: {child.last_words()} (log: {child.log})"


def _is(name: str, endpoint: Any) -> bool:
    """Whether a publisher or subscriber belongs to our node of that name."""
    return bool(endpoint.node_name == name and endpoint.node_namespace == NAMESPACE)


def _called(endpoint: Any) -> str:
    return f"{endpoint.node_namespace.rstrip('/')}/{endpoint.node_name}"
