"""Node `scenario`: answers each tick of the plant with that tick's references, air side and faults.

References and air follow the scenario and, on top of it, live: set the parameters (``reference.superheat_k``, ...)
while the loop runs, or publish a reference, once and with any stamp, on ``~/reference/superheat`` or
``~/reference/evaporator_pressure``; a change takes ``ramp_s``.
"""

from ac_ros_common.installation import begin_node

if __name__ == "__main__":
    begin_node()

import json
import math
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter as RosParameter

from ac_common.ramp import LiveOffset
from ac_common.signals import Reference, topics_of
from ac_common.topics import AIR_SIDE, BY_NAME, SCALARS, SCENARIO, Topic
from ac_common.units import KPA
from ac_experiments.scenario_schema import Air, References, targets_within
from ac_plant_node.rest import rest_at
from ac_ros_common.loop_node import LoopNode, run_node
from ac_ros_common.messages import message_class
from ac_ros_common.parameters import MODE, RUN_START, Parameter
from ac_ros_common.qos import PLAIN_QOS

_P_E = targets_within(References, "evaporator_pressure_kpa")
_SUPERHEAT = targets_within(References, "superheat_k")
#: What the live changes of the air side are added to, in the order of `AirSide`.
_AIR = {
    "mass_flow_percent": "air mass flow, per cent of the operating point's",
    "inlet_temperature_k": "air inlet temperature, K (not in a car)",
    "condenser_mass_flow_percent": "air mass flow through the condenser, per cent of the operating point's "
    "(not in a car)",
    "condenser_inlet_temperature_k": "air inlet temperature of the condenser, K",
    "humidity_percent": "relative humidity at the evaporator's inlet, per cent",
}
_AIR_LIMITS = {key: targets_within(Air, key) for key in _AIR}

#: Live changes from what the scenario plays, in the order of a row's references and air.
OFFSETS = (
    Parameter(
        "reference.evaporator_pressure_pa",
        0.0,
        "added to the scenario's reference of the evaporator pressure, Pa",
        _P_E.lowest * KPA,
        _P_E.highest * KPA,
        live=True,
    ),
    Parameter(
        "reference.superheat_k",
        0.0,
        "added to the scenario's reference of the superheat, K",
        _SUPERHEAT.lowest,
        _SUPERHEAT.highest,
        live=True,
    ),
    *(
        Parameter(
            f"air.{key}",
            0.0,
            f"added to the scenario's {what}",
            _AIR_LIMITS[key].lowest,
            _AIR_LIMITS[key].highest,
            live=True,
        )
        for key, what in _AIR.items()
    ),
)
#: Live changes that would do nothing in a car: what they are added to is a result there.
NOT_IN_CAR = ("air.inlet_temperature_k", "air.condenser_mass_flow_percent")
PARAMETERS = (
    Parameter("scenario", "nominal", "name of a built-in scenario, path of a scenario file, or a scenario as JSON"),
    MODE,
    RUN_START,
    Parameter("ramp_s", 0.0, "how long a live change takes, in a straight line; 0: a step", 0.0, 86400.0, live=True),
    *OFFSETS,
)
#: Topics of a row of the schedule: references and air, then faults and which readings stand still, then the car's.
PLAYED = (*topics_of("reference", Reference), *AIR_SIDE)
SCHEDULE = "scenario/faults"
FAULTS_END = len(PLAYED) + len(BY_NAME[SCHEDULE].joints)
#: How long the references go on by themselves when the plant's messages stay away, s.
HOLD_S = 0.3


