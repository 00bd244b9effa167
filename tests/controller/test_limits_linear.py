"""Anti-windup on the linear plant with the commands' limits; what is left beyond it is the plant's nonlinearity."""

from dataclasses import replace

import control
import numpy as np
import pytest
from numpy.typing import NDArray

from ac_plant_node import Plant, linearize, operating_point
from bringup.units import KPA
from gimc.sampled import discretise
from gimc_controller_node import Controller, design_controller

SAMPLE_TIME_S = 0.1
UNLIMITED = np.full(2, np.inf)


def run(
    point: str, targets_kpa: list[tuple[float, float]], until_s: float, *, linear: bool, limits: bool = True
) -> tuple[NDArray[np.float64], int]:
    """p_e minus the operating point's [kPa] with K0 alone, and for how many ticks a limit held the command back."""
    rest = operating_point(point)
    design = design_controller(point, SAMPLE_TIME_S)
    if not limits:
        design = replace(design, command_min=-UNLIMITED, command_max=UNLIMITED, command_rate=UNLIMITED)
    controller = Controller(design)
    start, at_rest = np.array(rest.outputs[:2]), np.array(rest.inputs[:2])
    matrices = linearize(point)
    sampled = discretise(
        control.ss(matrices.A, matrices.B[:, :2], matrices.C[:2], np.zeros((2, 2))), SAMPLE_TIME_S, "zoh"
    )
    plant, inputs, state, outputs = Plant.at(point), rest.inputs.copy(), np.zeros(len(sampled.A)), start
    pressure, held = np.empty(round(until_s / SAMPLE_TIME_S)), 0
    for k in range(len(pressure)):
        target = [kpa for start_s, kpa in targets_kpa if start_s <= k * SAMPLE_TIME_S][-1:] or [0.0]
        pressure[k] = (outputs[0] - start[0]) / KPA
        inputs[:2] = controller.step(start + np.array([target[0] * KPA, 0.0]), outputs, np.zeros(2))
        held += any(controller.at_limit)
        if linear:
            state = sampled.A @ state + sampled.B @ (inputs[:2] - at_rest)
            outputs = start + sampled.C @ state
        else:
            outputs = plant.step(inputs, SAMPLE_TIME_S)[:2]
    return pressure, held


def overshoot(pressure: NDArray[np.float64], start: float, target: float) -> float:
    """How far beyond `target` a step from `start` goes, over its size."""
    return float(((pressure - target) / (target - start)).max())


@pytest.mark.parametrize(
    ("point", "step_kpa"),
    [("med", 70.0), ("low", 60.0), ("low", -40.0), ("med", -60.0), ("high", 60.0), ("high", -40.0)],
)
def test_on_the_linear_plant_a_step_into_the_limits_and_back_does_not_overshoot(point: str, step_kpa: float) -> None:
    pressure, held = run(point, [(10.0, step_kpa), (130.0, 0.0)], 250.0, linear=True)
    assert held > 10, "it never met a limit"
    assert overshoot(pressure[:1300], 0.0, step_kpa) < 0.02
    assert overshoot(pressure[1300:], pressure[1299], 0.0) < 0.02


@pytest.mark.parametrize("point", ["low", "med", "high"])
@pytest.mark.parametrize("step_kpa", [-20.0, 20.0])
def test_on_the_nonlinear_plant_a_step_of_20_kpa_and_back_overshoots_by_less_than_a_tenth(
    point: str, step_kpa: float
) -> None:
    pressure, _ = run(point, [(10.0, step_kpa), (130.0, 0.0)], 250.0, linear=False)
    assert overshoot(pressure[:1300], 0.0, step_kpa) < 0.1
    if (point, step_kpa) != ("low", -20.0):  # see below
        assert overshoot(pressure[1300:], pressure[1299], 0.0) < 0.1


def test_back_from_20_kpa_below_the_low_point_overshoots_without_limits_as_well() -> None:
    for limits in (True, False):
        pressure, held = run("low", [(10.0, -20.0), (130.0, 0.0)], 250.0, linear=False, limits=limits)
        assert (held > 0) == limits
        assert 0.1 < overshoot(pressure[1300:], pressure[1299], 0.0) < 0.3
    pressure, _ = run("low", [(10.0, -15.0), (130.0, 0.0)], 250.0, linear=False)
    assert overshoot(pressure[1300:], pressure[1299], 0.0) < 0.1


@pytest.mark.parametrize(("point", "step_kpa"), [("med", 40.0), ("high", 60.0), ("low", -40.0)])
def test_beyond_that_it_overshoots_with_limits_and_without_alike(point: str, step_kpa: float) -> None:
    """So it is not windup: the same controller without limits on the same plant does as much."""
    limited, unlimited = (
        overshoot(run(point, [(10.0, step_kpa)], 130.0, linear=False, limits=limits)[0], 0.0, step_kpa)
        for limits in (True, False)
    )
    assert limited > 0.1
    assert limited == pytest.approx(unlimited, abs=0.02)


@pytest.mark.parametrize(
    ("point", "step_kpa"),
    [("low", 40.0), ("low", 60.0), ("med", 70.0), ("med", -60.0), ("med", -100.0), ("high", 90.0), ("high", -40.0)],
)
def test_limits_cost_no_overshoot_there_and_back(point: str, step_kpa: float) -> None:
    """At most a tenth or what the loop has without limits, and 0.02; each cut by itself, +70 kPa at med was 0.54."""
    steps = [(10.0, step_kpa), (210.0, 0.0)]
    limited, held = run(point, steps, 410.0, linear=False)
    free, _ = run(point, steps, 410.0, linear=False, limits=False)
    assert held > 10
    for part, aim in ((slice(0, 2100), step_kpa), (slice(2100, None), 0.0)):
        reached = [overshoot(p[part], 0.0 if aim else p[2099], aim) for p in (limited, free)]
        assert reached[0] < max(0.1, reached[1]) + 0.02


def test_at_a_limit_the_other_command_does_what_is_missing() -> None:
    """Against all commands of a fine grid within the limits."""
    design = design_controller("med", SAMPLE_TIME_S)
    random = np.random.default_rng(0)
    stride = design.command_rate * SAMPLE_TIME_S
    for _ in range(20):
        controller, outputs = Controller(design), np.array(operating_point("med").outputs[:2])
        wanted = np.array([3.0, 2.0]) * stride * random.uniform(-1.0, 1.0, 2)
        sent = controller.step(outputs, outputs, wanted) - design.command_rest
        grid = [
            np.array([x, y])
            for x in np.linspace(-stride[0], stride[0], 41)
            for y in np.linspace(-stride[1], stride[1], 41)
        ]
        least = min((u - wanted) @ design.priority @ (u - wanted) for u in grid)
        assert (np.abs(sent) <= stride * (1.0 + 1e-12)).all()
        assert (sent - wanted) @ design.priority @ (sent - wanted) <= least * (1.0 + 1e-9)
