"""Starts the nodes, brings them to life in order, watches them and stops them, whatever happens."""

import json
import shlex
import signal
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

import yaml

from ac_common.design_file import DESIGNED, design_name
from ac_common.errors import BringupError, InterruptedRunError, RunError
from ac_common.health import MissedTick, Restart, missed_ticks, reported
from ac_common.topics import (
    COMPENSATOR,
    CONTROLLER,
    FDI,
    INJECTOR,
    NAMESPACE,
    PLANT,
    RECORDER,
    SCENARIO,
)
from ac_experiments.bags.recorder import mend
from ac_experiments.designs import write_designs_of
from ac_experiments.scenario_schema import Scenario
from ac_experiments.versions import versions
from ac_plant_node.rest import prepare
from ac_ros_common.realtime import AWAKE_VARIABLE
from bringup.launch.keep_cpus_awake import keep_awake
from bringup.launch.node_modules import MODULES, parameter_file
from bringup.launch.processes import Child, Domain, ros_environment, start, stop
from bringup.launch.shared_memory import sweep
from bringup.launch.user_nodes import OwnNodes

Mode = Literal["lockstep", "realtime"]
Progress = Callable[[int, int], None]

#: The plant beats time, so it goes last: everyone else must be listening by then.
ACTIVATION_ORDER = (RECORDER, CONTROLLER, COMPENSATOR, FDI, INJECTOR, SCENARIO, PLANT)
#: SCHED_FIFO priority of the loop's nodes on the wall clock: above everything normal, below the kernel's own threads.
REALTIME_PRIORITY = 20


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
    strangers: tuple[str, ...] = ()  # what was last seen in the graph that does not belong there


