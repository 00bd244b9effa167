"""Node `fault_injector`: sits between plant and loop in both directions.

Faults come from the scenario and, on top of them, live: set the parameters of a fault (``compressor_speed.profile``,
``compressor_speed.size_rad_s``, ...) and call the service ``~/compressor_speed`` (std_srvs/SetBool) to start or stop.

On the wall clock it is the actuators' side, too: while no command comes it tells what they hold (`actuator/setpoint`),
and after `command_hold_s` it moves them to the operating point's command.
"""

import math
import sys
from collections.abc import Sequence
from functools import partial

import numpy as np
from rclpy.parameter import Parameter as RosParameter
from std_srvs.srv import SetBool

from ac_common.fault_profiles import PROFILES
from ac_common.health import InjectorReport
from ac_common.safe_command import COMMAND_HOLD_S, CommandHold
from ac_common.topics import FAULTS, INJECTOR
from ac_plant_node.rest import rest_at
from ac_ros_common.loop_node import LoopNode, run_node
from ac_ros_common.parameters import MODE, OPERATING_POINT, RUN_START, SAMPLE_TIME, SUPERHEAT_SENSOR, Parameter
from fault_injector_node.injector import FaultInjector
from fault_injector_node.live import LiveFault, Shape

_SIZES = {
    "compressor_speed": ("size_rad_s", "rad/s", 110.0),
    "evaporator_pressure": ("size_pa", "Pa", 100_000.0),
}


def _live_parameters(fault: str) -> tuple[Parameter, ...]:
    size, unit, most = _SIZES[fault]
    return (
        Parameter(f"{fault}.profile", "step", "how the live fault grows", choices=PROFILES, live=True),
        Parameter(f"{fault}.{size}", 0.0, f"size of the live fault, {unit}", -most, most, live=True),
        Parameter(f"{fault}.rise_s", 60.0, "ramp: time to full size", 0.01, 86400.0, live=True),
        Parameter(f"{fault}.period_s", 60.0, "sine, intermittent: period", 0.01, 86400.0, live=True),
        Parameter(f"{fault}.time_constant_s", 100.0, "drift, random_walk: time constant", 0.01, 86400.0, live=True),
        Parameter(f"{fault}.duty_percent", 50.0, "intermittent: share of the period", 0.0, 100.0, live=True),
        Parameter(f"{fault}.seed", 0, "random_walk: seed", 0, 2**31 - 1, live=True),
    )


PARAMETERS = (
    OPERATING_POINT,
    SAMPLE_TIME,
    MODE,
    RUN_START,
    SUPERHEAT_SENSOR,
    Parameter("noise_std", [0.0, 0.0, 0.0], "standard deviation of the noise on p_e (Pa), superheat (K), T_w (K)"),
    Parameter(
        "command_hold_s",
        COMMAND_HOLD_S,
        "realtime: how long the actuators hold the last command before they go to the operating point's, s",
        0.0,
        60.0,
    ),
    Parameter("seed", 0, "seed of the noise", low=0, high=2**31 - 1),
    *(parameter for fault in FAULTS for parameter in _live_parameters(fault)),
)
PLANT_OUTPUTS = ("plant/evaporator_pressure", "plant/superheat", "plant/wall_temperature")
MEASURED = ("measured/evaporator_pressure", "measured/superheat", "measured/wall_temperature")
#: Ticks whose command may still be on its way.
MOST_OPEN_TICKS = 100


