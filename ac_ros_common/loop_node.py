"""What all nodes of the loop are: lifecycle, parameters, `on_tick`, and a clean end.

A node is a thin shell around pure step functions: it names its parameters, builds its pure object in `configure` and
says with `on_tick` which topics make up a tick's input and what to do then.
"""

import errno
import gc
import math
import os
import signal
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.exceptions import (
    InvalidParameterTypeException,
    InvalidParameterValueException,
    ParameterException,
)
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from ac_common.blas_threads import one_blas_thread
from ac_common.compiled import interpret_steps
from ac_common.design_file import DesignKind, loaded
from ac_common.health import AS_USUAL, HealthPart
from ac_common.topics import OCCASIONAL, TOPICS, Topic
from ac_common.wire import Packer, packer
from ac_ros_common._rclpy import ManagedNode, RCLError
from ac_ros_common.checkpoint import CheckpointFile
from ac_ros_common.exit_watchdog import exit_within
from ac_ros_common.health_publisher import Health, HealthPublisher
from ac_ros_common.inputs import Gate
from ac_ros_common.installation import begin_node, left_aside, program_name
from ac_ros_common.messages import message_class
from ac_ros_common.parameters import COMMON, Parameter, checked
from ac_ros_common.process_exit import DISK_FULL, end_with_parent, leave
from ac_ros_common.qos import PLAIN_QOS, qos_of
from ac_ros_common.rclpy_init import ArgumentError, init
from ac_ros_common.realtime import RealtimeSettings
from ac_ros_common.tick_loop import TickLoop

#: Time between two health reports.
HEALTH_PERIOD_S = 1.0
#: How long a node that is not active waits at a time. rclpy wakes those who wait before it says that the process is to
#: end: who then waits again without bound misses it.
IDLE_S = 0.5
#: Turns of the executor in which what a node has to do `soon` after its activation is done.
SETTLE_TURNS = 3
#: How long the middleware may take to let go of a node: less than `stop` waits, which leaves the rest to `stopped`.
LEAVE_S = 2.0
#: Exit code of a node that was given parameters it cannot work with.
BAD_INPUT = 2


