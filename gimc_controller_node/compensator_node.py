"""Node `compensator`: q = Q f_e, with Q_act or Q_sen as the isolation says."""

from ac_ros_common.installation import begin_node

if __name__ == "__main__":
    begin_node()

import math
import sys
from collections.abc import Sequence

import numpy as np
from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter as RosParameter

from ac_common.fdi_status import StatusRow
from ac_common.topics import COMPENSATOR
from ac_ros_common.checkpoint import AGE_S
from ac_ros_common.loop_node import LoopNode, run_node
from ac_ros_common.parameters import (
    DESIGN_COPY,
    DESIGN_FILE,
    MEMORY_FILE,
    MODE,
    RUN_START,
    SAMPLE_TIME,
    SENSORS,
    Parameter,
)

PARAMETERS = (
    SAMPLE_TIME,
    MODE,
    RUN_START,
    MEMORY_FILE,
    SENSORS,
    DESIGN_FILE,
    DESIGN_COPY,
    Parameter("accommodate", True, "false leaves K0 alone: q fades to 0 whatever is isolated", live=True),
)
REFERENCES = ("reference/evaporator_pressure", "reference/superheat")
INPUTS = (
    "fdi/innovation/evaporator_pressure",
    "fdi/innovation/superheat",
    "fdi/innovation/wall_temperature",
    "fdi/status",
    *REFERENCES,
)
TWO_SENSORS = "accommodate cannot be true with two sensors: the compensators are designed for three"


class CompensatorNode(LoopNode):
    """Shell around `Compensator`."""

    def __init__(self) -> None:
        super().__init__(COMPENSATOR, PARAMETERS)
        self.add_on_set_parameters_callback(self._may_change)
        self.add_post_set_parameters_callback(self._changed)

    def configure(self) -> None:
        """Load the design."""
        from gimc_controller_node import Compensator, CompensatorDesign

        if self.value("sensors") == 2 and self.value("accommodate"):
            raise ValueError(TWO_SENSORS)
        self._compensator = Compensator(self.design(CompensatorDesign), accommodate=self.value("accommodate"))
        self._joins = self.run_start_ns >= 0
        self._stepped_ns = -1
        self.on_tick(
            INPUTS,
            self._step,
            holds_s={**dict.fromkeys(INPUTS, self.sample_time_s), **dict.fromkeys(REFERENCES, math.inf)},
            optional=REFERENCES,
        )

    def _step(
        self,
        time_ns: int,
        p_e: float,
        superheat: float,
        wall: float,
        status: StatusRow,
        wanted_p_e: float | None,
        wanted_superheat: float | None,
    ) -> None:
        innovation = np.array([p_e, superheat, wall])
        wanted = None if wanted_p_e is None or wanted_superheat is None else (wanted_p_e, wanted_superheat)
        if self.is_realtime:
            self._warm_restart(time_ns, innovation, status, wanted)
        q = self._compensator.step(innovation, status.isolated, status.also_isolated, wanted)
        self.enter(self._compensator.does, time_ns)
        self.send(time_ns, "compensator/q", *q.tolist())
        self.checkpoint.save(time_ns, self._compensator)

    def _warm_restart(
        self, time_ns: int, innovation: np.ndarray, status: StatusRow, reference: tuple[float, float] | None
    ) -> None:
        """Take up what was saved before a crash, and go over the ticks that were missed."""
        saved_ns = self.checkpoint.load(time_ns, self._compensator) if self._joins else None
        if saved_ns is not None:
            self._stepped_ns = saved_ns
        self._joins = False
        missed = self.missed_ticks(self._stepped_ns, time_ns) if self._stepped_ns >= 0 else 0
        if 0 < missed * self.sample_time_s < AGE_S:
            self._compensator.warm_restart(innovation, status.isolated, status.also_isolated, reference, missed)
        self._stepped_ns = time_ns

    def _may_change(self, parameters: Sequence[RosParameter]) -> SetParametersResult:
        """Refuse accommodation that no design is for."""
        on = any(parameter.name == "accommodate" and parameter.value for parameter in parameters)
        if on and self.state != "unconfigured" and self.value("sensors") == 2:
            return SetParametersResult(successful=False, reason=TWO_SENSORS)
        return SetParametersResult(successful=True)

    def _changed(self, parameters: Sequence[RosParameter]) -> None:
        """Fade the accommodation in or out while the node runs."""
        if self.state != "unconfigured" and any(parameter.name == "accommodate" for parameter in parameters):
            self._compensator.accommodate = self.value("accommodate")


def main() -> int:
    """Run the node."""
    return run_node(CompensatorNode)


if __name__ == "__main__":
    sys.exit(main())