class InjectorNode(LoopNode):
    """Shell around `FaultInjector`; publishes the truth about the faults for whoever evaluates the run."""

    def __init__(self) -> None:
        super().__init__(INJECTOR, PARAMETERS)
        self._live: dict[str, LiveFault] = {}
        self._switches = [self.create_service(SetBool, f"~/{fault}", partial(self._switch, fault)) for fault in FAULTS]
        self.add_post_set_parameters_callback(self._changed)

    def configure(self) -> None:
        """Make the injector."""
        self._injector = FaultInjector(self.value("noise_std"), self.value("seed"), self.value("superheat_sensor"))
        self._live = {fault: LiveFault(self.value("sample_time_s")) for fault in FAULTS}
        self._last_f_n = 0.0
        self._moved_ns = -1  # the last tick in which actuators were moved without a command
        self._f_n: dict[int, float] = {}  # of ticks whose command has not come yet
        self._measured_ns = -1
        self._derived = self.value("superheat_sensor") == "derived"
        rest = rest_at(self.value("operating_point"))
        self._actual = np.array(rest["outputs"][:3], dtype=np.float64)
        self._tick_ns = round(1e9 * self.sample_time_s)
        self._early: tuple[int, float, float] | None = None  # a command that overtook its tick's measurement
        self._hold = CommandHold(rest["inputs"][:2], self.sample_time_s, self.value("command_hold_s"))
        # Before the first command of a run there is nothing to miss.
        self._commanded_ns = 0 if self.run_start_ns >= 0 else None
        self.on_tick(
            (
                *PLANT_OUTPUTS,
                "scenario/fault/compressor_speed",
                "scenario/fault/evaporator_pressure",
            ),
            self._measure,
            holds_s={"scenario/fault/compressor_speed": math.inf, "scenario/fault/evaporator_pressure": math.inf},
            optional=PLANT_OUTPUTS,
            patience=0.3,
        )
        self.on_tick(("controller/command",), self._actuate)

    def _measure(
        self,
        time_ns: int,
        p_e: float | None,
        superheat: float | None,
        wall: float | None,
        f_n: float,
        f_p: float,
    ) -> None:
        missing = [value is None for value in (p_e, superheat, wall)]
        if all(missing):
            return
        time_s = time_ns / 1e9
        f_n += self._live["compressor_speed"].value(time_s)
        f_p += self._live["evaporator_pressure"].value(time_s)
        if self.is_realtime:
            self._watch(time_ns, f_n)
        self._f_n[time_ns] = f_n
        while len(self._f_n) > MOST_OPEN_TICKS:
            del self._f_n[min(self._f_n)]
        if any(missing):  # what has not come from the plant is not made up here
            values = zip((p_e, superheat, wall), self._actual.tolist(), strict=True)
            p_e, superheat, wall = (last if value is None else value for value, last in values)
            missing[1] = missing[1] or (missing[0] and self._derived)
        self._actual[:] = (p_e, superheat, wall)
        measured = self._injector.measure(self._actual, f_p).tolist()
        for topic, value, is_missing in zip(MEASURED, measured, missing, strict=True):
            if not is_missing:
                self.send(time_ns, topic, value)
        self.send(time_ns, "fault/compressor_speed", f_n)
        self.send(time_ns, "fault/evaporator_pressure", f_p)
        self._measured_ns = time_ns
        if self._early is not None and self._early[0] <= time_ns:
            early, self._early = self._early, None
            self._actuate(*early)

    def _actuate(self, time_ns: int, compressor_speed: float, valve_opening: float) -> None:
        if time_ns > self._measured_ns:
            self._early = (time_ns, compressor_speed, valve_opening)
            return
        f_n = self._f_n.pop(time_ns, self._last_f_n)
        self._commanded_ns = time_ns
        self._hold.commanded((compressor_speed, valve_opening))
        self.enter("", time_ns)
        if time_ns <= self._moved_ns:
            return  # too late: the actuators have been moved for this tick
        actuator = self._injector.actuate(np.array([compressor_speed, valve_opening]), f_n)
        self.send(time_ns, "actuator/command", *actuator.tolist())

    def _watch(self, time_ns: int, f_n: float) -> None:
        """Notice at the beginning of a tick that the one before had no command."""
        self._last_f_n = f_n
        if self._commanded_ns is None or self._commanded_ns >= time_ns - 3 * self._tick_ns // 2:
            return
        setpoint = self._hold.silent()
        self.send(time_ns, "actuator/setpoint", *setpoint.tolist())
        if self._hold.is_over:
            self.enter("no command: actuators go to the safe command", time_ns)
            self._moved_ns = time_ns
            self.send(time_ns, "actuator/command", *self._injector.actuate(setpoint, f_n).tolist())
        elif self._hold.silent_ticks > 1:
            self.enter("no command: actuators hold the last one", time_ns)

    # -- live faults --------------------------------------------------------------------------------------------

    def _shape(self, fault: str) -> Shape:
        keys = ("profile", "rise_s", "period_s", "time_constant_s", "duty_percent", "seed")
        return Shape(size=self.value(f"{fault}.{_SIZES[fault][0]}"), **{k: self.value(f"{fault}.{k}") for k in keys})

    def _switch(self, fault: str, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        if fault not in self._live:
            response.success, response.message = False, f"the node is {self.state}: configure it first"
            return response
        if request.data:
            shape = self._shape(fault)
            self._live[fault].start(shape)
            response.message = (
                f"{fault}: {shape.profile} of {shape.size:g} {_SIZES[fault][1]} starts with the next tick"
            )
        else:
            self._live[fault].stop()
            response.message = f"{fault}: ends with the next tick"
        response.success = True
        return response

    def _changed(self, parameters: Sequence[RosParameter]) -> None:
        """Let a running live fault follow its parameters."""
        for fault, live in self._live.items():
            if any(parameter.name.startswith(f"{fault}.") for parameter in parameters):
                live.change(self._shape(fault))

    def node_health(self) -> InjectorReport:
        """Return which live faults are on."""
        return InjectorReport(tuple(fault for fault, live in self._live.items() if live.is_active))


def main() -> int:
    """Run the node."""
    return run_node(InjectorNode)


if __name__ == "__main__":
    sys.exit(main())
