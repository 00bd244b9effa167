"""What is known of the graph: what its nodes report, and what the page makes of it. Pure: no node, no thread."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import zip_longest
from typing import Any

from ac_common.design_file import PAPER
from ac_common.faults import KINDS
from ac_common.fdi_status import StatusRow
from ac_common.health import BringupReport, HealthReport, InjectorReport, PlantReport, Restart
from ac_common.topics import BRINGUP, COMPENSATOR, FDI, INJECTOR, PLANT, RECORDER, SCENARIO
from bringup.nodes.scenario import OFFSETS
from fault_injector_node.node import PARAMETERS as INJECTOR_PARAMETERS

#: A node that has not reported its health for so long is gone, s.
GONE_S = 3.5
#: Parameters that the page shows, or needs to know what it may offer.
WATCHED = {
    PLANT: ("operating_point", "in_car", "mode", "sample_time_s"),
    FDI: ("design",),
    COMPENSATOR: ("accommodate",),
    SCENARIO: ("ramp_s", *(parameter.name for parameter in OFFSETS)),
    INJECTOR: tuple(parameter.name for parameter in INJECTOR_PARAMETERS if parameter.live),
}


@dataclass(frozen=True)
class View:
    """What is going on in the graph, as the page shows it.

    Attributes
    ----------
    phase : str
        ``absent``, ``setting up``, ``running``, ``paused`` or ``over``.
    message : str
        What has come of the last control, or what is wrong.
    failed : bool
        Whether `message` tells of a failure.
    """

    phase: str
    message: str
    failed: bool
    point: str
    mode: str
    recorded: bool
    accommodate: bool
    live_faults: frozenset[str]
    status: StatusRow | None
    plant: Mapping[str, str]
    parameters: Mapping[str, Mapping[str, Any]]
    restarting: tuple[str, ...]  # nodes that have died and are not back in service
    pids: Mapping[str, int] = field(default_factory=dict)  # processes of the nodes

    @property
    def in_car(self) -> bool:
        """Whether there is a car around the plant."""
        return bool(self.parameters.get(PLANT, {}).get("in_car", False))

    @property
    def design(self) -> str:
        """What the designs are for; a detector that somebody has started need not say it, and is then the paper's."""
        return str(self.parameters.get(FDI, {}).get("design") or PAPER)

    @property
    def may_reset(self) -> bool:
        """Whether reset is offered: not while somebody records the run."""
        return self.phase in ("running", "paused", "over") and not self.recorded

    @property
    def may_pause(self) -> bool:
        """Whether to pause, or to go on, is offered: in a bag of the wall clock a pause would be a hole."""
        return self.phase == "paused" or (self.phase == "running" and not (self.recorded and self.mode == "realtime"))


@dataclass
class Heard:
    """What is known of the graph; written by the node's thread."""

    health: dict[str, dict[str, str]] = field(default_factory=dict)
    heard_s: dict[str, float] = field(default_factory=dict)
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    asked: set[str] = field(default_factory=set)  # nodes whose parameters have been asked for
    status: StatusRow | None = None
    live_faults: frozenset[str] = frozenset()
    restarting: tuple[str, ...] = ()
    restarts: list[str] = field(default_factory=list)  # what bringup has told of them
    message: str = ""
    failed: bool = False
    accommodated_first: bool = True  # what a reset goes back to

    def take_parameters(self, node: str, values: dict[str, Any]) -> None:
        """Take the parameters that a node has told; the first of accommodation is what a reset goes back to."""
        if node == COMPENSATOR and not self.parameters.get(node):
            self.accommodated_first = bool(values.get("accommodate", True))
        self.parameters[node] = values

    def say(self, message: str, failed: bool = False) -> None:
        """Let the page show a line."""
        self.message, self.failed = message, failed

    def is_there(self, name: str) -> bool:
        """Return whether a node has reported its health of late."""
        return time.monotonic() - self.heard_s.get(name, -GONE_S) < GONE_S

    def view(self, *, sets_up: bool, is_starting: bool) -> View:
        """Return what is going on now.

        Parameters
        ----------
        sets_up
            Whether the graph is being reset.
        is_starting
            Whether it has only just been started: until it is heard of, it is being set up, and not missing.
        """
        plant = self.health.get(PLANT, {}) if self.is_there(PLANT) else {}
        parameters = {name: dict(values) for name, values in self.parameters.items()}
        return View(
            phase="setting up" if sets_up else self._phase(plant, is_starting),
            message=self.message,
            failed=self.failed,
            point=str(parameters.get(PLANT, {}).get("operating_point", "")),
            mode=str(parameters.get(PLANT, {}).get("mode", "")),
            recorded=self.is_there(RECORDER),
            accommodate=bool(parameters.get(COMPENSATOR, {}).get("accommodate", False)),
            live_faults=self.live_faults,
            status=self.status,
            plant=plant,
            parameters=parameters,
            restarting=self.restarting if self.is_there(BRINGUP) else (),
            pids={
                name: pid
                for name, values in sorted(self.health.items())
                if self.is_there(name) and (pid := HealthReport.read(values).pid) is not None
            },
        )

    def _phase(self, plant: Mapping[str, str], is_starting: bool) -> str:
        if not plant:
            return "setting up" if is_starting and PLANT not in self.heard_s else "absent"
        state, run = HealthReport.read(plant).state, PlantReport.read(plant)
        if run.finished:
            return "over"
        if state == "active":
            return "running"
        return "paused" if state == "inactive" and run.tick else "setting up"

    def hear_health(self, name: str, values: dict[str, str]) -> bool:
        """Take a node's health report; return whether its parameters are now to be asked for."""
        if not self.is_there(name):
            self.asked.discard(name)  # it has just come: its parameters may be others
        self.health[name] = values
        self.heard_s[name] = time.monotonic()
        if name == BRINGUP:
            self._hear_of_restarts(BringupReport.read(values).restarts)
        if name == INJECTOR:
            self.live_faults = frozenset(InjectorReport.read(values).live_faults) & frozenset(KINDS)
        if name not in WATCHED or name in self.asked:
            return False
        self.asked.add(name)
        return True

    def _hear_of_restarts(self, restarts: tuple[Restart, ...]) -> None:
        self.restarting = tuple(restart.node for restart in restarts if not restart.is_back)
        told = [f"{restart.node} {restart}" for restart in restarts]
        if told != self.restarts:
            new = next(new for new, old in zip_longest(told, self.restarts) if new != old)
            self.restarts = told
            if new is not None:
                self.say(new)
