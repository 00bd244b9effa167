"""Your own plant in the loop: here the linear model that the designs are made from, in place of the nonlinear one.

    acftc run actuator_fault --node ac_plant="python examples/own_plant.py" --out results/linear_plant

The node keeps its topics, its life cycle and its two modes; only what it advances is yours. See
docs/how-to/own-plant.md.
"""

import sys

import numpy as np

from ac_plant_node import linearize, operating_point
from ac_plant_node.node import PlantNode
from ac_ros_common.loop_node import run_node
from gimc import discretise


class LinearModel:
    """The plant linearised at an operating point and sampled with its inputs held."""

    def __init__(self, point: str, sample_time_s: float) -> None:
        rest = operating_point(point)
        self.inputs, self.outputs = rest.inputs, rest.outputs
        self._sampled = discretise(linearize(point), sample_time_s, "zoh")
        self._state = np.zeros(len(self._sampled.A))

    def step(self, inputs: np.ndarray, _duration_s: float) -> np.ndarray:
        """Outputs a sample later, SI units."""
        model = self._sampled
        self._state = model.A @ self._state + model.B @ (inputs - self.inputs)
        outputs = np.array(self.outputs)
        outputs[:3] += model.C @ self._state  # the condenser's pressure is no output of the linear model: it stays
        return outputs


class LinearPlantNode(PlantNode):
    """The plant's node with another model inside."""

    def make_model(self) -> tuple[LinearModel, np.ndarray, np.ndarray]:
        model = LinearModel(self.value("operating_point"), self.value("sample_time_s"))
        return model, model.inputs, model.outputs


if __name__ == "__main__":
    sys.exit(run_node(LinearPlantNode))
