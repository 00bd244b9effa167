"""Node `scenario`: answers each tick of the plant with that tick's references, air side and faults.

References and air follow the scenario and, on top of it, live: set the parameters (``reference.superheat_k``, ...)
while the loop runs; a change takes ``ramp_s``.
"""

import json
import sys
from collections.abc import Sequence

import numpy as np
from rclpy.parameter import Parameter as RosParameter

from ac_common.faults import FAULTS
from ac_common.ramp import LiveOffset
from ac_common.signals import Reference, topics_of
from ac_common.topics import SCENARIO
from ac_common.units import KPA
from ac_experiments.scenario_schema import Air, References, targets_within
from ac_plant_node.rest import rest_at
from ac_ros_common.loop_node import LoopNode, run_node
from ac_ros_common.parameters import MODE, RUN_START, Parameter

_P_E = targets_within(References, "evaporator_pressure_kpa")
_SUPERHEAT = targets_within(References, "superheat_k")
_FLOW = targets_within(Air, "mass_flow_percent")
_INLET = targets_within(Air, "inlet_temperature_k")

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
    Parameter(
        "air.mass_flow_percent",
        0.0,
        "added to the scenario's air mass flow, per cent of the operating point's",
        _FLOW.lowest,
        _FLOW.highest,
        live=True,
    ),
    Parameter(
        "air.inlet_temperature_k",
        0.0,
        "added to the scenario's air inlet temperature, K",
        _INLET.lowest,
        _INLET.highest,
        live=True,
    ),
)
PARAMETERS = (
    Parameter("scenario", "nominal", "name of a built-in scenario, path of a scenario file, or a scenario as JSON"),
    MODE,
    RUN_START,
    Parameter("ramp_s", 0.0, "how long a live change takes, in a straight line; 0: a step", 0.0, 86400.0, live=True),
    *OFFSETS,
)
#: Topics of a row of the schedule: references and air, then faults.
PLAYED = (*topics_of("reference", Reference), "scenario/air", "scenario/air_inlet_temperature")
SCHEDULES = tuple(fault.schedule_topic for fault in FAULTS)
#: How long the references go on by themselves when the plant's messages stay away, s.
HOLD_S = 0.3


class ScenarioNode(LoopNode):
    """Plays the arrays of `ac_experiments.scenario.schedule`, row by row; the last row stays on."""

    def __init__(self) -> None:
        super().__init__(SCENARIO, PARAMETERS)
        self._offsets: dict[str, LiveOffset] = {}
        self.add_post_set_parameters_callback(self._changed)

    def configure(self) -> None:
        """Turn the scenario into rows."""
        from ac_experiments.scenario import check, load, schedule

        given = self.value("scenario")
        scenario = check(json.loads(given)) if given.lstrip().startswith("{") else load(given)
        rest = rest_at(scenario.operating_point)
        plan = schedule(scenario, rest["inputs"], rest["outputs"])
        # One array, not lists of lists: a run of hours has some hundred thousand rows.
        self._rows = np.hstack([plan.reference, plan.air, plan.faults])
        self._tick_ns = scenario.tick_ns
        self._start_ns = self.run_start_ns if self.run_start_ns >= 0 else None
        outputs, (_, _, flow, inlet) = rest["outputs"], rest["inputs"]
        self._flow_percent = float(flow) / 100.0
        # What is set live comes on top of what is played, within what a scenario may ask for.
        self._allowed = (
            (outputs[0] + _P_E.lowest * KPA, outputs[0] + _P_E.highest * KPA),
            (outputs[1] + _SUPERHEAT.lowest, outputs[1] + _SUPERHEAT.highest),
            (flow * (1.0 + _FLOW.lowest / 100.0), flow * (1.0 + _FLOW.highest / 100.0)),
            (inlet + _INLET.lowest, inlet + _INLET.highest),
        )
        self._offsets = {parameter.name: LiveOffset(self.value(parameter.name)) for parameter in OFFSETS}
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
        played, faults = row[: len(PLAYED)], row[len(PLAYED) :]
        more = [offset.value(time_ns / 1e9) for offset in self._offsets.values()]
        more[2] *= self._flow_percent
        for topic, value in zip(SCHEDULES, faults, strict=True):
            self.send(time_ns, topic, value)
        for topic, value, offset, (low, high) in zip(PLAYED, played, more, self._allowed, strict=True):
            self.send(time_ns, topic, min(max(value + offset, low), high))

    def _changed(self, parameters: Sequence[RosParameter]) -> None:
        """Begin the live changes that have been asked for."""
        for parameter in parameters:
            if parameter.name in self._offsets:
                self._offsets[parameter.name].change(parameter.value, self.value("ramp_s"))


def main() -> int:
    """Run the node."""
    return run_node(ScenarioNode)


if __name__ == "__main__":
    sys.exit(main())
