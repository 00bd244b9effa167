"""Feeds a bag's inputs through the real node again, over DDS, and compares its answers with the recorded ones."""

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ac_common.design_file import ATTACHMENT
from ac_common.errors import RunError, UserError
from ac_common.topics import PLANT, Topic, topics_in
from ac_experiments.bags.comparison import ReplayResult, Tick, by_tick
from ac_experiments.bags.reader import RawBag, read_raw, run_of
from ac_experiments.designs import write_designs_of
from ac_experiments.scenario_schema import Scenario
from ac_experiments.versions import plant, same_plant
from bringup.launch.node_parameters import node_arguments, node_parameters
from bringup.launch.process_table import LOOP_NODES, PROCESSES
from bringup.launch.processes import Child, Domain, ros_environment, start, stop

#: How long the node may take to answer one tick, s.
PATIENCE_S = 10.0


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
    topics = topics_in(scenario.car is not None, scenario.design, scenario.air_flow_sensor)
    ticks = by_tick(raw, node, topics)
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
                return _feed(child, environment, ticks, topics, progress)
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
    """Return the design of the recorded run as a parameter: another machine's synthesis would round differently."""
    if not PROCESSES[node].has_design:
        return {}
    content = raw.attachments.get(ATTACHMENT.format(node))
    if content is None:
        return {"design_file": str(write_designs_of(scenario, folder)[node])}
    file = folder / "design.npz"
    file.write_bytes(content)
    return {"design_file": str(file)}


def _feed(
    child: Child,
    environment: dict[str, str],
    ticks: list[Tick],
    topics: Sequence[Topic],
    progress: Callable[[int, int], None] | None,
) -> ReplayResult:
    """Feed one tick after another: publish its inputs, wait for all the outputs it had."""
    from bringup.launch.supervisor import Supervisor
    from bringup.replay.feeder import Feeder

    result = ReplayResult(child.name, ticks=len(ticks))
    with Supervisor({child.name: child}, environment) as supervisor:
        feeder = Feeder(supervisor, child.name, topics)
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
                result.compare(number, topic, recorded, answers[topic])
            if child.name == PLANT:
                feeder.publish(tick.inputs)
            if progress is not None and number % 100 == 0:
                progress(number, len(ticks))
    if progress is not None:
        progress(len(ticks), len(ticks))
    return result
