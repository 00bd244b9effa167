"""Poles of the sampled loop of plant, K0, observer and one Q: where a compensator is stable, and by which margin.

With the plant that the observer was designed for, `f_e` does not depend on `q` (Lemma 1): any stable Q leaves the loop
stable. With another plant, or another point's observer, `f_e` sees `q` through the difference of the plants, which
closes a second loop.

``python -m ac_design.analysis.loop_stability`` prints the table of `docs/control.md`.
"""

from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root
from threadpoolctl import threadpool_limits

from ac_common.units import KPA
from ac_design.store import design_compensator, design_controller, design_fdi
from ac_plant_node import OperatingPoint, linearize, operating_point
from ac_plant_node.equilibrium import equilibrium
from fdi_node import FdiDesign
from gimc.sampled import discretise
from gimc_controller_node import CompensatorDesign, ControllerDesign

Matrix = NDArray[np.float64]

ROWS = {"Q_both": slice(0, 2), "Q_act": slice(2, 4), "Q_sen": slice(4, 6)}
"""Rows of the compensator's output."""

LARGEST_MARGIN = 100.0


@dataclass(frozen=True)
class LoopStability:
    """Of one loop.

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


def loop_matrix(
    plant: control.StateSpace,
    fdi: FdiDesign,
    controller: ControllerDesign,
    compensator: CompensatorDesign,
    block: str,
    gain: float = 1.0,
) -> Matrix:
    """State matrix of the sampled loop, state [plant, observer, Q, K0].

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


def loop_stability(
    plant: control.StateSpace, fdi: FdiDesign, controller: ControllerDesign, compensator: CompensatorDesign, block: str
) -> LoopStability:
    """Poles and margin of the loop; parameters as of `loop_matrix`."""

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
    """The medium point's Q at another point's plant and K0: with that point's observer, and with its own.

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
"""Where else each point's own compensators are looked at: p_e [kPa] and SH [K] off the operating point."""


def plant_away(point: str, pressure_pa: float, superheat_k: float) -> control.StateSpace:
    """Linear plant at rest with p_e and SH so far off the operating point, air as it is there."""
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


def own_away(point: str, kpa: float, kelvin: float, block: str, sample_time_s: float = 0.1) -> LoopStability:
    """A point's own Q and observer where the plant rests elsewhere than they were designed for."""
    fdi, k0 = design_fdi(point, sample_time_s), design_controller(point, sample_time_s)
    q = design_compensator(point, sample_time_s)
    return loop_stability(plant_away(point, kpa * KPA, kelvin), fdi, k0, q, block)


def main() -> None:
    """Print the medium point's compensators at all points, and each point's own away from it."""
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