def run_graph(
    scenario: Scenario,
    out_dir: Path | str,
    mode: Mode = "lockstep",
    passive: bool | None = None,
    progress: Progress | None = None,
    own: OwnNodes | None = None,
    say: Callable[[str], None] = print,
    beside: Callable[[int], None] | None = None,
    care: bool = False,
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
    own
        Nodes and parameters of your own.
    say
        Told, in a line each, what the user has to do (which node to start by hand, and how), and during the run which
        node died, that it is back in service, and what is in the graph and does not belong there.
    beside
        Called with the run's ROS domain before its nodes start, to start whatever is to look at them.
    care
        On the wall clock: SCHED_FIFO, locked memory and processors that do not doze, where the system permits it.

    Raises
    ------
    BringupError
        One line: which node failed and its last words, or what else went wrong. All processes are gone by then, and
        the bag holds what had been recorded.
    """
    called_s = time.monotonic()
    out_dir = Path(out_dir)
    passive = scenario.is_passive(passive)
    own = own or OwnNodes()
    _prepare(out_dir)
    sweep()
    domain = Domain()
    try:
        environment = {**ros_environment(), "ROS_DOMAIN_ID": str(domain.number)}
        prepare(scenario.operating_point)
        write_designs_of(scenario, out_dir / "log")
        parameters = node_parameters(scenario, out_dir, mode, passive, care)
        if beside is not None:
            beside(domain.number)
        with _interruptible(out_dir):
            children: dict[str, Child] = {}
            idle: list[Child] = []
            try:
                if mode == "realtime" and care:
                    idle = keep_awake(out_dir / "log", environment)
                # Theirs alone: the supervisor makes the other one that of this process.
                of_nodes = {**environment, **({AWAKE_VARIABLE: "1"} if idle else {})}
                for name, module in MODULES.items():
                    arguments = node_arguments(module, name, parameters[name], out_dir / "log", own)
                    if name in own.by_hand:
                        say(_how_to_start(name, arguments, domain.number))
                        continue
                    program, *_ = own.commands.get(name, (sys.executable,))
                    children[name] = start(name, arguments, out_dir / "log", of_nodes, program)
                from bringup.launch.supervisor import (
                    Supervisor,  # takes its time: meanwhile the nodes are starting, too
                )

                managed = {**children, **dict.fromkeys(own.by_hand)}

                def revive(name: str, changed: dict[str, Any]) -> Child:
                    stop([children[name]], patience_s=0.0)  # what its process may have left in its group
                    children[name] = start_again(name, parameters[name], out_dir / "log", of_nodes, own, changed)
                    return children[name]

                # In lockstep nothing may be lost: there a dead node is the end of the run.
                reviving = revive if mode == "realtime" else None
                with Supervisor(managed, environment, own, reviving, say=say) as supervisor:
                    supervisor.activate(ACTIVATION_ORDER)
                    start_seconds = time.monotonic() - called_s
                    supervisor.wait_until_done(scenario.ticks, progress)
                    supervisor.let_go(own.by_hand)
                    health = supervisor.health.get(PLANT, {})  # a plant of somebody else's may have nothing to say
                    result = GraphRun(
                        bag=out_dir / "bag",
                        ticks=scenario.ticks,
                        wall_seconds=reported(health, "wall_seconds"),
                        start_seconds=start_seconds,
                        missed_ticks=int(reported(health, "missed_ticks", 0.0)),
                        latency_ms=_latencies(health),
                        domain=domain.number,
                        restarts=tuple(supervisor.restarts),
                        missed=missed_ticks([health], scenario.sample_time_s),
                        strangers=tuple(supervisor.strangers),
                    )
            finally:
                stop([child for name, child in children.items() if name != RECORDER])
                stop([child for name, child in children.items() if name == RECORDER])
                stop(idle)
                mend(out_dir / "bag")
            recorder = children[RECORDER]
            if recorder.process.returncode != 0:
                msg = f"node {RECORDER} failed at the end: {recorder.last_words()} (log: {recorder.log})"
                raise RunError(msg)
            return result
    finally:
        domain.release()
        sweep()


def _latencies(health: Mapping[str, str]) -> tuple[float, float, float]:
    p50, p99, most = (reported(health, f"command_latency_{quantile}_ms") for quantile in ("p50", "p99", "max"))
    return p50, p99, most


def node_parameters(
    scenario: Scenario, out_dir: Path, mode: Mode, passive: bool, care: bool = False
) -> dict[str, dict[str, Any]]:
    """Parameters of every node for this run."""
    timing = {"sample_time_s": scenario.sample_time_s, "mode": mode}
    point = {"operating_point": scenario.operating_point}
    superheat = {"superheat_sensor": scenario.superheat_sensor}
    content = scenario.model_dump(mode="json")
    run = {
        "scenario": content,
        "mode": mode,
        "passive": passive,
        "sample_time_s": scenario.sample_time_s,
        "operating_point": scenario.operating_point,
        "ticks": scenario.ticks,
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "software": versions(),
    }
    log = (out_dir / "log").resolve()
    designs = {
        node: {
            "design_file": str(log / design_name(node, scenario.operating_point)),
            "design_copy": str(log / f"{node}.npz"),
        }
        for node in DESIGNED
    }
    memories = {node: {"memory_file": str(log / f"{node}.memory")} for node in (FDI, COMPENSATOR)}
    # The loop comes before whatever else the machine does, where that is asked for and allowed; recording waits.
    priority = {"priority": REALTIME_PRIORITY, "realtime_care": True} if mode == "realtime" and care else {}
    parameters: dict[str, dict[str, Any]] = {
        PLANT: {**timing, **point, "ticks": scenario.ticks},
        INJECTOR: {
            **timing,
            **point,
            "noise_std": [float(std) for std in scenario.noise.std],
            "seed": scenario.noise.seed,
            **superheat,
        },
        FDI: {**timing, **memories[FDI], **designs[FDI]},
        COMPENSATOR: {
            **timing,
            **memories[COMPENSATOR],
            **designs[COMPENSATOR],
            "sensors": scenario.sensors,
            "accommodate": not passive,
        },
        CONTROLLER: {**timing, **designs[CONTROLLER]},
        SCENARIO: {"scenario": json.dumps(content), "mode": mode},
    }
    parameters = {name: {**own, **priority} for name, own in parameters.items()}
    told_elsewhere = ("scenario", "design_file", "design_copy", "memory_file")
    run["parameters"] = {
        name: {key: value for key, value in own.items() if key not in told_elsewhere}
        for name, own in parameters.items()
    }
    parameters[RECORDER] = {
        "folder": str((out_dir / "bag").resolve()),
        "designs": str(log),
        "run": json.dumps(run),
        "ticks": scenario.ticks,
        "mode": mode,
    }
    return parameters


def node_arguments(
    module: str,
    name: str,
    parameters: Mapping[str, Any],
    folder: Path,
    own: OwnNodes | None = None,
    changed: Mapping[str, Any] | None = None,
) -> list[str]:
    """Arguments that start a node, its parameters in files in `folder`; bringup manages it unless these differ.

    The user's parameter file comes after `parameters`, and `changed`, which was set while the node ran, after that.
    """
    own = own or OwnNodes()
    files = [parameter_file(module), _file_of({"autostart": False, **parameters}, folder / f"{name}.yaml")]
    if own.params_file is not None:
        files.append(own.params_file)
    if changed:
        files.append(_file_of(changed, folder / f"{name}.changed.yaml"))
    in_order = [word for file in files for word in ("--params-file", str(file))]
    _, *arguments = own.commands.get(name, (sys.executable, "-m", module))
    return [*arguments, "--ros-args", "-r", f"__ns:={NAMESPACE}", *in_order, "--disable-external-lib-logs"]


def _file_of(parameters: Mapping[str, Any], file: Path) -> Path:
    content = {"/**": {"ros__parameters": dict(parameters)}}
    file.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return file


def start_again(
    name: str,
    parameters: Mapping[str, Any],
    folder: Path,
    environment: Mapping[str, str],
    own: OwnNodes | None = None,
    changed: Mapping[str, Any] | None = None,
) -> Child:
    """Start a node that has died: it brings itself to life, goes on in its log, and the recorder in its bag."""
    own = own or OwnNodes()
    again = {**parameters, "autostart": True, **({"append": True} if name == RECORDER else {})}
    arguments = node_arguments(MODULES[name], name, again, folder, own, changed)
    program, *_ = own.commands.get(name, (sys.executable,))
    return start(name, arguments, folder, environment, program, append=True)


def _how_to_start(name: str, arguments: list[str], domain: int) -> str:
    return f"waiting for node {NAMESPACE}/{name}; ours would be: ROS_DOMAIN_ID={domain} python {shlex.join(arguments)}"


def _prepare(out_dir: Path) -> None:
    """Make the folders; a bag and logs of an earlier run make room, and nothing else that is there."""
    own = [
        f"{name}{end}"
        for name in MODULES
        for end in (".log", ".yaml", ".changed.yaml", ".npz", "-*.npz", ".memory", ".memory.new")
    ]
    try:
        for part, patterns in (("bag", ["*.mcap", "metadata.yaml"]), ("log", own)):
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
        raise BringupError(msg) from None


@contextmanager
def _interruptible(out_dir: Path) -> Iterator[None]:
    """Turn Ctrl-C and SIGTERM into one line, raised only after everything has been stopped."""

    def interrupt(number: int, _frame: object) -> None:
        raise KeyboardInterrupt(signal.Signals(number).name)

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    except KeyboardInterrupt:
        msg = f"interrupted; {out_dir / 'bag'} holds what was recorded until then"
        raise InterruptedRunError(msg) from None
    finally:
        signal.signal(signal.SIGTERM, before)