class LoopNode(ManagedNode):
    """A managed node of the loop. Subclasses override `configure`, and `started` where there is something to start."""

    def __init__(self, name: str, parameters: Sequence[Parameter]) -> None:
        super().__init__(name)
        self.health = Health()
        self.is_bad_input = False  # whether what the user gave is to blame for the last transition's failure
        self.realtime = RealtimeSettings()
        self.checkpoint = CheckpointFile(None, self.health.not_kept)
        self._known = {p.name: p for p in (*COMMON, *parameters)}
        self.add_on_set_parameters_callback(lambda given: checked(self._known, given, self.state))
        for parameter in self._known.values():
            self.declare_parameter(parameter.name, parameter.default, parameter.descriptor())
        self._setup = Gate(is_open=True)  # events that matter until the loop runs
        self._begins_anew = False
        self.running = False
        self.is_realtime = False  # whether this node's ticks are the wall clock's
        self.loop = TickLoop(self.context, self.health.reject, self.on_deadline)
        self._senders: dict[str, tuple[Publisher, Packer]] = {}
        self._sent_ns = 0
        self._subscribed: list[Subscription] = []
        self._diagnostics = HealthPublisher(self, self._publisher(DiagnosticArray, "/diagnostics", PLAIN_QOS))
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

    def on_deadline(self) -> None:
        """Do what `loop.deadline_s` was set for."""

    def node_health(self) -> HealthPart | None:
        """Return what this node reports beside what all report."""

    def work(self, executor: SingleThreadedExecutor) -> None:
        """Do some of the node's work: the loop's messages while it is active, and everything else now and then."""
        if not self.running:
            executor.spin_once(timeout_sec=IDLE_S)
            for _ in range(SETTLE_TURNS if self.running else 0):  # it has just become active, and has to say so
                executor.spin_once(timeout_sec=0.0)
        elif self.loop.serve(lambda: self.running and rclpy.ok()):
            self._do_others(executor)

    def value(self, name: str) -> Any:
        """Return the value of a parameter."""
        return self.get_parameter(name).value

    def design(self, kinds: Sequence[DesignKind]) -> Any:
        """Return the design of one of these kinds in the file that the parameter `design_file` names."""
        file, copy = self.value("design_file"), self.value("design_copy")
        wanted = self.value("design") if "design" in self._known else ""
        return loaded(kinds, self.get_name(), file, self.sample_time_s, copy, wanted)

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
        on_missed_inputs: Callable[[int], None] | None = None,
    ) -> None:
        """Call ``act(stamp_ns, values...)`` for each tick of which all of `topics` have arrived.

        On the wall clock a tick does not wait for ever: see `WallClockSet` for `optional` and `on_missed_inputs`.

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
        on_missed_inputs
            Called with the stamp of a tick that lacks something else.
        """
        budget_s = self.sample_time_s if self.is_realtime else math.inf
        timed = self.health.timed(act, budget_s, lambda: self.soon(self.report_health))
        period_ns = round(self.sample_time_s * 1e9) if self.is_realtime else None
        expected = self.loop.add(topics, timed, period_ns, patience, holds_s or {}, optional, on_missed_inputs)
        for topic in expected:
            # Whoever publishes need not offer a deadline: stock tools and drivers don't.
            self.loop.subscriptions.add(self.subscribe(topic.type, topic.name, PLAIN_QOS))

    def enter(self, mode: str, time_ns: int) -> None:
        """Announce that the node does something else from this tick on; empty: all is as usual again."""
        if mode == self.health.mode:
            return
        self.health.announce(time_ns / 1e9, mode or AS_USUAL)
        if mode:  # rclpy wants one severity for each line of code
            self.get_logger().warning(f"{time_ns / 1e9:.3f} s: {mode}")
        else:
            self.get_logger().info(f"{time_ns / 1e9:.3f} s: {AS_USUAL}")
        self.health.mode = mode
        self.soon(self.report_health)

    def missed_ticks(self, since_ns: int, time_ns: int) -> int:
        """Return how many ticks lie between two."""
        return round((time_ns - since_ns) / 1e9 / self.sample_time_s) - 1

    def subscribe(self, type_name: str, name: str, qos: QoSProfile) -> Subscription:
        """Create a subscription that the executor leaves alone, for `Subscriptions` to take from."""
        group = Gate(is_open=False)
        kind = message_class(type_name)
        self._subscribed.append(self.create_subscription(kind, name, _nothing, qos, callback_group=group))
        return self._subscribed[-1]

    def send(self, time_ns: int, topic: str, *values: Any) -> None:
        """Publish the values of one topic, stamped."""
        publisher, pack = self._senders[topic]
        self._sent_ns = time_ns
        publisher.publish(pack(time_ns, values))

    def add_output(self, topic: Topic, name: str | None = None) -> None:
        """Create the publisher of a topic, once; `name` where it differs from the topic's own."""
        if topic.name in self._senders:
            return
        qos = qos_of(topic) if name is None else PLAIN_QOS
        publisher = self._publisher(message_class(topic.type), name or topic.name, qos)
        self._senders[topic.name] = (publisher, packer(topic))

    @property
    def time_ns(self) -> int:
        """Time on this node's clock, ns: the wall clock's, or in lockstep that of the tick it has come to."""
        if "mode" in self._known and self.value("mode") == "lockstep":
            return self._sent_ns
        return int(self.get_clock().now().nanoseconds)

    def soon(self, call: Callable[[], None]) -> None:
        """Let the executor call `call` as soon as the present callback is over."""
        if self.executor is not None:
            self.executor.create_task(call)

    def report_health(self) -> None:
        """Publish the node's health, and how many subscribers its outputs have found."""
        gc.collect(1)
        found = {topic: publisher.get_subscription_count() for topic, (publisher, *_) in self._senders.items()}
        report = self.health.report(
            state=self.state,
            scheduling=self.realtime.scheduling,
            realtime_care=self.realtime.state,
            subscriptions=len(self.loop.subscriptions),
            subscribers=found,
            **self.loop.inputs.counts(),
        )
        further = self.node_health()
        self._diagnostics.publish(self.time_ns, report, further, self.health.problem)

    # -- life cycle ---------------------------------------------------------------------------------------------

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
            self.health.problem = _one_line(problem)
            self.is_bad_input = isinstance(problem, ValueError)
            if not self.is_bad_input:
                traceback.print_exc()
            self.get_logger().error(self.health.problem)
            return TransitionCallbackReturn.FAILURE
        self.soon(self.report_health)
        return inherited(state)

    def _create(self) -> None:
        for topic in (*TOPICS, *OCCASIONAL):
            if topic.publisher == self.get_name():
                self.add_output(topic)
        self.is_realtime = "mode" in self._known and self.value("mode") == "realtime"
        kept = self.value("memory_file") if self.is_realtime and "memory_file" in self._known else ""
        self.checkpoint = CheckpointFile(Path(kept) if kept else None, self.health.not_kept)
        self.configure()

    def _forget(self) -> None:
        self.loop = TickLoop(self.context, self.health.reject, self.on_deadline)
        self.health.forget()
        while self._subscribed:
            self.destroy_subscription(self._subscribed.pop())
        self._begins_anew = True
        self.checkpoint.forget()

    def _start(self) -> None:
        self.loop.clear()
        self._setup.is_open = False
        self.running = True
        self.checkpoint.open()
        self.realtime.begin(self.value("priority"), self.value("realtime_care"))
        self.started()

    def _stop(self) -> None:
        self.running = False
        self._setup.is_open = True
        self.realtime.end()
        self.checkpoint.close()
        self.stopped()

    # -- details ------------------------------------------------------------------------------------------------

    def _do_others(self, executor: SingleThreadedExecutor) -> None:
        """Do what is not the loop's."""
        with self.realtime.behind_the_loop():
            executor.spin_once(timeout_sec=0.0)

    def _publisher(self, type_: Any, name: str, qos: QoSProfile) -> Publisher:
        events = PublisherEventCallbacks(matched=lambda _: self.report_health())
        return self.create_publisher(type_, name, qos, callback_group=self._setup, event_callbacks=events)


