"""Node `compensator`: q = Q f_e, as the isolation says.

The design of the whole envelope works on the residuals and needs to know the command of the tick before: a tick waits
for it, or for the next tick (`Sequencer`).
"""

from ac_ros_common.installation import begin_node

if __name__ == "__main__":
    begin_node()

import math
import sys
from collections.abc import Sequence
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter as RosParameter

from ac_common.faults import ISOLABLE
from ac_common.fdi_status import StatusRow
from ac_common.signals import Innovation, topics_of
from ac_common.topics import COMPENSATOR
from ac_ros_common.checkpoint import AGE_S
from ac_ros_common.loop_node import LoopNode, run_node
from ac_ros_common.parameters import (
    DESIGN,
    DESIGN_COPY,
    DESIGN_FILE,
    MEMORY_FILE,
    MODE,
    RUN_START,
    SAMPLE_TIME,
    SENSORS,
    Parameter,
)
from ac_ros_common.sequencer import Sequencer
from gimc_controller_node.accommodation import KINDS, Signal, make_compensator

PARAMETERS = (
    SAMPLE_TIME,
    MODE,
    RUN_START,
    MEMORY_FILE,
    SENSORS,
    DESIGN,
    DESIGN_FILE,
    DESIGN_COPY,
    Parameter("accommodate", True, "false leaves K0 alone: q fades to 0 whatever is isolated", live=True),
)
REFERENCES = ("reference/evaporator_pressure", "reference/superheat")
MEASURED = ("measured/evaporator_pressure", "measured/superheat")
HEAD = "measured/condenser_pressure"
#: Topics of what a compensator may work on.
SIGNALS = {
    "innovation": topics_of("fdi/innovation", Innovation),
    "residual": tuple(fault.residual_topic for fault in ISOLABLE),
}
TWO_SENSORS = "accommodate cannot be true with two sensors: the compensators are designed for three"


class CompensatorNode(LoopNode):
    """Shell around a compensator."""

    def __init__(self) -> None:
        super().__init__(COMPENSATOR, PARAMETERS)
        self._may_act = True
        self.add_on_set_parameters_callback(self._may_change)
        self.add_post_set_parameters_callback(self._changed)

    def configure(self) -> None:
        """Load the design."""
        self._compensator, kind = make_compensator(self.design(KINDS), self.value("accommodate"))
        self._may_act = self.value("sensors") >= kind.least_sensors
        if self.value("accommodate") and not self._may_act:
            raise ValueError(TWO_SENSORS)
        self._joins = self.run_start_ns >= 0
        self._stepped_ns = -1
        signals = SIGNALS[kind.reads]
        self._reads = len(signals)
        optional = (*REFERENCES, *MEASURED, HEAD) if kind.sees_loop else REFERENCES
        inputs = (*signals, "fdi/status", *optional)
        sequencer = Sequencer(self._step, self._commanded)
        self.on_tick(
            inputs,
            sequencer.measured if kind.sees_loop else self._step,
            holds_s={**dict.fromkeys(inputs, self.sample_time_s), **dict.fromkeys(REFERENCES, math.inf)},
            optional=optional,
        )
        if kind.sees_loop:
            self.on_tick(("controller/command",), sequencer.commanded)

    def _step(self, time_ns: int, *values: Any) -> None:
        signal: Signal = values[: self._reads]
        status: StatusRow = values[self._reads]
        reference, measured = (_all(values[at : at + 2]) for at in (self._reads + 1, self._reads + 3))
        if measured is not None and values[-1] is not None:
            measured = (*measured, values[-1])
        if self.is_realtime:
            self._warm_restart(time_ns, signal, status, reference)
        q = self._compensator.step(signal, *status.acted_on, reference, measured, bool(status.unsure))
        self.enter(self._compensator.does, time_ns)
        self.send(time_ns, "compensator/q", *q.tolist())
        self.checkpoint.save(time_ns, self._compensator)

    def _commanded(self, *command: float) -> None:
        self._compensator.commanded(command)

    def _warm_restart(self, time_ns: int, signal: Signal, status: StatusRow, reference: Signal | None) -> None:
        """Take up what was saved before a crash, and go over the ticks that were missed."""
        saved_ns = self.checkpoint.load(time_ns, self._compensator) if self._joins else None
        if saved_ns is not None:
            self._stepped_ns = saved_ns
        self._joins = False
        missed = self.missed_ticks(self._stepped_ns, time_ns) if self._stepped_ns >= 0 else 0
        if 0 < missed * self.sample_time_s < AGE_S:
            self._compensator.warm_restart(signal, *status.acted_on, reference, missed)
        self._stepped_ns = time_ns

    def _may_change(self, parameters: Sequence[RosParameter]) -> SetParametersResult:
        """Refuse accommodation that no design is for."""
        on = any(parameter.name == "accommodate" and parameter.value for parameter in parameters)
        if on and self.state != "unconfigured" and not self._may_act:
            return SetParametersResult(successful=False, reason=TWO_SENSORS)
        return SetParametersResult(successful=True)

    def _changed(self, parameters: Sequence[RosParameter]) -> None:
        """Fade the accommodation in or out while the node runs."""
        if self.state != "unconfigured" and any(parameter.name == "accommodate" for parameter in parameters):
            self._compensator.accommodate = self.value("accommodate")


def _all(values: tuple[float | None, ...]) -> Signal | None:
    """Return two values when both are there."""
    first, second = values if len(values) == 2 else (None, None)
    return None if first is None or second is None else (first, second)


def main() -> int:
    """Run the node."""
    return run_node(CompensatorNode)


if __name__ == "__main__":
    sys.exit(main())
