"""Poles of the sampled loop of plant, K0, observer and one Q: where a compensator is stable, and by which margin.

With the plant that the observer was designed for, `f_e` does not depend on `q` (Lemma 1): any stable Q leaves the loop
stable. With another plant, or another point's observer, `f_e` sees `q` through the difference of the plants, which
closes a second loop.

``python -m ac_design.analysis.loop_stability`` prints the table of `docs/control.md`.
"""

from dataclasses import dataclass

import control
import numpy as np
from threadpoolctl import threadpool_limits

from ac_common.units import KPA
from ac_design.closed_loop import ROWS, loop_matrix, plant_away
from ac_design.store import design_compensator, design_controller, design_fdi
from ac_plant_node import linearize
from fdi_node import FdiDesign
from gimc_controller_node import CompensatorDesign, ControllerDesign

LARGEST_MARGIN = 100.0


@dataclass(frozen=True)
class LoopStability:
    """Stability of one sampled loop.

    Attributes
    ----------
    spectral_radius : float
        Largest modulus of the sampled loop's poles; stable below one.
    slowest_rad_s : float
        The same as the real part of a continuous pole; stable below zero.
    margin : float
        The factor on q up to which the loop is stable; `LARGEST_MARGIN` stands for that and more.
    """

    spectral_radius: float
    slowest_rad_s: float
    margin: float


def loop_stability(
    plant: control.StateSpace, fdi: FdiDesign, controller: ControllerDesign, compensator: CompensatorDesign, block: str
) -> LoopStability:
    """Compute poles and gain margin of the loop; parameters as in `ac_design.closed_loop.loop_matrix`."""

    def radius(gain: float) -> float:
        return float(np.abs(np.linalg.eigvals(loop_matrix(plant, fdi, controller, compensator, block, gain))).max())

    with threadpool_limits(1):  # matrices of this size are slower on several threads
        own = radius(1.0)
        low, high = 0.0, LARGEST_MARGIN
        for gain in np.geomspace(0.02, LARGEST_MARGIN, 24).tolist():
            if radius(gain) >= 1.0:
                high = gain
                break
            low = gain
        for _ in range(10 if low < LARGEST_MARGIN else 0):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if radius(middle) >= 1.0 else (middle, high)
    return LoopStability(own, float(np.log(own)) / controller.sample_time_s, high)


def medium_at(point: str, block: str, sample_time_s: float = 0.1) -> dict[str, LoopStability]:
    """Compute the stability of the medium point's Q with another point's plant and K0, for both points' observers.

    Returns
    -------
    dict
        "own observer": the observer of `point`; "medium observer": Q and observer of the medium point.
    """
    plant, k0 = linearize(point), design_controller(point, sample_time_s)
    q = design_compensator("med", sample_time_s)
    return {
        "own observer": loop_stability(plant, design_fdi(point, sample_time_s), k0, q, block),
        "medium observer": loop_stability(plant, design_fdi("med", sample_time_s), k0, q, block),
    }


AWAY = ((-40.0, 0.0), (-20.0, 0.0), (20.0, 0.0), (0.0, 5.0), (0.0, -5.0), (0.0, -10.0))
"""Where the compensators of each point are examined besides: p_e [kPa] and SH [K] off the operating point."""


def own_away(point: str, kpa: float, kelvin: float, block: str, sample_time_s: float = 0.1) -> LoopStability:
    """Compute the stability of a point's Q and observer for a plant that rests off that point."""
    fdi, k0 = design_fdi(point, sample_time_s), design_controller(point, sample_time_s)
    q = design_compensator(point, sample_time_s)
    return loop_stability(plant_away(point, kpa * KPA, kelvin), fdi, k0, q, block)


def main() -> None:
    """Print the stability of the medium point's compensators at all points, and of each point's off that point."""
    print("| Q of med at | block | observer of | slowest pole, rad/s | stable up to q times |")
    print("|---|---|---|---|---|")
    for point in ("low", "med", "high"):
        for block in ROWS:
            for observer, found in medium_at(point, block).items():
                whose = "med" if observer == "medium observer" else point
                margin = f"> {LARGEST_MARGIN:g}" if found.margin >= LARGEST_MARGIN else f"{found.margin:.2f}"
                print(f"| {point} | {block} | {whose} | {found.slowest_rad_s:.2g} | {margin} |")
    print("\n| off the point by | " + " | ".join(f"{p}, {b}" for p in ("low", "med", "high") for b in ROWS) + " |")
    print("|---" * 10 + "|")
    for kpa, kelvin in AWAY:
        margins = [own_away(point, kpa, kelvin, block).margin for point in ("low", "med", "high") for block in ROWS]
        cells = " | ".join(f"{margin:.2g}" for margin in margins)
        print(f"| {kpa:+g} kPa, {kelvin:+g} K | {cells} |", flush=True)


if __name__ == "__main__":
    main()
