"""Your own controller in the loop: two PI controllers, one for each output, without any compensator.

    acftc run actuator_fault --node gimc_controller="python examples/own_controller.py" --out results/pi

Detection and isolation work with any controller: they only look at commands and measurements. This one pays no
attention to the compensator's q, so what is isolated is not accommodated. See docs/how-to/own-controller.md.
"""

import sys

import numpy as np

from ac_plant_node import operating_point
from ac_ros_common.loop_node import LoopNode, run_node
from ac_ros_common.parameters import OPERATING_POINT, SAMPLE_TIME

# Evaporator pressure moves with the compressor (-0.1 kPa/rpm at rest), superheat with the valve (falls as it opens).
PROPORTIONAL = np.array([-1.0e-3, -4.0e-3])  # rad/s per Pa, opening per K
INTEGRAL_TIME_S = np.array([15.0, 20.0])
COMMAND_MIN, COMMAND_MAX = np.array([0.0, 0.0]), np.array([628.0, 1.0])


class PiController:
    """Two loops; the integrals stop while their command is at a limit."""

    def __init__(self, rest: np.ndarray, sample_time_s: float) -> None:
        self._rest = rest
        self._rate = sample_time_s / INTEGRAL_TIME_S
        self._integral = np.zeros(2)

    def step(self, error: np.ndarray) -> np.ndarray:
        """Command [rad/s, 0..1] for `reference - measured` [Pa, K]."""
        wanted = self._rest + PROPORTIONAL * (error + self._integral)
        command = np.clip(wanted, COMMAND_MIN, COMMAND_MAX)
        self._integral += np.where(command == wanted, self._rate * error, 0.0)
        return command


class PiNode(LoopNode):
    """Acts when references and measurements of a tick are there."""

    def __init__(self) -> None:
        super().__init__("gimc_controller", (OPERATING_POINT, SAMPLE_TIME))

    def configure(self) -> None:
        rest = operating_point(self.value("operating_point")).inputs[:2]
        self._controller = PiController(rest, self.value("sample_time_s"))
        signals = ("evaporator_pressure", "superheat")
        self.on_tick([f"{kind}/{signal}" for kind in ("reference", "measured") for signal in signals], self._step)

    def _step(self, time_ns: int, *values: float) -> None:
        error = np.array(values[:2]) - np.array(values[2:])
        self.send(time_ns, "controller/command", *self._controller.step(error).tolist())


if __name__ == "__main__":
    sys.exit(run_node(PiNode))
