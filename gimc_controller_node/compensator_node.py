"""Node `compensator`: q = Q f_e, with Q_act or Q_sen as the isolation says."""

import sys
from collections.abc import Sequence

import numpy as np
from rclpy.parameter import Parameter as RosParameter

from bringup.recording import StatusRow
from bringup.ros.node_shell import (
    DESIGN_COPY,
    DESIGN_FILE,
    OPERATING_POINT,
    SAMPLE_TIME,
    SUPERHEAT_SENSOR,
    NodeShell,
    Parameter,
    run_node,
)
from bringup.topics import COMPENSATOR

PARAMETERS = (
    OPERATING_POINT,
    SAMPLE_TIME,
    SUPERHEAT_SENSOR,
    DESIGN_FILE,
    DESIGN_COPY,
    Parameter("accommodate", True, "false leaves K0 alone: q fades to 0 whatever is isolated", live=True),
)


class CompensatorNode(NodeShell):
    """Shell around `Compensator`."""

    def __init__(self) -> None:
        super().__init__(COMPENSATOR, PARAMETERS)
        self.add_post_set_parameters_callback(self._changed)

    def configure(self) -> None:
        """Load the design of the operating point."""
        from gimc_controller_node import Compensator, CompensatorDesign

        self._compensator = Compensator(
            self.design(CompensatorDesign, superheat=self.value("superheat_sensor")),
            accommodate=self.value("accommodate"),
        )
        self.on_tick(
            (
                "fdi/innovation/evaporator_pressure",
                "fdi/innovation/superheat",
                "fdi/innovation/wall_temperature",
                "fdi/status",
            ),
            self._step,
        )

    def _step(self, time_ns: int, p_e: float, superheat: float, wall: float, status: StatusRow) -> None:
        q = self._compensator.step(np.array([p_e, superheat, wall]), status.isolated, status.also_isolated)
        self.send(time_ns, "compensator/q", *q.tolist())

    def _changed(self, parameters: Sequence[RosParameter]) -> None:
        """Fade the accommodation in or out while the node runs."""
        if self.state != "unconfigured" and any(parameter.name == "accommodate" for parameter in parameters):
            self._compensator.accommodate = self.value("accommodate")


def main() -> int:
    """Run the node."""
    return run_node(CompensatorNode)


if __name__ == "__main__":
    sys.exit(main())