class ScenarioNode(LoopNode):
    """Plays the arrays of `ac_experiments.scenario.schedule`, row by row; the last row stays on."""

    def __init__(self) -> None:
        super().__init__(SCENARIO, PARAMETERS)
        self._offsets: dict[str, LiveOffset] = {}
        self._played: list[float] = []
        self._in_car = False
        self.add_on_set_parameters_callback(self._may_change)
        self.add_post_set_parameters_callback(self._changed)

    def configure(self) -> None:
        """Turn the scenario into rows."""
        from ac_experiments.scenario import check, load, schedule

        given = self.value("scenario")
        scenario = check(json.loads(given)) if given.lstrip().startswith("{") else load(given)
        rest = rest_at(scenario.operating_point)
        plan = schedule(scenario, rest["inputs"], rest["outputs"])
        # One array, not lists of lists: a run of hours has some hundred thousand rows.
        self._rows = np.hstack([plan.reference, plan.air, plan.faults, plan.stuck, plan.car])
        self._in_car = scenario.car is not None
        if reason := self._without_effect([self.get_parameter(name) for name in NOT_IN_CAR]):
            raise ValueError(reason)
        self._tick_ns = scenario.tick_ns
        self._start_ns = self.run_start_ns if self.run_start_ns >= 0 else None
        outputs, air = rest["outputs"], rest["inputs"][2:].tolist()
        #: How much of SI one unit of each live change is, and what it is a change of.
        self._units = (1.0, 1.0, air[0] / 100.0, 1.0, air[2] / 100.0, 1.0, 0.01)
        # What is set live comes on top of what is played, within what a scenario may ask for.
        self._allowed = (
            (outputs[0] + _P_E.lowest * KPA, outputs[0] + _P_E.highest * KPA),
            (outputs[1] + _SUPERHEAT.lowest, outputs[1] + _SUPERHEAT.highest),
            *(
                (_changed_air(key, base, limit.lowest), _changed_air(key, base, limit.highest))
                for base, (key, limit) in zip(air, _AIR_LIMITS.items(), strict=True)
            ),
        )
        self._offsets = {parameter.name: LiveOffset(self.value(parameter.name)) for parameter in OFFSETS}
        self._played = []
        for number, name in enumerate(topics_of("reference", Reference)):
            self._listen(BY_NAME[name], OFFSETS[number].name, number)
        self.on_tick(("plant/evaporator_pressure",), self._play, holds_s={"plant/evaporator_pressure": HOLD_S})

    @property
    def sample_time_s(self) -> float:
        """Sample time of the scenario, s."""
        return self._tick_ns / 1e9

    def _play(self, time_ns: int, _p_e: float) -> None:
        if self._start_ns is None:
            self._start_ns = time_ns
        tick = round((time_ns - self._start_ns) / self._tick_ns)
        row = self._rows[min(tick, len(self._rows) - 1)].tolist()
        self._played = row
        played, faults, car = row[: len(PLAYED)], row[len(PLAYED) : FAULTS_END], row[FAULTS_END:]
        time_s = time_ns / 1e9
        more = [unit * offset.value(time_s) for unit, offset in zip(self._units, self._offsets.values(), strict=True)]
        self.send(time_ns, SCHEDULE, *faults)
        if self._in_car:
            self.send(time_ns, "scenario/car", *car)
        for topic, value, offset, (low, high) in zip(PLAYED, played, more, self._allowed, strict=True):
            self.send(time_ns, topic, min(max(value + offset, low), high))

    def _listen(self, topic: Topic, offset: str, number: int) -> None:
        """Have a reference changed by whoever publishes it on a topic of this node's own."""
        field = SCALARS[topic.type].field
        where = f"~/{topic.name}"

        def take(message: Any) -> None:
            value = float(getattr(message, field))
            if not self._played or not math.isfinite(value):
                why = f"{value} is not a finite number" if self._played else "the loop does not run yet"
                self.health.reject(where, "reference", f"{where}: {why}")
                return
            change = RosParameter(offset, value=value - self._played[number])
            (result,) = self.set_parameters([change])
            if not result.successful:
                self.health.reject(where, "reference", f"{where}: {value:g}: {result.reason}")

        kind = message_class(topic.type)
        self._subscribed.append(self.create_subscription(kind, where, take, PLAIN_QOS))

    def _without_effect(self, parameters: Sequence[RosParameter]) -> str:
        """Return which of these would do nothing, and why; empty when there is none. Zero asks for nothing."""
        for parameter in parameters:
            if self._in_car and parameter.name in NOT_IN_CAR and parameter.value:
                given = f"{parameter.name}: given {parameter.value:g}; allowed: 0"
                return f"{given} in a car, where inlet air of the evaporator and air flow of the condenser are results"
        return ""

    def _may_change(self, parameters: Sequence[RosParameter]) -> SetParametersResult:
        """Refuse live changes that would do nothing."""
        reason = "" if self.state == "unconfigured" else self._without_effect(parameters)
        return SetParametersResult(successful=not reason, reason=reason)

    def _changed(self, parameters: Sequence[RosParameter]) -> None:
        """Begin the live changes that have been asked for."""
        for parameter in parameters:
            if parameter.name in self._offsets:
                self._offsets[parameter.name].change(parameter.value, self.value("ramp_s"))


def _changed_air(key: str, at_rest: float, change: float) -> float:
    """Return an input of the air side after a change of the size `change`, to the last bit as a schedule has it."""
    if key.endswith("flow_percent"):
        return at_rest * (1.0 + change / 100.0)
    return at_rest + (change / 100.0 if key == "humidity_percent" else change)


def main() -> int:
    """Run the node."""
    return run_node(ScenarioNode)


if __name__ == "__main__":
    sys.exit(main())
