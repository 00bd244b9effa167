"""What all nodes of the loop share: parameters, endpoints, life cycle, health, and a clean end.

A node is a thin shell around pure step functions: it names its parameters, builds its pure object in `configure` and
says with `on_tick` which topics make up a tick's input and what to do then.
"""

import errno
import gc
import json
import math
import os
import sys
import threading
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from queue import SimpleQueue
from typing import Any, NoReturn

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.exceptions import (
    InvalidParameterTypeException,
    InvalidParameterValueException,
    ParameterException,
)
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from ac_common.blas_threads import one_blas_thread
from ac_common.design_file import design_name, from_file, to_bytes
from ac_common.files import write_whole
from ac_common.health import AS_USUAL
from ac_common.topics import BY_NAME, OCCASIONAL, TOPICS, Topic
from ac_common.wire import Packer, packer
from ac_ros_common.exit_watchdog import exit_within
from ac_ros_common.health_publisher import Health
from ac_ros_common.inputs import Gate, LoopInputs, Subscriptions
from ac_ros_common.messages import message_class
from ac_ros_common.parameters import COMMON, Parameter
from ac_ros_common.process_exit import DISK_FULL, end_with_parent, leave
from ac_ros_common.rclpy_init import ArgumentError, init
from ac_ros_common.realtime import Care, set_own_priority, set_priority, sleep_until
from ac_ros_common.tick_sync import TickSet, Timeline, WallClockSet

#: How far behind a subscriber (the recorder above all) may fall before a message is lost, in ticks.
DEPTH = 1000
#: A loop topic that is silent for longer misses its deadline.
DEADLINE_S = 1.0
#: Time between two health reports.
HEALTH_PERIOD_S = 1.0
#: Services, timers and events get their turn so often while the loop runs.
OTHERS_PERIOD_S = 0.02
#: They wait for the end of a tick, but not longer than this when there is none.
OTHERS_PATIENCE_S = 0.1
#: How long their turn may take; a deadline that is nearer comes first.
OTHERS_TAKE_S = 0.003
#: How long a node that is not active waits at a time. rclpy wakes those who wait before it says that the process is to
#: end: who then waits again without bound misses it.
IDLE_S = 0.5
#: How often the memory file is written, and how old it may be, s.
MEMORY_PERIOD_S, MEMORY_AGE_S = 0.5, 30.0
#: How long the middleware may take to let go of a node: less than `stop` waits, which leaves the rest to `stopped`.
LEAVE_S = 2.0
#: Exit code of a node that was given parameters it cannot work with.
BAD_INPUT = 2
#: The last bit of the time to a deadline is slept through on a timer that is more exact than the middleware's.
DEADLINE_MARGIN_S = 0.0005

LOOP_QOS = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
    history=HistoryPolicy.KEEP_LAST,
    depth=DEPTH,
    deadline=Duration(seconds=DEADLINE_S),
)
#: Of /clock and /diagnostics: reliable, without a deadline.
PLAIN_QOS = QoSProfile(reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST, depth=DEPTH)


