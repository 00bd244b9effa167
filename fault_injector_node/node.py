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

from rclpy.parameter import Parameter as RosParameter
from std_srvs.srv import SetBool

from ac_common.fault_profiles import PROFILES, SENSOR_PROFILES, STUCK
from ac_common.faults import BY_KIND, FAULTS, KINDS, STICKING, Fault
from ac_common.health import InjectorReport
from ac_common.safe_command import COMMAND_HOLD_S, CommandHold
from ac_common.signals import Command, Inlets, Measurement, topics_of
from ac_common.topics import BY_NAME, INJECTOR
from ac_plant_node.rest import rest_at
from ac_ros_common.loop_node import LoopNode, run_node
from ac_ros_common.parameters import MODE, OPERATING_POINT, RUN_START, SAMPLE_TIME, SUPERHEAT_SENSOR, Parameter
from fault_injector_node.injector import FaultInjector, components
from fault_injector_node.live import LiveFault, Shape


def _live_parameters(fault: Fault) -> tuple[Parameter, ...]:
    kind, size, least, most = fault.kind, fault.size_parameter, fault.lowest_live_si, fault.largest_live_si
    profiles = SENSOR_PROFILES if fault.can_stick else PROFILES
    return (
        Parameter(f"{kind}.profile", "step", "how the live fault grows", choices=profiles, live=True),
        Parameter(f"{kind}.{size}", 0.0, f"size of the live fault, {fault.si_unit}", least, most, live=True),
        Parameter(f"{kind}.rise_s", 60.0, "ramp: time to full size", 0.01, 86400.0, live=True),
        Parameter(f"{kind}.period_s", 60.0, "sine, intermittent: period", 0.01, 86400.0, live=True),
        Parameter(f"{kind}.time_constant_s", 100.0, "drift, random_walk: time constant", 0.01, 86400.0, live=True),
        Parameter(f"{kind}.duty_percent", 50.0, "intermittent: share of the period", 0.0, 100.0, live=True),
        Parameter(f"{kind}.seed", 0, "random_walk, noise: seed", 0, 2**31 - 1, live=True),
    )


