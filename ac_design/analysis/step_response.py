"""Steps of the references with K0 alone: ``python -m ac_design.analysis.step_response`` prints overshoots of p_e.

With and without the reference governor, the limits of the commands and the nonlinearity of the plant; docs/control.md
has the table. A step lasts 200 s, and the way back as long.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import control
import numpy as np
from numpy.typing import NDArray

from ac_common.units import KPA
from ac_design.store import design_controller
from ac_plant_node import Plant, linearize, operating_point
from gimc.sampled import discretise
from gimc_controller_node import limited_k0

Vector = NDArray[np.float64]

STEPS_KPA = {"low": (20.0, -20.0, 40.0, -40.0, 60.0), "med": (20.0, -20.0, 40.0, -40.0, 70.0, -100.0),
             "high": (20.0, -20.0, 40.0, -40.0, 60.0, 90.0)}  # fmt: skip
"""Steps of the reference of p_e, by operating point."""

BEGIN_S, BACK_S, END_S = 10.0, 210.0, 410.0
_UNLIMITED = np.full(2, np.inf)

Step = tuple[float, float, float]
"""From a time [s] on, the references are so far off the operating point: p_e [kPa], SH [K]."""


@dataclass(frozen=True)
class Response:
    """Response of a run, tick by tick.

    Attributes
    ----------
    pressure_kpa, superheat_k : ndarray, shape (ticks,)
        p_e and SH minus the operating point's.
    commands : ndarray, shape (ticks, 2)
        Compressor speed [rad/s] and valve opening [0..1], as the plant got them.
    held : ndarray of bool, shape (ticks,)
        Whether a limit that the controller knows of held its command back.
    """

    pressure_kpa: Vector
    superheat_k: Vector
    commands: Vector
    held: NDArray[np.bool_]


def run(
    point: str,
    steps: Sequence[Step],
    until_s: float,
    *,
    linear: bool = False,
    limits: bool = True,
    anti_windup: bool = True,
    governed: bool = True,
    sample_time_s: float = 0.1,
) -> Response:
    """Simulate K0 alone under steps of its references.

    Parameters
    ----------
    point : str
        "low", "med" or "high".
    steps : sequence of Step
        In the order of their times.
    until_s : float
    linear : bool
        Simulate the linear plant of the operating point instead of the nonlinear one.
    limits : bool
        False: neither controller nor plant knows limits of the commands.
    anti_windup : bool
        False: the controller does not know the limits, which are applied to its commands outside it.
    governed : bool
        False: without the reference governor.
    sample_time_s : float
    """
    rest, design = operating_point(point), design_controller(point, sample_time_s)
    low, high, stride = design.command_min, design.command_max, design.command_rate * sample_time_s
    if not (limits and anti_windup):
        design = replace(design, command_min=-_UNLIMITED, command_max=_UNLIMITED, command_rate=_UNLIMITED)
    if not governed:
        design = replace(design, lead=_UNLIMITED)
    controller, answer = limited_k0(design), _plant(point, linear, sample_time_s)
    start, ticks = np.array(rest.outputs[:2]), round(until_s / sample_time_s)
    wanted, at = np.zeros((ticks, 2)), np.arange(ticks) * sample_time_s
    for from_s, kpa, kelvin in steps:
        wanted[at >= from_s] = kpa * KPA, kelvin
    off, commands, held = np.empty((ticks, 2)), np.empty((ticks, 2)), np.empty(ticks, bool)
    command, outputs = np.array(rest.inputs[:2]), start
    for k in range(ticks):
        off[k] = outputs - start
        asked = controller.step(start + wanted[k], outputs, np.zeros(2))
        if limits and not anti_windup:
            asked = np.clip(np.clip(asked, command - stride, command + stride), low, high)
        command = commands[k] = asked
        held[k] = any(controller.at_limit)
        outputs = answer(command)
    return Response(off[:, 0] / KPA, off[:, 1], commands, held)


def _plant(point: str, linear: bool, sample_time_s: float) -> Callable[[Vector], Vector]:
    """Return a function from the commands of a tick to p_e [Pa] and SH [K] at the next one."""
    rest = operating_point(point)
    if not linear:
        plant, inputs = Plant.at(point), rest.inputs.copy()

        def step(command: Vector) -> Vector:
            inputs[:2] = command
            return plant.step(inputs, sample_time_s)[:2]

        return step
    matrices = linearize(point)
    from_commands = control.ss(matrices.A, matrices.B[:, :2], matrices.C[:2], np.zeros((2, 2)))
    sampled = discretise(from_commands, sample_time_s, "zoh")
    state = np.zeros(len(sampled.A))

    def linear_step(command: Vector) -> Vector:
        state[:] = sampled.A @ state + sampled.B @ (command - rest.inputs[:2])
        return np.asarray(rest.outputs[:2] + sampled.C @ state)

    return linear_step


def overshoot(pressure: Vector, start: float, target: float) -> float:
    """Return how far a step from `start` goes beyond `target`, over the size of the step."""
    return float(((pressure - target) / (target - start)).max())


def there_and_back(
    point: str, step_kpa: float, *, linear: bool = False, limits: bool = True, governed: bool = True
) -> tuple[float, float]:
    """Return the overshoot of a step of p_e's reference [kPa] and of the way back, over its size; see `run`."""
    steps = [(BEGIN_S, step_kpa, 0.0), (BACK_S, 0.0, 0.0)]
    pressure = run(point, steps, END_S, linear=linear, limits=limits, governed=governed).pressure_kpa
    back = round(BACK_S / END_S * len(pressure))
    return overshoot(pressure[:back], 0.0, step_kpa), overshoot(pressure[back:], float(pressure[back - 1]), 0.0)


def main() -> None:
    """Print the overshoot of each step and of the way back in %."""
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
