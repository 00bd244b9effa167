"""Node `gimc_controller`: the command from references, measurements and the compensator's q."""

import sys

import numpy as np

from bringup.ros.node_shell import DESIGN_COPY, DESIGN_FILE, OPERATING_POINT, SAMPLE_TIME, NodeShell, run_node
from bringup.topics import CONTROLLER

PARAMETERS = (OPERATING_POINT, SAMPLE_TIME, DESIGN_FILE, DESIGN_COPY)


class ControllerNode(NodeShell):
    """Shell around `Controller`."""

    def __init__(self) -> None:
        super().__init__(CONTROLLER, PARAMETERS)

    def configure(self) -> None:
        """Load the design of the operating point."""
        from gimc_controller_node import Controller, ControllerDesign

        self._controller = Controller(self.design(ControllerDesign))
        self.on_tick(
            (
                "reference/evaporator_pressure",
                "reference/superheat",
                "measured/evaporator_pressure",
                "measured/superheat",
                "compensator/q",
            ),
            self._step,
        )

    def _step(self, time_ns: int, *values: float) -> None:
        command = self._controller.step(np.array(values[:2]), np.array(values[2:4]), np.array(values[4:]))
        self.send(time_ns, "controller/command", *command.tolist())


def main() -> int:
    """Run the node."""
    return run_node(ControllerNode)


if __name__ == "__main__":
    sys.exit(main())
