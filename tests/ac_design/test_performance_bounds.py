"""Limits in size and rate, anti-windup, and taking over, on the nonlinear plant with K0 alone."""

import numpy as np
import pytest

from ac_common.units import KPA, RPM
from ac_design import design_controller
from ac_design.analysis.step_response import overshoot, run
from ac_plant_node import Plant, operating_point
from gimc_controller_node import limited_k0

SAMPLE_TIME_S = 0.1


@pytest.mark.parametrize("governed", [True, False])
@pytest.mark.parametrize(("point", "asked_kpa"), [("high", -70.0), ("med", -120.0)])
def test_it_comes_back_from_a_reference_out_of_reach_without_overshoot(
    point: str, asked_kpa: float, governed: bool
) -> None:
    asked, back = [(10.0, asked_kpa, 0.0), (210.0, 0.0, 0.0)], 2100
    seen = run(point, asked, 400.0, governed=governed)
    subject, speed = seen.pressure_kpa, seen.commands[:, 0] / RPM
    without = run(point, asked, 400.0, governed=False, anti_windup=False).pressure_kpa
    at_limits = (speed >= 6000.0 - 1e-9) | (seen.commands[:, 1] <= 1e-11) | (speed <= 1e-9)
    assert at_limits.any() or np.abs(np.diff(speed)).max() > 99.9  # it did saturate
    held = float(subject[back - 1])
    assert overshoot(subject[back:], held, 0.0) < 0.1
    assert np.abs(subject[-100:]).max() < 0.1
    worst = max(overshoot(without[back:], held, 0.0), abs(float(without[-1]) / held))
    assert worst > 0.5, "the windup that this guards against is not there"


@pytest.mark.parametrize(("point", "step_kpa"), [("med", 20.0), ("med", -20.0), ("high", 20.0), ("high", -20.0)])
def test_a_step_that_meets_the_rate_limits_does_not_overshoot(point: str, step_kpa: float) -> None:
    seen = run(point, [(10.0, step_kpa, 0.0)], 150.0, governed=False)
    speed, opening = (np.abs(np.diff(seen.commands, axis=0)) / SAMPLE_TIME_S).max(axis=0)
    assert 0.2499 < opening < 0.2501
    assert speed / RPM < 1000.01
    assert overshoot(seen.pressure_kpa, 0.0, step_kpa) < 0.1
    assert np.abs(seen.pressure_kpa[-100:] - step_kpa).max() < 0.05


@pytest.mark.parametrize("point", ["low", "med", "high"])
def test_a_new_controller_takes_over_from_what_the_actuators_do(point: str) -> None:
    """The first command is the actuators' own, and p_e goes to its reference without first running away."""
    rest, plant = operating_point(point), Plant.at(point)
    inputs = rest.inputs.copy()
    inputs[:2] += [0.05 * rest.inputs[0], 0.01]  # some safe command that is not the operating point's
    for _ in range(300):
        outputs = plant.step(inputs, SAMPLE_TIME_S)
    controller = limited_k0(design_controller(point, SAMPLE_TIME_S))
    controller.warm_restart(inputs[:2], outputs[:2], rest.outputs[:2])
    off = abs(outputs[0] - rest.outputs[0])
    commands, errors = [inputs[:2].copy()], []
    for _ in range(1200):
        inputs[:2] = controller.step(rest.outputs[:2], outputs, None)
        commands.append(inputs[:2].copy())
        outputs = plant.step(inputs, SAMPLE_TIME_S)
        errors.append(abs(outputs[0] - rest.outputs[0]))
    assert commands[1] == pytest.approx(commands[0], rel=1e-9)
    assert max(errors) < 1.2 * off
    assert errors[-1] < 0.02 * KPA
    jumps = np.abs(np.diff(np.array(commands), axis=0)).max(axis=0)
    assert jumps[0] < 20.0 * RPM
    assert jumps[1] < 0.01
