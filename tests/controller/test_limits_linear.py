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
