"""Runs a scenario in a graph of processes: starts the nodes, brings them to life, and stops them, whatever happens."""

import shlex
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ac_common.errors import InterruptedRunError, RunError, UserError
from ac_common.health import MissedTick, Restart, missed_ticks
from ac_common.topics import NAMESPACE, PLANT, RECORDER, Topic, topics_in
from ac_experiments.bags.mending import mend
from ac_experiments.scenario_schema import Scenario
from ac_ros_common.realtime import AWAKE_VARIABLE
from bringup.launch.beside import prepare_nodes
from bringup.launch.interrupts import orderly_interrupts
from bringup.launch.keep_cpus_awake import keep_awake
from bringup.launch.node_parameters import Mode, NodeStarter, node_parameters
from bringup.launch.process_table import ACTIVATION_ORDER, PROCESSES
from bringup.launch.processes import Child, Domain, ros_environment, stop
from bringup.launch.shared_memory import sweep
from bringup.launch.user_nodes import UserNodes

if TYPE_CHECKING:
    from bringup.launch.supervisor import Supervisor

Progress = Callable[[int, int], None]
Say = Callable[[str], None]


@dataclass(frozen=True)
class GraphRun:
    """What `run_graph` has done."""

    bag: Path
    ticks: int
    wall_seconds: float  # from the first tick to the last
    start_seconds: float  # from the call to the first tick
    missed_ticks: int
    latency_ms: tuple[float, float, float]  # measurement -> command: p50, p99, max
    domain: int
    restarts: tuple[Restart, ...] = ()
    missed: tuple[MissedTick, ...] = ()  # the last 200 of them; the bag tells of all
    unexpected: tuple[str, ...] = ()  # what was last seen in the graph that does not belong there


def run_graph(
    scenario: Scenario,
    out_dir: Path | str,
    mode: Mode = "lockstep",
    passive: bool | None = None,
    progress: Progress | None = None,
    user: UserNodes | None = None,
    say: Say = print,
    beside: Callable[[int], None] | None = None,
    care: bool = False,
    command: str = "",
) -> GraphRun:
    """Run `scenario` with every node as a process of its own; the bag is ``out_dir/bag``.

    Parameters
    ----------
    scenario
        What to run.
    out_dir
        Made when it does not exist; a bag that is there already is replaced.
    mode
        ``lockstep`` (as fast as the machine allows, deterministic) or ``realtime`` (on the wall clock).
    passive
        True: K0 alone. None: as the scenario says.
    progress
        Called about once a second with the ticks done and the ticks in all.
    user
        Nodes and parameters of the user's.
    say
        Told, in a line each, what the user has to do (which node to start by hand, and how), and during the run which
        node died, that it is back in service, and what is in the graph and does not belong there.
    beside
        Called with the run's ROS domain before its nodes start, to start whatever is to look at them.
    care
        On the wall clock: SCHED_FIFO, locked memory and processors that do not doze, where the system permits it.
    command
        The command line that repeats this run, for its report.

    Raises
    ------
    UserError
        One line: which node failed and its last words, or what else went wrong. All processes are gone by then, and
        the bag holds what had been recorded.
    """
    called_s = time.monotonic()
    out_dir = Path(out_dir)
    passive = scenario.is_passive(passive)
    _prepare(out_dir)
    with _domain() as domain:
        environment = {**ros_environment(), "ROS_DOMAIN_ID": str(domain)}
        parameters = node_parameters(scenario, out_dir, mode, passive, care, command)
        if beside is not None:
            beside(domain)
        with _interruptible(out_dir), ExitStack() as at_the_end:
            at_the_end.callback(mend, out_dir / "bag")
            idle = keep_awake(out_dir / "log", environment) if mode == "realtime" and care else []
            at_the_end.callback(stop, idle)
            # The nodes' alone: the supervisor makes the other one that of this process.
            of_nodes = {**environment, **({AWAKE_VARIABLE: "1"} if idle else {})}
            starter = NodeStarter(parameters, out_dir / "log", of_nodes, user or UserNodes())
            topics = topics_in(scenario.car is not None, scenario.design, scenario.air_flow_sensor)
            at_the_end.callback(_stop_nodes, starter.children)
            with _started(starter, environment, mode, domain, say, topics) as supervisor:
                from bringup.launch.run_end import wait_until_done

                prepare_nodes(scenario, out_dir / "log")  # meanwhile the nodes are starting
                supervisor.activate(ACTIVATION_ORDER)
                start_seconds = time.monotonic() - called_s
                wait_until_done(supervisor, scenario.ticks, progress)
                supervisor.let_go(starter.user.by_hand)
                result = _result(scenario, out_dir / "bag", start_seconds, domain, supervisor)
        recorder = starter.children[RECORDER]
        if recorder.process.returncode != 0:
            msg = f"node {RECORDER} failed at the end: {recorder.last_words()} (log: {recorder.log})"
            raise RunError(msg)
        return result


