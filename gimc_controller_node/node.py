"""Node `gimc_controller`: the command from references, measurements and the compensator's q.

On the wall clock every tick gets a command, whatever is missing: without q K0 alone, with measurements that stay away
for longer than `MEASUREMENT_HOLD_S` the safe command. A controller that joins a run under way takes over from what the
actuators do (`actuator/setpoint`).
"""

import math
import sys

import numpy as np

from ac_common.signals import CarSide
from ac_common.topics import CONTROLLER
from ac_ros_common.loop_node import LoopNode, run_node
from ac_ros_common.parameters import (
    DESIGN_COPY,
    DESIGN_FILE,
    MODE,
    RUN_START,
    SAMPLE_TIME,
    Parameter,
)
from ac_ros_common.stuck_sensor import STUCK_S, StuckSensor
from gimc_controller_node.protection import NO_HIGHEST_HEAD_PA, ProtectionLimits

#: Fields of `ProtectionLimits` that are parameters, with what they may be.
LIMITS = {
    "lowest_pressure_pa": (0.0, 1e6, "evaporator pressure below which the compressor speed is capped, Pa"),
    "lowest_superheat_k": (0.0, 50.0, "superheat below which the valve opening is capped, K"),
    "highest_head_pa": (0.0, NO_HIGHEST_HEAD_PA, "condenser pressure above which the compressor speed is capped, Pa"),
    "release_s": (0.0, 600.0, "how long a command must be below its cap before the cap is gone, s"),
}
PARAMETERS = (
    SAMPLE_TIME,
    MODE,
    RUN_START,
    DESIGN_FILE,
    DESIGN_COPY,
    Parameter(
        "controller_class",
        "",
        "class of a controller of yours, my_module.MyClass, found from the folder where the node is started; empty: K0",
    ),
    Parameter("in_car", False, "whether `scenario/car` tells the speed that a belt gives the compressor"),
    *(
        Parameter(f"protection.{name}", getattr(ProtectionLimits(), name), text, low, high)
        for name, (low, high, text) in LIMITS.items()
    ),
)

#: Bounds the references, where the design says how near its temperature the refrigerant may come.
AIR_INLET = "measured/air_inlet_temperature"
#: What the protection goes by beside the controlled outputs, where there is such a sensor.
HEAD = "measured/condenser_pressure"
#: How long the last measurement stands in for a missing one, s.
MEASUREMENT_HOLD_S = 0.5
#: How long a controller that joins a run waits to be told what the actuators do, s.
SETPOINT_PATIENCE_S = 1.0
#: For how many ticks, in s, one that joins takes over anew when the actuators have not heard it.
DISCOVERY_S = 5.0
#: Part of the sample time that the controller waits for what is missing: its command has some way to go yet.
PATIENCE = 0.7


class ControllerNode(LoopNode):
    """Shell around a `Controller` and all that stands around one (`make_controller`)."""

    def __init__(self) -> None:
        super().__init__(CONTROLLER, PARAMETERS)

    def configure(self) -> None:
        """Load the design."""
        from gimc_controller_node.making import KINDS, check_controller, make_controller

        limits = ProtectionLimits(**{name: self.value(f"protection.{name}") for name in LIMITS})
        design, own = self.design(KINDS), self.value("controller_class")
        if own:
            check_controller(own, design)
        self._controller = make_controller(design, own, limits)
        self._stuck = StuckSensor(("measured/evaporator_pressure", "measured/superheat"))
        self._setpoint: np.ndarray | None = None
        self._joins = self.run_start_ns >= 0
        self._waited_s = 0.0
        self._unheard_s = DISCOVERY_S if self._joins else 0.0
        drive = ("scenario/car",) if self.value("in_car") else ()
        self.on_tick(
            (
                "reference/evaporator_pressure",
                "reference/superheat",
                "measured/evaporator_pressure",
                "measured/superheat",
                "compensator/q",
                AIR_INLET,
                HEAD,
                *drive,
            ),
            self._step,
            holds_s={
                **dict.fromkeys((AIR_INLET, *drive), math.inf),
                "reference/evaporator_pressure": math.inf,
                "reference/superheat": math.inf,
                "measured/evaporator_pressure": MEASUREMENT_HOLD_S,
                "measured/superheat": MEASUREMENT_HOLD_S,
                HEAD: MEASUREMENT_HOLD_S,
            },
            optional=("compensator/q", AIR_INLET, HEAD),
            patience=PATIENCE,
            on_missed_inputs=self._on_missed_inputs,
        )
        if self.is_realtime:
            self.on_tick(("actuator/setpoint",), self._held)

    def _step(self, time_ns: int, *values: float) -> None:
        if self.is_realtime and (topic := self._stuck.which(time_ns / 1e9, values[2:4])):
            self.health.reject(topic, "frozen", f"{topic}: has stood still for {STUCK_S:g} s while others moved")
            self._on_missed_inputs(time_ns)
            return
        reference, measured = np.array(values[:2]), np.array(values[2:4])
        if self._joins and not self._take_over(measured, reference):
            return
        q = None if values[4] is None else np.array(values[4:6])
        if len(values) > 8:
            self._controller.drive(CarSide(*values[8:]).belt_speed)
        self._send(time_ns, self._controller.step(reference, measured, q, *values[6:8]))

    def _on_missed_inputs(self, time_ns: int) -> None:
        if not self._joins:
            self._send(time_ns, self._controller.on_missed_inputs())

    def _send(self, time_ns: int, command: np.ndarray) -> None:
        if self._controller.does != self.health.mode:
            self.enter(self._controller.does, time_ns)
        self.send(time_ns, "controller/command", *command.tolist())

    def _held(self, time_ns: int, *setpoint: float) -> None:  # noqa: ARG002
        self._setpoint = np.array(setpoint)
        if self._unheard_s > 0.0:  # the actuators do not get its commands yet: take over anew
            self._joins = True

    def _take_over(self, measured: np.ndarray, reference: np.ndarray) -> bool:
        """Begin from what the actuators do; False while that is not known."""
        self._waited_s += self.sample_time_s
        self._unheard_s -= self.sample_time_s
        if self._setpoint is not None:
            self._controller.warm_restart(self._setpoint, measured, reference)
        elif self._waited_s < SETPOINT_PATIENCE_S:
            return False
        self._joins = False
        return True


def main() -> int:
    """Run the node."""
    return run_node(ControllerNode)


if __name__ == "__main__":
    sys.exit(main())
