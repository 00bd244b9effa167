"""The sampled loop of plant, K0, observer and one Q as a matrix; the linear plant away from the operating points."""

import control
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from ac_common.units import KPA
from ac_plant_node import OperatingPoint, linearize, operating_point
from ac_plant_node.equilibrium import equilibrium
from fdi_node import FdiDesign
from gimc.sampled import discretise
from gimc_controller_node import CompensatorDesign, ControllerDesign

Matrix = NDArray[np.float64]

ROWS = {"Q_both": slice(0, 2), "Q_act": slice(2, 4), "Q_sen": slice(4, 6)}
"""Rows of the compensator's output."""


def loop_matrix(
    plant: control.StateSpace,
    fdi: FdiDesign,
    controller: ControllerDesign,
    compensator: CompensatorDesign,
    block: str,
    gain: float = 1.0,
) -> Matrix:
    """Return the state matrix of the sampled loop, state [plant, observer, Q, K0].

    Parameters
    ----------
    plant : StateSpace
        As `ac_plant_node.linearize` returns it.
    fdi, controller, compensator
        Sampled designs, all for one sample time.
    block : "Q_both", "Q_act" or "Q_sen"
        The filter that gives q.
    gain : float
        Factor on q.
    """
    speed_and_valve = control.ss(plant.A, plant.B[:, :2], plant.C, np.zeros((3, 2)))
    sampled = discretise(speed_and_valve, controller.sample_time_s, "zoh")
    sizes = [len(sampled.A), len(fdi.a), len(compensator.a), len(controller.phi)]
    ends = np.cumsum(sizes)
    x, xi, s, k = (np.eye(ends[-1])[end - n : end] for end, n in zip(ends, sizes, strict=True))
    rows = ROWS[block]
    y = sampled.C @ x
    f_e = fdi.c @ xi - y
    q = gain * (compensator.c[rows] @ s + compensator.d[rows] @ f_e)
    u = controller.c @ k - controller.d @ y[:2] + q
    return np.vstack(
        [
            sampled.A @ x + sampled.B @ u,
            fdi.a @ xi + fdi.b[:, :2] @ u + fdi.b[:, 3:] @ y,
            compensator.a @ s + compensator.b @ f_e,
            controller.phi @ k - controller.gamma[:, :2] @ y[:2] + controller.gamma[:, 2:] @ u,
        ]
    )


def plant_away(point: str, pressure_pa: float, superheat_k: float) -> control.StateSpace:
    """Return the linear plant at the equilibrium with p_e and SH off the operating point, the air as at that point.

    Parameters
    ----------
    point : str
        "low", "med" or "high".
    pressure_pa, superheat_k : float
        Offsets of p_e and SH.

    Raises
    ------
    RuntimeError
        When no equilibrium is found.
    """
    rest = operating_point(point)
    wanted = rest.outputs[:2] + np.array([pressure_pa, superheat_k])

    def at(share: Matrix) -> OperatingPoint:
        return equilibrium(np.concatenate([rest.inputs[:2] * (1.0 + share), rest.inputs[2:]]), start=rest.state)

    def error(share: Matrix) -> Matrix:
        return np.asarray((at(share).outputs[:2] - wanted) / np.array([5.0 * KPA, 2.5]))

    found = root(error, np.zeros(2), tol=1e-6)
    if not found.success or np.abs(found.fun).max() > 1e-3:
        raise RuntimeError(f"no rest found {pressure_pa / KPA:+g} kPa, {superheat_k:+g} K off {point}: {found.message}")
    return linearize(at(found.x))
