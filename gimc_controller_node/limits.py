"""What no sampled controller can do better: how far p_e moves before anything of a fault has been measured."""

import control
import numpy as np

from ac_plant_node import linearize
from gimc.sampled import discretise


def smallest_peak_pa(point: str, sample_time_s: float, size_rad_s: float) -> float:
    """Bound for the peak of |p_e - p_e,r| after a step of f_N, under any causal sampled controller.

    The fault steps at a tick, right after a measurement. The command of that tick cannot know of it and is held; the
    next one acts from the next tick on, when p_e has moved by one sample of the step response. p_e cannot jump, so this
    is in the peak whatever the controller does from then on. (For a controller that knows nothing of the fault and a
    plant at rest; linear plant of the operating point.)

    Parameters
    ----------
    point : str
        "low", "med" or "high".
    sample_time_s : float
    size_rad_s : float
        Size of the fault.

    Returns
    -------
    float
        In Pa.
    """
    plant = linearize(point)
    zeros = np.zeros((1, 1))
    speed = discretise(control.ss(plant.A, plant.B[:, :1], plant.C[:1], zeros), sample_time_s, "zoh")
    return abs(float((speed.C @ speed.B)[0, 0]) * size_rad_s)
