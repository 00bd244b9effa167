"""Steps of the reference of p_e with K0 alone: ``python -m gimc_controller_node.step_response`` prints the overshoots.

With and without the governor, the commands' limits and the plant's nonlinearity, which is how docs/control.md tells
what each of them does. A step lasts 200 s, and the way back as long.
"""

from collections.abc import Sequence
from dataclasses import replace

import control
import numpy as np
from numpy.typing import NDArray

from ac_plant_node import Plant, linearize, operating_point
from bringup.units import KPA
from gimc.sampled import discretise
from gimc_controller_node import Controller, design_controller

Vector = NDArray[np.float64]

STEPS_KPA = {"low": (20.0, -20.0, 40.0, -40.0, 60.0), "med": (20.0, -20.0, 40.0, -40.0, 70.0, -100.0),
             "high": (20.0, -20.0, 40.0, -40.0, 60.0, 90.0)}  # fmt: skip
"""The steps that are looked at, by operating point."""

BEGIN_S, BACK_S, END_S = 10.0, 210.0, 410.0
_UNLIMITED = np.full(2, np.inf)


def run(
    point: str,
    targets_kpa: Sequence[tuple[float, float]],
    until_s: float,
    *,
    linear: bool = False,
    limits: bool = True,
    governed: bool = True,
    sample_time_s: float = 0.1,
) -> tuple[Vector, int]:
    """Let the reference of p_e go through `targets_kpa`, pairs of a time [s] and a step off the operating point [kPa].

    Returns
    -------
    ndarray, shape (ticks,)
        p_e minus the operating point's [kPa].
    int
        For how many ticks a limit held the command back.
    """
    rest, design = operating_point(point), design_controller(point, sample_time_s)
    if not limits:
        design = replace(design, command_min=-_UNLIMITED, command_max=_UNLIMITED, command_rate=_UNLIMITED)
    if not governed:
        design = replace(design, lead=_UNLIMITED)
    controller = Controller(design)
    start, at_rest = np.array(rest.outputs[:2]), np.array(rest.inputs[:2])
    matrices = linearize(point)
    from_commands = control.ss(matrices.A, matrices.B[:, :2], matrices.C[:2], np.zeros((2, 2)))
    sampled = discretise(from_commands, sample_time_s, "zoh")
    plant, inputs, state, outputs = Plant.at(point), rest.inputs.copy(), np.zeros(len(sampled.A)), start
    pressure, held = np.empty(round(until_s / sample_time_s)), 0
    for k in range(len(pressure)):
        target = [kpa for start_s, kpa in targets_kpa if start_s <= k * sample_time_s][-1:] or [0.0]
        pressure[k] = (outputs[0] - start[0]) / KPA
        inputs[:2] = controller.step(start + np.array([target[0] * KPA, 0.0]), outputs, np.zeros(2))
        held += any(controller.at_limit)
        if linear:
            state = sampled.A @ state + sampled.B @ (inputs[:2] - at_rest)
            outputs = start + sampled.C @ state
        else:
            outputs = plant.step(inputs, sample_time_s)[:2]
    return pressure, held


def overshoot(pressure: Vector, start: float, target: float) -> float:
    """How far beyond `target` a step from `start` goes, over its size."""
    return float(((pressure - target) / (target - start)).max())


def there_and_back(
    point: str, step_kpa: float, *, linear: bool = False, limits: bool = True, governed: bool = True
) -> tuple[float, float]:
    """Overshoot of a step of the reference of p_e [kPa] and of the way back, over its size; keywords as of `run`."""
    targets = [(BEGIN_S, step_kpa), (BACK_S, 0.0)]
    pressure, _ = run(point, targets, END_S, linear=linear, limits=limits, governed=governed)
    back = round(BACK_S / END_S * len(pressure))
    return overshoot(pressure[:back], 0.0, step_kpa), overshoot(pressure[back:], float(pressure[back - 1]), 0.0)


def main() -> None:
    """Print the table: overshoot there / back in %."""
    print("| point, step | governor | no governor | neither governor nor limits | linear plant, limits, no governor |")
    print("|---|---|---|---|---|")
    for point, steps in STEPS_KPA.items():
        for step_kpa in steps:
            cells = [
                there_and_back(point, step_kpa),
                there_and_back(point, step_kpa, governed=False),
                there_and_back(point, step_kpa, governed=False, limits=False),
                there_and_back(point, step_kpa, governed=False, linear=True),
            ]
            texts = [f"{100 * there:.1f} / {100 * back:.1f}".replace("-0.0", "0.0") for there, back in cells]
            print(f"| {point}, {step_kpa:+g} kPa | {' | '.join(texts)} |", flush=True)


if __name__ == "__main__":
    main()
