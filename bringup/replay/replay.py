"""Feeds a bag's inputs through the real node again, over DDS, and compares its answers with the recorded ones."""

import math
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ac_common.design_file import ATTACHMENT
from ac_common.errors import RunError, UserError
from ac_common.topics import PLANT, TOPICS, Topic
from ac_common.wire import restamped, stamp_ns
from ac_experiments.bags.reader import RawBag, decode, loop_messages, read_raw, run_of
from ac_experiments.designs import write_designs_of
from ac_experiments.scenario_schema import Scenario
from ac_experiments.versions import plant, same_plant
from bringup.launch.node_parameters import node_arguments, node_parameters
from bringup.launch.process_table import LOOP_NODES, PROCESSES
from bringup.launch.processes import Child, Domain, ros_environment, start, stop

#: Largest relative difference that counts as rounding of another processor.
RELATIVE_TOLERANCE = 1e-9
#: How long the node may take to answer one tick, s.
PATIENCE_S = 10.0
#: Differences that are described one by one.
MOST_SHOWN = 20


@dataclass
class ReplayResult:
    """What a replay has shown.

    Attributes
    ----------
    compared : number of messages compared.
    identical : how many of them have the recorded bytes.
    largest_relative_difference : over all values of all messages.
    differences : the first messages that differ by more than rounding, one line each.
    different : how many they are in all.
    """

    node: str
    ticks: int = 0
    compared: int = 0
    identical: int = 0
    largest_relative_difference: float = 0.0
    different: int = 0
    differences: list[str] = field(default_factory=list)

    @property
    def same(self) -> bool:
        """Whether the node still gives its recorded outputs, up to rounding."""
        return self.compared > 0 and self.different == 0

    @property
    def bit_for_bit(self) -> bool:
        """Whether every message is the recorded one to the last bit."""
        return self.compared > 0 and self.identical == self.compared


def replay(
    bag: Path | str,
    node: str,
    progress: Callable[[int, int], None] | None = None,
    parameters: dict[str, Any] | None = None,
) -> ReplayResult:
    """Replay the recorded inputs of one node.

    Parameters
    ----------
    bag
        A bag of ours, complete or cut short.
    node
        Name of the node, as in ``ros2 node list``.
    progress
        Called now and then with the ticks done and the ticks in all.
    parameters
        Of the node, where they are to differ from those of the recorded run.

    Raises
    ------
    UserError
        One line: no such node, no such bag, or why the node did not answer.
    """
    if node not in LOOP_NODES:
        msg = f"no node {node!r} can be replayed; allowed: {', '.join(LOOP_NODES)}"
        raise UserError(msg)
    raw = read_raw(bag)
    run, scenario = run_of(raw, bag)
    if not same_plant(run.get("software", {})):
        msg = f"{bag}: recorded with the plant {run['software']['plant']}, in use is {plant()}; give it with --plant"
        raise UserError(msg)
    ticks = _by_tick(raw, node)
    domain = Domain()
    try:
        environment = {**ros_environment(), "ROS_DOMAIN_ID": str(domain.number)}
        with tempfile.TemporaryDirectory(prefix="acftc-replay-") as folder:
            given = {
                **_parameters(scenario, run["passive"], node, Path(folder)),
                **_design(raw, scenario, node, Path(folder)),
                **(parameters or {}),
            }
            arguments = node_arguments(node, given, Path(folder))
            child = start(node, arguments, Path(folder), environment)
            try:
                return _feed(child, environment, ticks, progress)
            finally:
                stop([child])
    finally:
        domain.release()


def _parameters(scenario: Scenario, passive: bool, node: str, folder: Path) -> dict[str, Any]:
    given = node_parameters(scenario, folder, "lockstep", passive)[node]
    if node == PLANT:
        given["ticks"] = 0
    if PROCESSES[node].has_design:
        given["design_copy"] = ""
    return given


def _design(raw: RawBag, scenario: Scenario, node: str, folder: Path) -> dict[str, Any]:
    """The design of the recorded run as a parameter: another machine's synthesis would round differently."""
    if not PROCESSES[node].has_design:
        return {}
    content = raw.attachments.get(ATTACHMENT.format(node))
    if content is None:
        return {"design_file": str(write_designs_of(scenario, folder)[node])}
    file = folder / "design.npz"
    file.write_bytes(content)
    return {"design_file": str(file)}


