"""The page's own ROS node: listens to the loop, and asks its nodes for what the page's controls want.

It runs in a thread of its own and never holds a publisher up: its subscriptions are best-effort. It may read the truth
(`fault/...`), since it only shows it.
"""

import queue
import struct
import threading
import time
from collections.abc import Callable, Coroutine, Iterable, Mapping, Sequence
from contextlib import ExitStack
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from std_srvs.srv import SetBool

from ac_common.errors import UserError, one_line
from ac_common.faults import BY_KIND
from ac_common.fdi_status import status_row
from ac_common.health import HealthReport
from ac_common.topics import (
    BY_NAME,
    COMPENSATOR,
    DIAGNOSTICS,
    INJECTOR,
    NAMESPACE,
    PAGE,
    RECORDER,
    Topic,
    topics_in,
)
from ac_common.wire import read_diagnostics, stamp_ns, value_offsets
from ac_ros_common.client_node import client_node
from ac_ros_common.inputs import Gate, Subscriptions
from ac_ros_common.messages import message_class
from ac_ros_common.qos import PLAIN_QOS
from bringup.dash.events import Events
from bringup.dash.reset import reset
from bringup.dash.rows import TOPIC_NAMES, Rows, threshold_values
from bringup.dash.view import WATCHED, Heard, View
from bringup.launch.process_table import ACTIVATION_ORDER

#: Never holds a publisher up; deep enough for the bursts of a lockstep run.
QOS = QoSProfile(depth=200, reliability=ReliabilityPolicy.BEST_EFFORT)
#: How long the loop's messages are waited for before everything else gets its turn, s.
WAIT_S = 0.02
#: How long a node may take to answer a control, s.
ANSWER_S = 10.0