def run_node(make: Callable[[], LoopNode]) -> NoReturn:
    """Run a node until it is told to end, and end the process.

    The exit code is 0 after SIGINT and SIGTERM, 1 when the node failed, 2 after bad input.
    """
    begin_node()
    # The middleware sees the signal by itself; an exception in the midst of a call into it would be another error.
    signal.signal(signal.SIGINT, lambda *_: None)
    one_blas_thread()
    interpret_steps()
    end_with_parent()
    made: list[LoopNode] = []
    code = _run(make, made)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)  # it is ending: a second one must not cut that off
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


def _run(make: Callable[[], LoopNode], made: list[LoopNode]) -> int:
    node = None
    try:
        if told := left_aside():
            print(f"{program_name()}: {told}", file=sys.stderr, flush=True)
        init()
        node = make()
        made.append(node)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        if node.value("autostart"):
            for trigger in (node.trigger_configure, node.trigger_activate):
                if trigger() != TransitionCallbackReturn.SUCCESS:
                    return BAD_INPUT if node.is_bad_input else 1
        while rclpy.ok():
            node.work(executor)
        return 0
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    except RCLError as problem:
        if not rclpy.ok():
            return 0  # told to end in the middle of a call into the middleware
        return _report(node, problem)
    except (InvalidParameterValueException, InvalidParameterTypeException, ParameterException) as problem:
        print(f"{program_name()}: {_one_line(problem)}", file=sys.stderr, flush=True)
        return BAD_INPUT
    except ArgumentError as problem:
        print(f"{program_name()}: {problem}", file=sys.stderr, flush=True)
        return BAD_INPUT
    except Exception as problem:
        return _report(node, problem)


def _report(node: LoopNode | None, problem: Exception) -> int:
    """Say why the node ends: the traceback for us, then one line for the user; return its exit code."""
    try:
        if not isinstance(problem, ValueError):
            traceback.print_exc()
        if node is not None:
            node.get_logger().fatal(_one_line(problem))
        else:
            print(f"{program_name()}: {_one_line(problem)}", file=sys.stderr, flush=True)
    except OSError:  # the log is on the disk that is full; what could not be said must not be tried again at exit
        sys.stderr = Path(os.devnull).open("w")  # noqa: SIM115
    return DISK_FULL if isinstance(problem, OSError) and problem.errno == errno.ENOSPC else 1


def _nothing(message: Any) -> None:
    """Stand in as the callback of a subscription from which `Subscriptions` takes."""


def _one_line(problem: BaseException) -> str:
    text = " ".join(str(problem).split()) or type(problem).__name__
    return text if isinstance(problem, ValueError) else f"{type(problem).__name__}: {text}"