@dataclass
class _Tick:
    """What a node got and gave at one stamp."""

    inputs: list[tuple[Topic, bytes]] = field(default_factory=list)
    outputs: dict[str, bytes] = field(default_factory=dict)


def _by_tick(raw: RawBag, node: str) -> list[_Tick]:
    """Recorded inputs and outputs of a node, stamps counted from the first one, in order of time."""
    ticks: dict[int, _Tick] = {}
    messages = {topic.name: loop_messages(raw, topic) for topic in TOPICS}
    first = min((stamp_ns(found[0]) for found in messages.values() if found), default=0)
    wanted = 0
    for topic in TOPICS:
        if topic.publisher != node and node not in topic.subscribers:
            continue
        wanted += node in topic.subscribers
        for data in messages[topic.name]:
            time_ns = stamp_ns(data) - first
            tick = ticks.setdefault(time_ns, _Tick())
            if topic.publisher == node:
                tick.outputs[topic.name] = restamped(data, time_ns)
            else:
                tick.inputs.append((topic, restamped(data, time_ns)))
    ordered = [ticks[time_ns] for time_ns in sorted(ticks)]
    # A bag cut short ends with a tick of which only a part is there.
    whole = next((i for i, tick in enumerate(ordered) if len(tick.inputs) < wanted), len(ordered))
    return ordered[:whole]


def _feed(
    child: Child, environment: dict[str, str], ticks: list[_Tick], progress: Callable[[int, int], None] | None
) -> ReplayResult:
    """One tick after another: publish its inputs, wait for all the outputs it had."""
    from bringup.launch.supervisor import Supervisor
    from bringup.replay.feeder import Feeder

    result = ReplayResult(child.name, ticks=len(ticks))
    with Supervisor({child.name: child}, environment) as supervisor:
        feeder = Feeder(supervisor, child.name)
        supervisor.connect([child.name], feeder.is_matched)
        supervisor.activate([child.name])
        for number, tick in enumerate(ticks):
            # The plant speaks first: it answers the inputs of a tick with the next one.
            if child.name != PLANT:
                feeder.publish(tick.inputs)
            answers = feeder.collect(tick.outputs, PATIENCE_S)
            if answers is None:
                missing = ", ".join(sorted(set(tick.outputs) - set(feeder.got)))
                msg = f"node {child.name} gave no answer to tick {number}: {missing} did not come in {PATIENCE_S:g} s"
                raise RunError(msg)
            for topic, recorded in tick.outputs.items():
                _compare(result, number, topic, recorded, answers[topic])
            if child.name == PLANT:
                feeder.publish(tick.inputs)
            if progress is not None and number % 100 == 0:
                progress(number, len(ticks))
    if progress is not None:
        progress(len(ticks), len(ticks))
    return result


def _compare(result: ReplayResult, tick: int, topic: str, recorded: bytes, answer: bytes) -> None:
    result.compared += 1
    if recorded == answer:
        result.identical += 1
        return
    then, now = decode(topic, recorded), decode(topic, answer)
    worst = 0.0
    for key in then:
        worst = max(worst, _relative_difference(then[key], now.get(key)))
    result.largest_relative_difference = max(result.largest_relative_difference, worst)
    if worst > RELATIVE_TOLERANCE:
        result.different += 1
        if len(result.differences) < MOST_SHOWN:
            changed = [f"{k} {then[k]!r} -> {now.get(k)!r}" for k in then if then[k] != now.get(k)]
            result.differences.append(f"tick {tick} {topic}: {', '.join(changed)}")


def _relative_difference(then: Any, now: Any) -> float:
    """Difference of two values relative to the larger one; infinite when they are no numbers and not equal."""
    if then == now:
        return 0.0
    try:
        a, b = float(then), float(now)
    except (TypeError, ValueError):
        return math.inf
    if math.isnan(a) and math.isnan(b):
        return 0.0
    return abs(a - b) / max(abs(a), abs(b)) if math.isfinite(a) and math.isfinite(b) else math.inf
