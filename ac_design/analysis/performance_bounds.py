"""Bounds on the performance of any sampled controller: how far p_e moves before a fault can be measured.

python -m ac_design.analysis.performance_bounds     # the table of docs/control.md: what a later isolation costs
"""

import math

import control
import numpy as np
from scipy.optimize import linprog

from ac_common.sample_time import DEFAULT_SAMPLE_TIME_S
from ac_common.units import KPA, RPM
from ac_plant_node import POINTS, linearize
from gimc.sampled import discretise
from gimc_controller_node.command_limits import CommandLimits


def smallest_peak_pa(point: str, sample_time_s: float, size_rad_s: float) -> float:
    """Return a lower bound of the peak of |p_e - p_e,r| after a step of f_N, under any causal sampled controller.

    The fault steps at a tick, right after a measurement, as the scenarios have it; one that comes between two ticks is
    seen sooner after it, so this is the worst case. (For a controller in continuous time, as the paper's simulation has
    it, the bound is zero.) The command of that tick cannot know of it and is held; the next one acts from the next tick
    on, when p_e has moved by one sample of the step response. p_e cannot jump, so this is in the peak whatever the
    controller does from then on. For a controller that knows nothing of the fault, a plant at rest, and the linear
    plant of the operating point.

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


def attainable_peak_pa(
    point: str, sample_time_s: float, size_rad_s: float, ticks: int = 60, known_after: int = 1
) -> float:
    """Return the least peak of |p_e - p_e,r| at the ticks, for commands that know the fault some ticks later.

    It is the solution of a linear program over the commands of both actuators on the linear plant, within their rate
    limits. Where it equals `smallest_peak_pa`, that bound is sharp: a controller that recognises the fault in the first
    measurement reaches it.

    Parameters
    ----------
    point, sample_time_s, size_rad_s
        As in `smallest_peak_pa`.
    ticks : int
        How far the program looks.
    known_after : int
        How many ticks after the fault the commands know of it; those before are held.

    Returns
    -------
    float
        In Pa.
    """
    plant = linearize(point)
    sampled = discretise(control.ss(plant.A, plant.B[:, :2], plant.C[:1], np.zeros((1, 2))), sample_time_s, "zoh")
    state, held = sampled.B @ np.array([size_rad_s, 0.0]), []
    pulses = [sampled.C @ np.linalg.matrix_power(sampled.A, k) @ sampled.B for k in range(ticks)]
    for _ in range(ticks):  # p_e at tick 1, 2, ... with the fault alone
        held.append(float((sampled.C @ state)[0]))
        state = sampled.A @ state + sampled.B @ np.array([size_rad_s, 0.0])
    # Unknown: the commands of ticks 1 to n - 1, in the rates' units, and the peak in units of the size's effect.
    stride = np.array(CommandLimits().rate) * np.array([RPM, 0.01]) * sample_time_s
    unit, n = abs(held[0]), 2 * (ticks - 1)
    effect = np.zeros((ticks, n + 1))
    for row in range(ticks):
        for column in range(known_after - 1, row):
            effect[row, 2 * column : 2 * column + 2] = (pulses[row - 1 - column] * stride / unit).ravel()
    peak, free = np.zeros((1, n + 1)), np.array(held) / unit
    peak[0, n] = 1.0
    change = np.eye(n, n + 1) - np.eye(n, n + 1, k=-2)
    result = linprog(
        peak[0],
        A_ub=np.vstack([effect - peak, -effect - peak, change, -change]),
        b_ub=np.concatenate([-free, free, np.ones(2 * n)]),
        bounds=(None, None),
    )
    if result.status != 0:
        raise RuntimeError(f"no least peak found at {point}: {result.message}")
    return float(result.fun) * unit


def main() -> None:
    """Print the least peak of p_e by when 40 rpm are known, and how often noise alone moves a reading as far."""
    size, step_s, noise_pa = 40.0 * RPM, DEFAULT_SAMPLE_TIME_S, 0.2 * KPA
    print("| known after, s | " + " | ".join(POINTS) + " |")
    print("|---|" + "---|" * len(POINTS))
    for ticks in range(1, 6):
        peaks = [attainable_peak_pa(point, step_s, size, known_after=ticks) / KPA for point in POINTS]
        print(f"| {ticks * step_s:.1f} | " + " | ".join(f"{peak:.2f} kPa" for peak in peaks) + " |")
    moved = [smallest_peak_pa(point, step_s, size) / noise_pa for point in POINTS]
    chances = [math.erfc(sigmas / math.sqrt(2.0)) * 3600.0 / step_s for sigmas in moved]
    print("| moved in one tick, standard deviations of 0.2 kPa | " + " | ".join(f"{one:.1f}" for one in moved) + " |")
    print("| ticks an hour in which noise does as much | " + " | ".join(f"{one:.0f}" for one in chances) + " |")


if __name__ == "__main__":
    main()
