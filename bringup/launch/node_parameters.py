"""Parameters and arguments of the nodes' processes, and how these are started."""

import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from ac_common.design_file import design_name
from ac_common.topics import COMPENSATOR, CONTROLLER, FDI, INJECTOR, NAMESPACE, PLANT, RECORDER, SCENARIO
from ac_common.yaml_file import yaml_text
from ac_experiments.scenario import cabin_of
from ac_experiments.scenario_schema import Scenario
from ac_experiments.versions import versions
from bringup.launch.process_table import PROCESSES
from bringup.launch.processes import Child, start, stop
from bringup.launch.user_nodes import UserNodes
from gimc_controller_node.protection import ProtectionLimits, limits_for

Mode = Literal["lockstep", "realtime"]

#: SCHED_FIFO priority of the loop's nodes on the wall clock: above everything normal, below the kernel's own threads.
REALTIME_PRIORITY = 20
#: Parameters that the record of a run does not repeat: it has them elsewhere, or they are paths.
NOT_RECORDED = ("scenario", "design_file", "design_copy", "memory_file")


@dataclass(frozen=True)
class NodeStarter:
    """Starts the nodes of one graph, and starts those again that have died.

    Attributes
    ----------
    parameters : of each node, by name.
    log : folder for logs and parameter files.
    environment : what the nodes get on top of this process's environment.
    user : nodes and parameters of the user's.
    children : what has been started.
    """

    parameters: Mapping[str, Mapping[str, Any]]
    log: Path
    environment: Mapping[str, str]
    user: UserNodes = field(default_factory=UserNodes)
    children: dict[str, Child] = field(default_factory=dict)

    def arguments(self, name: str) -> list[str]:
        """Return the arguments that start a node, its parameters written into files."""
        return node_arguments(name, self.parameters[name], self.log, self.user)

    def start(self, name: str) -> None:
        """Start a node."""
        self._start(name, self.arguments(name), append=False)

    def start_again(self, name: str, changed: Mapping[str, Any]) -> Child:
        """Start a node that has died: it brings itself to life, goes on in its log, and the recorder in its bag.

        `changed` are parameters that were set while it ran.
        """
        stop([self.children[name]], patience_s=0.0)  # what its process may have left in its group
        again = {**self.parameters[name], "autostart": True, **({"append": True} if name == RECORDER else {})}
        self._start(name, node_arguments(name, again, self.log, self.user, changed), append=True)
        return self.children[name]

    def _start(self, name: str, arguments: list[str], append: bool) -> None:
        program = self.user.program(name)
        self.children[name] = start(name, arguments, self.log, self.environment, program, append)


def node_arguments(
    name: str,
    parameters: Mapping[str, Any],
    folder: Path,
    user: UserNodes | None = None,
    changed: Mapping[str, Any] | None = None,
) -> list[str]:
    """Return the arguments that start a node, its parameters in files in `folder`.

    bringup manages the node unless `parameters` say otherwise. The user's parameter file comes after `parameters`, and
    `changed`, which was set while the node ran, after that.
    """
    user = user or UserNodes()
    process = PROCESSES[name]
    files = [process.parameter_file, _file_of({"autostart": False, **parameters}, folder / f"{name}.yaml")]
    if user.params_file is not None:
        files.append(user.params_file)
    if changed:
        files.append(_file_of(changed, folder / f"{name}.changed.yaml"))
    in_order = [word for file in files for word in ("--params-file", str(file))]
    _, *arguments = user.commands.get(name, (sys.executable, "-m", process.module))
    return [*arguments, "--ros-args", "-r", f"__ns:={NAMESPACE}", *in_order, "--disable-external-lib-logs"]


def _file_of(parameters: Mapping[str, Any], file: Path) -> Path:
    file.write_text(yaml_text({"/**": {"ros__parameters": dict(parameters)}}), encoding="utf-8")
    return file


def node_parameters(
    scenario: Scenario, out_dir: Path, mode: Mode, passive: bool, care: bool = False, command: str = ""
) -> dict[str, dict[str, Any]]:
    """Return the parameters of every node for a run, by name."""
    log = (out_dir / "log").resolve()
    parameters = _loop_parameters(scenario, log, mode, passive)
    if mode == "realtime" and care:
        # The loop comes before whatever else the machine does, where that is asked for and allowed; recording waits.
        for given in parameters.values():
            given.update(priority=REALTIME_PRIORITY, realtime_care=True)
    run = {
        "scenario": scenario.model_dump(mode="json"),
        "mode": mode,
        "passive": passive,
        "sample_time_s": scenario.sample_time_s,
        "operating_point": scenario.operating_point,
        "ticks": scenario.ticks,
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "software": versions(),
        "command": command,
        "parameters": {
            name: {key: value for key, value in given.items() if key not in NOT_RECORDED}
            for name, given in parameters.items()
        },
    }
    parameters[RECORDER] = {
        "folder": str((out_dir / "bag").resolve()),
        "designs": str(log),
        "run": json.dumps(run),
        "ticks": scenario.ticks,
        "mode": mode,
    }
    return parameters


def _loop_parameters(scenario: Scenario, log: Path, mode: Mode, passive: bool) -> dict[str, dict[str, Any]]:
    """Return the parameters of the nodes of the loop; designs and memories are files in the folder `log`."""
    timing = {"sample_time_s": scenario.sample_time_s, "mode": mode}
    point = scenario.operating_point
    parameters: dict[str, dict[str, Any]] = {
        PLANT: {**timing, "operating_point": point, "ticks": scenario.ticks, "component_faults": True},
        INJECTOR: {
            **timing,
            "operating_point": point,
            "noise_std": [float(std) for std in scenario.noise.std],
            "seed": scenario.noise.seed,
            "superheat_sensor": scenario.superheat_sensor,
        },
        FDI: {**timing, "design": scenario.design},
        COMPENSATOR: {
            **timing,
            "design": scenario.design,
            "sensors": scenario.design_sensors,
            "accommodate": not passive,
        },
        CONTROLLER: {**timing},
        SCENARIO: {"scenario": json.dumps(scenario.model_dump(mode="json")), "mode": mode},
    }
    if scenario.car is not None:
        cabin = vars(cabin_of(scenario.car))
        parameters[PLANT] |= {"in_car": True, **{f"cabin.{name}": value for name, value in cabin.items()}}
        parameters[CONTROLLER]["in_car"] = True
    usual, limits = ProtectionLimits(), limits_for(has_belt=scenario.has_belt, measures_head=scenario.measures_head)
    for name, value in vars(limits).items():
        if value != getattr(usual, name):
            parameters[CONTROLLER][f"protection.{name}"] = value
    if scenario.controller_class:
        parameters[CONTROLLER]["controller_class"] = scenario.controller_class
    for name, given in parameters.items():
        if PROCESSES[name].keeps_memory:
            given["memory_file"] = str(log / f"{name}.memory")
        if PROCESSES[name].has_design:
            given["design_file"] = str(log / design_name(name, point, scenario.design))
            given["design_copy"] = str(log / f"{name}.npz")
            given["operating_point"] = point  # acftc's nodes have it from their design; a user's node may ask for it
    return parameters