class Link:
    """The page's node and its thread.

    Parameters
    ----------
    domain : int
        ROS domain of the graph.
    is_starting : bool
        Whether the graph has only just been started: until it is heard of, it is being set up, and not missing.

    Attributes
    ----------
    rows : Rows
        What the loop has published, for the plots.
    events : Events
        What has happened in it.
    """

    def __init__(self, domain: int, is_starting: bool = False) -> None:
        self.domain = domain
        self._is_starting = is_starting
        self.rows = Rows()
        self.events = Events()
        self._heard = Heard()
        self._jobs: queue.SimpleQueue[Coroutine[Any, Any, None]] = queue.SimpleQueue()
        self._turns: list[Any] = []  # what waits for the thread's next turn
        self._moving = False  # whether nodes are being paused or resumed
        self._ends = threading.Event()
        self._resetting: threading.Thread | None = None
        self._stack = ExitStack()
        self._node, self._executor = self._stack.enter_context(client_node(PAGE, NAMESPACE, domain))
        self._loop = Subscriptions(self._node.context, self._take)
        self._readers: list[Callable[[bytes], None]] = []
        for name in TOPIC_NAMES:
            topic = BY_NAME[name]
            kind, group = message_class(topic.type), Gate(is_open=False)
            full = f"{NAMESPACE}/{name}"
            self._loop.add(self._node.create_subscription(kind, full, _nothing, QOS, callback_group=group))
            self._readers.append(self._read_status if topic.type == DIAGNOSTICS else _reader(topic, self.rows))
        self._node.create_subscription(DiagnosticArray, "/diagnostics", self._hear_health, PLAIN_QOS)
        self._node.create_subscription(ParameterEvent, "/parameter_events", self._hear_parameters, PLAIN_QOS)
        self._clients: dict[str, Any] = {}
        self._thread = threading.Thread(target=self._run, name="link", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread and the node."""
        self._ends.set()
        self._thread.join()
        self._stack.close()

    # -- what there is to see -----------------------------------------------------------------------------------

    def view(self) -> View:
        """Return what is going on now."""
        sets_up = self._resetting is not None and self._resetting.is_alive()
        return self._heard.view(sets_up=sets_up, is_starting=self._is_starting)

    def say(self, message: str, failed: bool = False) -> None:
        """Let the page show a line."""
        self._heard.say(message, failed)

    # -- controls -----------------------------------------------------------------------------------------------

    def inject(self, fault: str, values: Mapping[str, Any], words: str) -> None:
        """Start a live fault, or let the running one follow: its parameters, and `words` in the units of people."""
        self._jobs.put(self._inject(fault, values, words))

    def stop_fault(self, fault: str) -> None:
        """End a live fault."""
        self._jobs.put(self._switch(fault, f"{BY_KIND[fault].symbol} ends with the next tick", on=False))

    def change(self, node: str, values: Mapping[str, Any], done: str) -> None:
        """Set live parameters of a node; `done` is what to say then."""
        self._jobs.put(self._change(node, values, done))

    def pause(self) -> None:
        """Stop the plant, which sets the pace for all, then the others, which would go on without it for a while."""
        names = [name for name in reversed(ACTIVATION_ORDER) if name != RECORDER and self._heard.is_there(name)]
        self._jobs.put(self._transition(names, Transition.TRANSITION_DEACTIVATE, "inactive", "paused"))

    def resume(self) -> None:
        """Let all go on, the plant last."""
        names = [name for name in ACTIVATION_ORDER if name != RECORDER and self._heard.is_there(name)]
        self._jobs.put(self._transition(names, Transition.TRANSITION_ACTIVATE, "active", "goes on"))

    def start_anew(self) -> None:
        """Begin again, at rest, without live faults and changes; takes some seconds, in a thread."""
        view = self.view()
        if not view.may_reset:
            why = "the run is being recorded" if view.recorded else f"the graph is {view.phase}"
            self.say(f"cannot start anew: {why}", failed=True)
            return
        names = [name for name in self._heard.health if self._heard.is_there(name)]
        topics = topics_in(view.in_car, view.design)
        self._resetting = threading.Thread(target=self._start_anew, args=(names, topics), name="reset", daemon=True)
        self._resetting.start()

    def _start_anew(self, names: Iterable[str], topics: Sequence[Topic]) -> None:
        self.say("setting up ...")
        try:
            reset(names, self.domain, topics)
        except UserError as problem:
            self.say(one_line(problem), failed=True)
        else:
            self._jobs.put(self._switch_back())
            self._heard.live_faults = frozenset()
            self.say("started anew, at rest")

    async def _switch_back(self) -> None:
        """Let the compensator act, or not, as it did when the page came."""
        await self._set(COMPENSATOR, {"accommodate": self._heard.accommodated_first})

    async def _inject(self, fault: str, values: Mapping[str, Any], words: str) -> None:
        if await self._set(INJECTOR, {f"{fault}.{key}": value for key, value in values.items()}):
            if fault in self._heard.live_faults:
                self.say(f"{words}: the running fault follows")
            else:
                await self._switch(fault, f"{words} starts with the next tick", on=True)

    async def _switch(self, fault: str, words: str, on: bool) -> None:
        reply = await self._ask(SetBool, f"{INJECTOR}/{fault}", SetBool.Request(data=on))
        if reply is None:
            return
        if reply.success:
            faults = self._heard.live_faults
            self._heard.live_faults = faults | {fault} if on else faults - {fault}
            self.events.injected(self.rows.newest_ns, self._heard.live_faults)
        self.say(words if reply.success else reply.message, failed=not reply.success)

    async def _change(self, node: str, values: Mapping[str, Any], done: str) -> None:
        if await self._set(node, values):
            self.say(done)

    async def _set(self, node: str, values: Mapping[str, Any]) -> bool:
        parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        request = SetParametersAtomically.Request(parameters=parameters)
        reply = await self._ask(SetParametersAtomically, f"{node}/set_parameters_atomically", request)
        if reply is None:
            return False
        if reply.result.successful:
            self._heard.parameters.setdefault(node, {}).update(values)
        else:
            self.say(one_line(reply.result.reason), failed=True)
        return bool(reply.result.successful)

    async def _transition(self, names: Iterable[str], transition: int, state: str, what: str) -> None:
        """Bring nodes to a state one after the other; what is asked for meanwhile waits its turn."""
        while self._moving:
            await self._moment()
        self._moving = True
        try:
            request = ChangeState.Request(transition=Transition(id=transition))
            for name in names:
                reply = await self._ask(ChangeState, f"{name}/change_state", request)
                if reply is None:
                    return
                if not reply.success and HealthReport.read(self._heard.health.get(name, {})).state != state:
                    self.say(f"{name} refuses", failed=True)
                    return
            self.say(what)
        finally:
            self._moving = False

    async def _get(self, node: str) -> None:
        names = WATCHED[node]
        request = GetParameters.Request(names=names)
        reply = await self._ask(GetParameters, f"{node}/get_parameters", request, quietly=True)
        if reply is None:
            self._heard.asked.discard(node)  # with its next report it is asked again
            return
        values = map(parameter_value_to_python, reply.values)
        self._heard.take_parameters(
            node, {name: value for name, value in zip(names, values, strict=False) if value is not None}
        )

    async def _ask(self, kind: Any, service: str, request: Any, quietly: bool = False) -> Any:
        """Answer of a service; None, with a line on the page unless `quietly`, when there is none in time."""
        client = self._clients.get(service)
        if client is None:
            client = self._clients[service] = self._node.create_client(kind, f"{NAMESPACE}/{service}")
        deadline = time.monotonic() + ANSWER_S
        while not client.service_is_ready() and time.monotonic() < deadline:
            await self._moment()
        if client.service_is_ready():
            future = client.call_async(request)
            while not future.done() and time.monotonic() < deadline:
                await self._moment()
            if future.done():
                return future.result()
            client.remove_pending_request(future)
        if not quietly:
            self.say(f"{service.partition('/')[0]} does not answer", failed=True)
        return None

    async def _moment(self) -> None:
        """Come back in the next turn of the thread."""
        turn = Future(executor=self._executor)
        self._turns.append(turn)
        await turn

    # -- the thread ---------------------------------------------------------------------------------------------

    def _run(self) -> None:
        while not self._ends.is_set():
            self._loop.wait(WAIT_S)
            while not self._jobs.empty():
                self._executor.create_task(self._jobs.get())
            turns, self._turns = self._turns, []
            for turn in turns:
                turn.set_result(None)
            self._executor.spin_once(timeout_sec=0.0)

    def _take(self, messages: list[Any]) -> bool:
        """Read what has arrived, in order of time: after a stall it is there topic by topic, seconds of each."""
        for number, data, *_ in sorted(messages, key=lambda message: stamp_ns(message[1])):
            self._readers[number](data)
        return False

    def _read_status(self, data: bytes) -> None:
        try:
            time_ns = stamp_ns(data)
            status = status_row(read_diagnostics(data)[0].values, time_ns / 1e9)
        except (ValueError, IndexError):
            return
        self._heard.status = status
        self.events.decided(time_ns, status)
        self.rows.add(time_ns, threshold_values(status))

    def _hear_health(self, message: DiagnosticArray) -> None:
        for status in message.status:
            name = status.name.rsplit("/", 1)[-1]
            if status.name != f"{NAMESPACE}/{name}":
                continue
            values = {item.key: item.value for item in status.values}
            if self._heard.hear_health(name, values):
                self._jobs.put(self._get(name))
            self.events.announced(name, HealthReport.read(values).announced)
            self.events.injected(self.rows.newest_ns, self._heard.live_faults)

    def _hear_parameters(self, event: ParameterEvent) -> None:
        name = event.node.rsplit("/", 1)[-1]
        if event.node != f"{NAMESPACE}/{name}" or name not in WATCHED:
            return
        for parameter in (*event.new_parameters, *event.changed_parameters):
            if parameter.name in WATCHED[name]:
                value = parameter_value_to_python(parameter.value)
                self._heard.parameters.setdefault(name, {})[parameter.name] = value


def _nothing(message: Any) -> None:
    """Stand in as the callback of a subscription from which `Subscriptions` takes."""


def _reader(topic: Topic, rows: Rows) -> Callable[[bytes], None]:
    """Make the function that adds a message of one topic to the rows."""
    offsets: list[int] = []
    length = 0

    def read(data: bytes) -> None:
        nonlocal offsets, length
        if len(data) != length:  # the first one, or one from somebody else
            try:
                offsets, length = value_offsets(topic, data), len(data)
            except (ValueError, IndexError):
                return
        values = [struct.unpack_from("<d", data, offset)[0] for offset in offsets]
        rows.add(stamp_ns(data), dict(zip(topic.series, values, strict=True)))

    return read