PARAMETERS = (
    OPERATING_POINT,
    SAMPLE_TIME,
    MODE,
    RUN_START,
    SUPERHEAT_SENSOR,
    Parameter(
        "noise_std",
        [0.0, 0.0, 0.0, 0.0],
        "standard deviation of the noise on p_e (Pa), superheat (K), T_w (K), p_c (Pa)",
    ),
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
ACTUAL, MEASURED = ((*topics_of(of, Measurement), *topics_of(of, Inlets)) for of in ("plant", "measured"))
N_MEASURED = len(Measurement._fields)
SCHEDULE = "scenario/faults"
#: Topics of what is injected, and whether one is silent while it is zero.
TRUTHS = tuple((fault.truth_topic, BY_NAME[fault.truth_topic].silent_at_zero) for fault in FAULTS)
NO_FAULT: Sequence[float] = (0.0,) * len(FAULTS)
#: Ticks whose command may still be on its way.
MOST_OPEN_TICKS = 100


class InjectorNode(LoopNode):
    """Shell around `FaultInjector`; publishes the truth about the faults for whoever evaluates the run."""

    def __init__(self) -> None:
        super().__init__(INJECTOR, PARAMETERS)
        self._live: dict[str, LiveFault] = {}
        self._switches = [self.create_service(SetBool, f"~/{kind}", partial(self._switch, kind)) for kind in KINDS]
        self.add_post_set_parameters_callback(self._changed)

    def configure(self) -> None:
        """Make the injector."""
        self._injector = FaultInjector(self.value("noise_std"), self.value("seed"), self.value("superheat_sensor"))
        self._live = {kind: LiveFault(self.value("sample_time_s")) for kind in KINDS}
        self._last_faults = self._told = NO_FAULT
        self._moved_ns = -1  # the last tick in which actuators were moved without a command
        self._open: dict[int, Sequence[float]] = {}  # of ticks whose command has not come yet
        self._measured_ns = -1
        self._derived = self.value("superheat_sensor") == "derived"
        rest = rest_at(self.value("operating_point"))
        self._actual = [*rest["outputs"].tolist(), float(rest["inputs"][3]), float(rest["inputs"][5])]
        self._tick_ns = round(1e9 * self.sample_time_s)
        self._early: tuple[int, float, float] | None = None  # a command that overtook its tick's measurement
        self._hold = CommandHold(rest["inputs"][:2], self.sample_time_s, self.value("command_hold_s"))
        # Before the first command of a run there is nothing to miss.
        self._commanded_ns = 0 if self.run_start_ns >= 0 else None
        self.on_tick(
            (*ACTUAL, SCHEDULE),
            self._measure,
            holds_s={SCHEDULE: math.inf},
            optional=ACTUAL,
            patience=0.3,
        )
        self.on_tick(("controller/command",), self._actuate)

    def _measure(self, time_ns: int, *values: float | None) -> None:
        actual, scheduled = values[: len(ACTUAL)], values[len(ACTUAL) :]
        missing = [value is None for value in actual]
        if all(missing):
            return
        sizes, wanted = scheduled[: len(KINDS)], scheduled[len(KINDS) :]
        live = [fault.value(time_ns / 1e9) for fault in self._live.values()]
        faults: Sequence[float] = tuple([(one or 0.0) + more for one, more in zip(sizes, live, strict=True)])
        stuck = [float(one or self._live[fault.kind].is_stuck) for one, fault in zip(wanted, STICKING, strict=True)]
        if self.is_realtime:
            self._watch(time_ns, faults)
        self._open[time_ns] = faults
        while len(self._open) > MOST_OPEN_TICKS:
            del self._open[min(self._open)]
        # What has not come from the plant is not made up here.
        self._actual = [last if value is None else value for value, last in zip(actual, self._actual, strict=True)]
        outputs, inlets = self._actual[:N_MEASURED], self._actual[N_MEASURED:]
        faults = self._injector.stick(outputs, inlets, faults, stuck)
        if self._derived:
            missing[1] = missing[1] or missing[0]
        measured = self._injector.measure(outputs, faults)
        readings = (*measured, *self._injector.measure_inlets(inlets, faults))
        for topic, value, is_missing in zip(MEASURED, readings, missing, strict=True):
            if not is_missing:
                self.send(time_ns, topic, value)
        self.send(time_ns, "component/faults", *components(faults))
        for (topic, silent_at_zero), value, told in zip(TRUTHS, faults, self._told, strict=True):
            if not silent_at_zero or value != 0.0 or told != 0.0:
                self.send(time_ns, topic, value)
        self._told = faults
        self._measured_ns = time_ns
        if self._early is not None and self._early[0] <= time_ns:
            early, self._early = self._early, None
            self._actuate(*early)

    def _actuate(self, time_ns: int, compressor_speed: float, valve_opening: float) -> None:
        if time_ns > self._measured_ns:
            self._early = (time_ns, compressor_speed, valve_opening)
            return
        faults = self._open.pop(time_ns, self._last_faults)
        self._commanded_ns = time_ns
        self._hold.commanded((compressor_speed, valve_opening))
        self.enter("", time_ns)
        if time_ns <= self._moved_ns:
            return  # too late: the actuators have been moved for this tick
        actuator = self._injector.actuate(Command(compressor_speed, valve_opening), faults)
        self.send(time_ns, "actuator/command", *actuator)

    def _watch(self, time_ns: int, faults: Sequence[float]) -> None:
        """Notice at the beginning of a tick that the one before had no command."""
        self._last_faults = faults
        if self._commanded_ns is None or self._commanded_ns >= time_ns - 3 * self._tick_ns // 2:
            return
        setpoint = self._hold.silent()
        self.send(time_ns, "actuator/setpoint", *setpoint.tolist())
        if self._hold.is_over:
            self.enter("no command: actuators go to the safe command", time_ns)
            self._moved_ns = time_ns
            self.send(time_ns, "actuator/command", *self._injector.actuate(setpoint.tolist(), faults))
        elif self._hold.silent_ticks > 1:
            self.enter("no command: actuators hold the last one", time_ns)

    # -- live faults --------------------------------------------------------------------------------------------

    def _shape(self, kind: str) -> Shape:
        keys = ("profile", "rise_s", "period_s", "time_constant_s", "duty_percent", "seed")
        size = self.value(f"{kind}.{BY_KIND[kind].size_parameter}")
        return Shape(size=size, **{key: self.value(f"{kind}.{key}") for key in keys})

    def _switch(self, kind: str, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        if kind not in self._live:
            response.success, response.message = False, f"the node is {self.state}: configure it first"
            return response
        if request.data:
            shape = self._shape(kind)
            self._live[kind].start(shape)
            what = "stuck" if shape.profile == STUCK else f"{shape.profile} of {shape.size:g} {BY_KIND[kind].si_unit}"
            response.message = f"{kind}: {what} starts with the next tick"
        else:
            self._live[kind].stop()
            response.message = f"{kind}: ends with the next tick"
        response.success = True
        return response

    def _changed(self, parameters: Sequence[RosParameter]) -> None:
        """Let a running live fault follow its parameters."""
        for kind, live in self._live.items():
            if any(parameter.name.startswith(f"{kind}.") for parameter in parameters):
                live.change(self._shape(kind))

    def node_health(self) -> InjectorReport:
        """Return which live faults are on."""
        return InjectorReport(tuple(kind for kind, live in self._live.items() if live.is_active))


def main() -> int:
    """Run the node."""
    return run_node(InjectorNode)


if __name__ == "__main__":
    sys.exit(main())