class NodeShell(LifecycleNode):  # type: ignore[misc]
    """A managed node of the loop. Subclasses override `configure`, and `started` where there is something to start."""

    def __init__(self, name: str, parameters: Sequence[Parameter]) -> None:
        super().__init__(name)
        self.problem = ""  # why the last transition failed
        self.bad_input = False  # and whether what the user gave is to blame
        self.health = Health()
        self._scheduled = "normal"
        self._fifo = 0  # the priority that the system has permitted
        self._care = Care()
        self._parameters_ = {p.name: p for p in (*COMMON, *parameters)}
        self.add_on_set_parameters_callback(self._check_choices)
        for parameter in self._parameters_.values():
            self.declare_parameter(parameter.name, parameter.default, parameter.descriptor())
        self._setup = Gate(is_open=True)  # events that matter until the loop runs
        self._memory_file = ""
        self._begins_anew = False
        self._kept_ns = 0
        self._to_keep: SimpleQueue[str | None] = SimpleQueue()
        self._writer: threading.Thread | None = None
        self._is_writing = False
        self.running = False
        self.is_realtime = False  # whether this node's ticks are the wall clock's
        self.deadline_s = math.inf  # monotonic time at which `on_deadline` is due
        self._new_inputs()
        self._senders: dict[str, tuple[Publisher, Packer]] = {}
        self._subscribed: list[Subscription] = []
        self._diagnostics = self._publisher(DiagnosticArray, "/diagnostics", PLAIN_QOS)
        # By default a timer waits by the wall clock: set back by an hour, it would be silent for an hour.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._health_timer = self.create_timer(HEALTH_PERIOD_S, self.report_health, clock=steady)

    # -- for the nodes ------------------------------------------------------------------------------------------

    def configure(self) -> None:
        """Build what the node works with; a ValueError here becomes the node's one-line complaint."""

    def started(self) -> None:
        """Begin: the node has just become active."""

    def stopped(self) -> None:
        """Stop: the node has just become inactive."""

    def destroy_node(self) -> None:
        """Let go of everything in the middleware."""
        super().destroy_node()
        # rclpy forgets this one, and it holds the node: nobody would be told of its end, and shared memory would stay.
        self._state_machine.destroy_when_not_in_use()

    def on_deadline(self) -> None:
        """Do what `deadline_s` was set for."""

    def work(self, executor: SingleThreadedExecutor) -> None:
        """Do some of the node's work: the loop's messages while it is active, and everything else now and then."""
        if not self.running:
            executor.spin_once(timeout_sec=IDLE_S)
            return
        due_s = time.monotonic() + OTHERS_PERIOD_S
        latest_s = due_s + OTHERS_PATIENCE_S
        while self.running and rclpy.ok() and (now := time.monotonic()) < latest_s:
            if self.deadline_s - now < DEADLINE_MARGIN_S:
                sleep_until(self.deadline_s)
                self.on_deadline()
            tick_due_s = self.inputs.due_s()
            if tick_due_s <= now:
                self.loop_subscriptions.take()  # what has come meanwhile comes first
                self.inputs.act_on_due()
                tick_due_s = self.inputs.due_s()
            until_s = min(latest_s, self.deadline_s - DEADLINE_MARGIN_S, tick_due_s)
            tick_is_over = self.loop_subscriptions.wait(until_s - now, self.inputs.awaited())
            # Between its part in this tick and the next one a node holds nobody up.
            if tick_is_over and time.monotonic() >= due_s:
                break
        if min(self.deadline_s, self.inputs.due_s()) - time.monotonic() > OTHERS_TAKE_S:
            self._do_others(executor)

    def _do_others(self, executor: SingleThreadedExecutor) -> None:
        """Do what is not the loop's: a step behind it, lest a health report here holds up a tick in another node."""
        if self._fifo > 1:
            set_own_priority(self._fifo - 1)
        executor.spin_once(timeout_sec=0.0)
        if self._fifo > 1:  # and not deactivated meanwhile
            set_own_priority(self._fifo)

    def health_values(self) -> dict[str, str]:
        """Further figures for /diagnostics."""
        return {}

    def value(self, name: str) -> Any:
        """Value of a parameter."""
        return self.get_parameter(name).value

    def design(self, kind: Any) -> Any:
        """Return the design of class `kind` in the file that the parameter `design_file` names."""
        file = self.value("design_file")
        if not file:
            example = design_name(self.get_name(), "med")
            raise ValueError(f"no design_file given; `acftc design --out designs` makes one: designs/{example}")
        design = from_file(kind, file, self.value("sample_time_s"))
        if self.value("design_copy"):
            write_whole(Path(self.value("design_copy")), to_bytes(design))
        return design

    @property
    def run_start_ns(self) -> int:
        """Stamp of the first tick of the run under way that the node joins; -1 when it begins with the run.

        A node that was cleaned up begins anew, whatever its parameter says of the run before.
        """
        return -1 if self._begins_anew else int(self.value("run_start_ns"))

    @property
    def sample_time_s(self) -> float:
        """Sample time of the loop."""
        return float(self.value("sample_time_s"))

    def on_tick(
        self,
        topics: Sequence[str],
        act: Callable[..., None],
        *,
        holds_s: Mapping[str, float] | None = None,
        optional: tuple[str, ...] = (),
        patience: float = 0.5,
        blind: Callable[[int], None] | None = None,
    ) -> None:
        """Call ``act(stamp_ns, values...)`` for each tick of which all of `topics` have arrived.

        On the wall clock a tick does not wait for ever: see `WallClockSet` for `optional` and `blind`.

        Parameters
        ----------
        topics, act
            See above.
        holds_s
            How long the newest value of a topic may stand in for a missing one; `math.inf`: for ever.
        optional
            Topics whose values may be None.
        patience
            Part of the sample time after which a tick goes on without what is missing.
        blind
            Called with the stamp of a tick that lacks something else.
        """
        described = tuple(BY_NAME[name] for name in topics)
        tick_set: TickSet | WallClockSet = TickSet(described, self._timed(act))
        if self.is_realtime:
            period_ns = round(self.sample_time_s * 1e9)
            if self.inputs.timeline is None:
                self.inputs.timeline = Timeline(period_ns)
            holds = {
                name: None if math.isinf(hold_s) else math.ceil(hold_s * 1e9 / period_ns)
                for name, hold_s in (holds_s or {}).items()
            }
            timed, patience_ns = self._timed(act), int(patience * period_ns)
            tick_set = WallClockSet(described, timed, self.inputs.timeline, patience_ns, holds, optional, blind)
        self.inputs.add(tick_set)
        for topic in tick_set.topics:
            self.loop_subscriptions.add(self.subscribe(topic.type, topic.name, qos_of(topic)))

    def enter(self, mode: str, time_ns: int) -> None:
        """Announce that the node does something else from this tick on; empty: all is as usual again."""
        if mode == self.health.mode:
            return
        what = mode or AS_USUAL
        self.health.announce(time_ns / 1e9, what)
        print(f"{self.get_name()}: {time_ns / 1e9:.3f} s: {what}", file=sys.stderr, flush=True)
        self.health.mode = mode
        self.soon(self.report_health)

    def keep(self, time_ns: int, memory: Callable[[], Mapping[str, Any]]) -> None:
        """Write `memory` of this tick to the memory file, when it is time to."""
        if not self._memory_file or time_ns - self._kept_ns < MEMORY_PERIOD_S * 1e9:
            return
        if self._writer is None or self._is_writing:
            return  # the disk is busy: the next one then
        self._kept_ns = time_ns
        self._is_writing = True
        self._to_keep.put(json.dumps({"time_ns": time_ns, **memory()}))

    def _write_memories(self) -> None:
        """Write what `keep` gives, in a thread of its own: a disk may take its time, a tick may not."""
        while (content := self._to_keep.get()) is not None:
            self._write_memory(content)
            self._is_writing = False

    def _end_writer(self) -> None:
        if self._writer is not None:
            self._to_keep.put(None)
            self._writer.join()
            self._writer = None

    def _write_memory(self, content: str) -> None:
        new = Path(f"{self._memory_file}.new")
        try:
            new.write_text(content, encoding="utf-8")
            new.replace(self._memory_file)
        except OSError as problem:  # a full disk must not end the loop: a successor would just know less
            self.health.last_rejected = f"memory_file: {problem.strerror}"

    def recollect(self, time_ns: int, remember: Callable[[dict[str, Any]], None]) -> dict[str, Any] | None:
        """Give `remember` what this node knew before it crashed, and return it, with the `time_ns` of then.

        None when there is nothing recent, or nothing that `remember` takes (a ValueError says so).
        """
        try:
            memory: dict[str, Any] = json.loads(Path(self._memory_file).read_text(encoding="utf-8"))
            if not 0 < time_ns - memory["time_ns"] < MEMORY_AGE_S * 1e9:
                return None
            remember(memory)
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return memory

    def missed_ticks(self, since_ns: int, time_ns: int) -> int:
        """How many ticks lie between two."""
        return round((time_ns - since_ns) / 1e9 / self.sample_time_s) - 1

    def subscribe(self, type_name: str, name: str, qos: QoSProfile) -> Subscription:
        """Create a subscription that the executor leaves alone, for `Subscriptions` to take from."""
        group = Gate(is_open=False)
        kind = message_class(type_name)
        subscription = self.create_subscription(kind, name, _nothing, qos, callback_group=group)
        self._subscribed.append(subscription)
        return subscription

    def send(self, time_ns: int, topic: str, *values: Any) -> None:
        """Publish the values of one topic, stamped."""
        publisher, pack = self._senders[topic]
        publisher.publish(pack(time_ns, values))

    def add_output(self, topic: Topic, name: str | None = None) -> None:
        """Create the publisher of a topic, once; `name` where it differs from the topic's own."""
        if topic.name in self._senders:
            return
        qos = qos_of(topic) if name is None else PLAIN_QOS
        publisher = self._publisher(message_class(topic.type), name or topic.name, qos)
        self._senders[topic.name] = (publisher, packer(topic))

    # -- life cycle ---------------------------------------------------------------------------------------------

    def _LifecycleNodeMixin__change_state(self, transition_id: int) -> TransitionCallbackReturn:
        """Refuse a transition that the present state does not have; in rclpy alone the exception ends the node."""
        if transition_id not in (number for number, *_ in self._state_machine.available_transitions):
            return TransitionCallbackReturn.FAILURE
        return super()._LifecycleNodeMixin__change_state(transition_id)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Create endpoints and the pure object."""
        return self._transition(super().on_configure, state, self._create)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Act on inputs from now on."""
        return self._transition(super().on_activate, state, self._start)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget inputs and pure object; the next configuration makes new ones."""
        return self._transition(super().on_cleanup, state, self._forget)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Leave inputs alone from now on."""
        return self._transition(super().on_deactivate, state, self._stop)

    def _transition(
        self, inherited: Callable[..., Any], state: LifecycleState, work: Callable[[], None]
    ) -> TransitionCallbackReturn:
        try:
            work()
        except Exception as problem:
            self.problem = _one_line(problem)
            self.bad_input = isinstance(problem, ValueError)
            if not isinstance(problem, ValueError):
                traceback.print_exc()
            print(f"{self.get_name()}: {self.problem}", file=sys.stderr, flush=True)
            return TransitionCallbackReturn.FAILURE
        return inherited(state)

    def _create(self) -> None:
        for topic in (*TOPICS, *OCCASIONAL):
            if topic.publisher == self.get_name():
                self.add_output(topic)
        self.is_realtime = "mode" in self._parameters_ and self.value("mode") == "realtime"
        self._memory_file = self.value("memory_file") if self.is_realtime and "memory_file" in self._parameters_ else ""
        self._kept_ns = 0
        self.configure()
        self.soon(self.report_health)

    def _new_inputs(self) -> None:
        self.inputs = LoopInputs(self.reject)
        self.loop_subscriptions = Subscriptions(self.context, self.inputs.take)

    def _forget(self) -> None:
        self._new_inputs()
        self.health.forget()
        while self._subscribed:
            self.destroy_subscription(self._subscribed.pop())
        self._begins_anew = True
        if self._memory_file:
            Path(self._memory_file).unlink(missing_ok=True)
        self.soon(self.report_health)

    def _start(self) -> None:
        self.loop_subscriptions.arrived()  # whatever came before is of no use now
        self.inputs.clear()
        self._setup.is_open = False
        self.running = True
        # What exists now lives as long as the node; the collector need not walk through it in a tick.
        gc.collect()
        gc.freeze()
        gc.disable()
        self._scheduled = set_priority(self.value("priority"))
        self._fifo = self.value("priority") if self._scheduled.startswith("SCHED_FIFO") else 0
        if self._memory_file:  # now: who starts a thread waits until it runs, which is nothing for a tick
            self._writer = threading.Thread(target=self._write_memories, daemon=True)
            self._writer.start()
        if self.value("realtime_care"):
            self._care.begin()
        self.started()
        self.soon(self.report_health)

    def _stop(self) -> None:
        self.running = False
        self._setup.is_open = True
        gc.enable()
        self._fifo = 0
        set_priority(0)
        self._end_writer()
        self._care.end()
        self.stopped()
        self.soon(self.report_health)

    def soon(self, call: Callable[[], None]) -> None:
        """Let the executor call `call` as soon as the present callback is over."""
        if self.executor is not None:
            self.executor.create_task(call)

    # -- health -------------------------------------------------------------------------------------------------

    @property
    def state(self) -> str:
        """Label of the life-cycle state."""
        return str(self._state_machine.current_state[1])

    def report_health(self) -> None:
        """Publish the node's health, and how many subscribers its outputs have found."""
        gc.collect(1)
        values = {
            "state": self.state,
            "pid": str(os.getpid()),
            "scheduling": self._scheduled,
            "realtime_care": self._care.state,
            **self.health.report(),
            **self.health_values(),
        }
        values["subscriptions"] = str(len(self.loop_subscriptions))
        values |= {key: str(count) for key, count in self.inputs.counts().items()}
        for topic, (publisher, *_) in self._senders.items():
            values[f"subscribers/{topic}"] = str(publisher.get_subscription_count())
        message = DiagnosticArray()
        message.header.stamp = self.get_clock().now().to_msg()
        message.status = [
            DiagnosticStatus(
                level=self._level(),
                name=self.get_fully_qualified_name(),
                message=self.problem or self.health.mode or self.state,
                values=[KeyValue(key=key, value=value) for key, value in values.items()],
            )
        ]
        self._diagnostics.publish(message)

    def _level(self) -> bytes:
        if self.problem:
            return bytes(DiagnosticStatus.ERROR)
        return bytes(DiagnosticStatus.WARN if self.health.mode else DiagnosticStatus.OK)

    def reject(self, topic: str, reason: str, text: str) -> None:  # noqa: ARG002
        """Count a message that is not acted upon, by a word for the reason; keep what was wrong with it."""
        self.health.rejected[reason] += 1
        self.health.last_rejected = text

    # -- details ------------------------------------------------------------------------------------------------

    def _publisher(self, type_: Any, name: str, qos: QoSProfile) -> Publisher:
        events = PublisherEventCallbacks(matched=lambda _: self.report_health())
        return self.create_publisher(type_, name, qos, callback_group=self._setup, event_callbacks=events)

    def _timed(self, act: Callable[..., None]) -> Callable[..., None]:
        budget_s = self.sample_time_s if self.is_realtime else math.inf

        def timed(*arguments: Any) -> None:
            started_s = time.monotonic()
            act(*arguments)
            self.health.worked(started_s, budget_s)
            if self.health.ticks == 1:
                self.soon(self.report_health)  # it is in service

        return timed

    def _check_choices(self, parameters: Any) -> Any:
        from rcl_interfaces.msg import SetParametersResult

        for given in parameters:
            known = self._parameters_.get(given.name)
            if known is None:
                continue
            if not known.live and self.state != "unconfigured":
                reason = f"{given.name} cannot be set while the node is {self.state}: clean it up first"
                return SetParametersResult(successful=False, reason=reason)
            if known.choices and given.value not in known.choices:
                reason = f"{given.name} is {given.value!r}; allowed: {', '.join(known.choices)}"
                return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)


