"""Where q has to be scaled: gain margins of a point's compensators with the plant at rest elsewhere, for `Reach`."""

import numpy as np
from numpy.typing import NDArray

from ac_common.units import KPA
from ac_design.closed_loop import ROWS, loop_matrix, plant_away
from fdi_node.detector import FdiDesign
from gimc_controller_node.compensator import CompensatorDesign
from gimc_controller_node.controller import ControllerDesign

Vector = NDArray[np.float64]

MARGIN = 2.0
"""Gain margin that the scaling of q keeps: the customary 6 dB."""

OFFSETS = np.array([[-40.0, -20.0, 0.0, 20.0, 40.0], [-10.0, -5.0, 0.0, 5.0, 10.0]]) * np.array([[KPA], [1.0]])
"""Where the margins are computed: p_e [Pa] and SH [K] off the operating point, one of them at a time."""

GAINS = np.geomspace(0.05, 5.0, 24)
"""Factors on q that are tried."""


def reach_excess(point: str, fdi: FdiDesign, controller: ControllerDesign, compensator: CompensatorDesign) -> Vector:
    """Return how many times q exceeds what leaves the gain margin `MARGIN`, at each of `OFFSETS`, shape (2, 5).

    At the operating point itself it is zero: `f_e` does not depend on q there. Where the plant has no equilibrium, it
    is the value at the next offset nearer to the point.
    """
    excess = np.zeros(OFFSETS.shape)
    middle = OFFSETS.shape[1] // 2
    for quantity in (0, 1):
        for direction in (-1, 1):
            for steps in range(1, middle + 1):
                column = middle + direction * steps
                off = [0.0, 0.0]
                off[quantity] = float(OFFSETS[quantity, column])
                try:
                    excess[quantity, column] = 1.0 / _most(point, off, fdi, controller, compensator)
                except (ValueError, RuntimeError):
                    excess[quantity, column] = excess[quantity, column - direction]
    return excess


def _most(
    point: str, off: list[float], fdi: FdiDesign, controller: ControllerDesign, compensator: CompensatorDesign
) -> float:
    plant, reached = plant_away(point, *off), float(GAINS[0])
    for gain in GAINS.tolist():
        loops = (loop_matrix(plant, fdi, controller, compensator, block, MARGIN * gain) for block in ROWS)
        if any(np.abs(np.linalg.eigvals(matrix)).max() >= 1.0 for matrix in loops):
            break
        reached = gain
    return reached