@contextmanager
def _domain() -> Iterator[int]:
    """Hold a ROS domain for a run; shared memory that dead processes have left is removed before and after."""
    sweep()
    domain = Domain()
    try:
        yield domain.number
    finally:
        domain.release()
        sweep()


def _started(
    starter: NodeStarter,
    environment: Mapping[str, str],
    mode: Mode,
    domain: int,
    say: Say,
    topics: Sequence[Topic],
) -> "Supervisor":
    """Start all nodes, or say how the user is to start those that are theirs; return what manages them."""
    by_hand = starter.user.by_hand
    for name in PROCESSES:
        if name in by_hand:
            say(_how_to_start(name, starter.arguments(name), domain))
        else:
            starter.start(name)
    from bringup.launch.supervisor import Supervisor  # takes its time: meanwhile the nodes are starting, too

    # In lockstep nothing may be lost: there a dead node is the end of the run.
    restart = starter.start_again if mode == "realtime" else None
    children = {**starter.children, **dict.fromkeys(by_hand)}
    return Supervisor(children, environment, starter.user, restart, say=say, topics=topics)


def _stop_nodes(children: Mapping[str, Child]) -> None:
    """Stop all nodes, the recorder last: it has to hear how the others end."""
    stop([child for name, child in children.items() if name != RECORDER])
    stop([child for name, child in children.items() if name == RECORDER])


def _result(scenario: Scenario, bag: Path, start_seconds: float, domain: int, supervisor: "Supervisor") -> GraphRun:
    health = supervisor.health.get(PLANT, {})  # a user's plant may have nothing to say
    said = supervisor.health.of_plant()
    return GraphRun(
        bag=bag,
        ticks=scenario.ticks,
        wall_seconds=said.wall_seconds,
        start_seconds=start_seconds,
        missed_ticks=said.missed_ticks or 0,
        latency_ms=said.command_latency_ms,
        domain=domain,
        restarts=tuple(supervisor.restarts),
        missed=missed_ticks([health], scenario.sample_time_s),
        unexpected=tuple(supervisor.unexpected),
    )


def _how_to_start(name: str, arguments: list[str], domain: int) -> str:
    return f"waiting for node {NAMESPACE}/{name}; ours would be: ROS_DOMAIN_ID={domain} python {shlex.join(arguments)}"


def _prepare(out_dir: Path) -> None:
    """Make the folders; a bag and logs of an earlier run make room, and nothing else that is there."""
    logs = [
        f"{name}{end}" for name in PROCESSES for end in (".log", ".yaml", ".changed.yaml", ".npz", "-*.npz", ".memory")
    ]
    try:
        for part, patterns in (("bag", ["*.mcap", "metadata.yaml"]), ("log", logs)):
            folder = out_dir / part
            folder.mkdir(parents=True, exist_ok=True)
            for pattern in patterns:
                for old in folder.glob(pattern):
                    old.unlink()
            probe = folder / ".writable"
            probe.touch()
            probe.unlink()
    except OSError as problem:
        msg = f"{out_dir}: cannot be written: {problem.strerror}"
        raise UserError(msg) from None


@contextmanager
def _interruptible(out_dir: Path) -> Iterator[None]:
    """Turn Ctrl-C and SIGTERM into one line, raised only after everything has been stopped."""
    with orderly_interrupts():
        try:
            yield
        except KeyboardInterrupt:
            msg = f"interrupted; {out_dir / 'bag'} holds what was recorded until then"
            raise InterruptedRunError(msg) from None