def qos_of(topic: Topic) -> QoSProfile:
    """QoS of a topic of the loop; one that is not in every tick has no deadline."""
    return PLAIN_QOS if topic in OCCASIONAL else LOOP_QOS


def run_node(make: Callable[[], NodeShell]) -> NoReturn:
    """Run a node until it is told to end, and end the process.

    The exit code is 0 after SIGINT and SIGTERM, 1 when the node failed, 2 after bad input.
    """
    one_blas_thread()
    end_with_parent()
    made: list[NodeShell] = []
    code = _run(make, made)
    for node in made:
        try:
            node.stopped()
        except OSError as problem:  # what was kept back until now found no room either
            code = code or _report(node, problem)
    exit_within(code, LEAVE_S)
    for node in made:
        node.destroy_node()
    rclpy.try_shutdown()
    leave(code)


def _run(make: Callable[[], NodeShell], made: list[NodeShell]) -> int:
    node = None
    try:
        init()
        node = make()
        made.append(node)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        if node.value("autostart"):
            for trigger in (node.trigger_configure, node.trigger_activate):
                if trigger() != TransitionCallbackReturn.SUCCESS:
                    return BAD_INPUT if node.bad_input else 1
        while rclpy.ok():
            node.work(executor)
        return 0
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    except _rclpy.RCLError as problem:
        if not rclpy.ok():
            return 0  # told to end in the middle of a call into the middleware
        return _report(node, problem)
    except (InvalidParameterValueException, InvalidParameterTypeException, ParameterException) as problem:
        print(f"{_program()}: {_one_line(problem)}", file=sys.stderr, flush=True)
        return BAD_INPUT
    except ArgumentError as problem:
        print(f"{_program()}: {problem}", file=sys.stderr, flush=True)
        return BAD_INPUT
    except Exception as problem:
        return _report(node, problem)


def _report(node: NodeShell | None, problem: Exception) -> int:
    """Say why the node ends: the traceback for us, then one line for the user; its exit code."""
    try:
        if not isinstance(problem, ValueError):
            traceback.print_exc()
        print(f"{node.get_name() if node else _program()}: {_one_line(problem)}", file=sys.stderr, flush=True)
    except OSError:  # the log is on the disk that is full; what could not be said must not be tried again at exit
        sys.stderr = Path(os.devnull).open("w")  # noqa: SIM115
    return DISK_FULL if isinstance(problem, OSError) and problem.errno == errno.ENOSPC else 1


def _nothing(message: Any) -> None:
    """Stand in as the callback of a subscription from which `Subscriptions` takes."""


def _program() -> str:
    return sys.argv[0].rsplit("/", 2)[-2 if sys.argv[0].endswith("__main__.py") else -1]


def _one_line(problem: BaseException) -> str:
    text = " ".join(str(problem).split()) or type(problem).__name__
    return text if isinstance(problem, ValueError) else f"{type(problem).__name__}: {text}"
