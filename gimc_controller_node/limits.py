"""What no sampled controller can do better: how far p_e moves before anything of a fault has been measured.

``python -m gimc_controller_node.limits`` prints the bound and what E5 reaches, for the table of `docs/control.md`.
"""

from dataclasses import replace

import control
import numpy as np

from ac_plant_node import linearize
from bringup.units import RPM
from gimc.sampled import discretise
from gimc_controller_node import design_compensator
from gimc_controller_node.weights import QUICK_GUARD, CompensatorWeights, MatchingWeights


def smallest_peak_pa(point: str, sample_time_s: float, size_rad_s: float) -> float:
    """Bound for the peak of |p_e - p_e,r| after a step of f_N, under any causal sampled controller.

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


def reached_peak_pa(point: str, sample_time_s: float, guard: MatchingWeights | None = None) -> float:
    """Peak of |p_e - p_e,r| in E5 on the nonlinear plant, with the guard in use or with another one."""
    from bringup.loop import designs_at, simulate
    from bringup.scenario import load
    from bringup.summary import summarise
    from bringup.units import KPA

    overrides = [f"operating_point={point}", f"sample_time_s={sample_time_s:g}", "duration_s=620"]
    designs = designs_at(point, sample_time_s)
    if guard is not None:
        weights = replace(CompensatorWeights(), guard=guard)
        designs = replace(designs, compensator=design_compensator(point, sample_time_s, weights))
    metrics = summarise(simulate(load("actuator_fault", overrides), designs=designs))["metrics"]
    return float(metrics["peak_pressure_error_kpa"]) * KPA


def main() -> None:
    """Print the table."""
    print("| point | rate, Hz | bound, kPa | reached, kPa | with the quick guard, kPa |")
    print("|---|---|---|---|---|")
    for point in ("low", "med", "high"):
        for rate_hz in (10, 20, 50, 100):
            found = [
                smallest_peak_pa(point, 1.0 / rate_hz, 40.0 * RPM),
                reached_peak_pa(point, 1.0 / rate_hz),
                reached_peak_pa(point, 1.0 / rate_hz, QUICK_GUARD),
            ]
            cells = " | ".join(f"{peak / 1e3:.2f}" for peak in found)
            print(f"| {point} | {rate_hz} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
