"""Limits in size and rate, anti-windup, and taking over, on the nonlinear plant with K0 alone."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from ac_plant_node import Plant, operating_point
from bringup.units import KPA, RPM
from gimc_controller_node import Controller, design_controller

SAMPLE_TIME_S = 0.1


def run(
    point: str,
    targets_kpa: list[tuple[float, float]],
    until_s: float,
    *,
    anti_windup: bool = True,
    governed: bool = False,
) -> dict[str, NDArray[np.float64]]:
    """p_e minus the operating point's [kPa] and the commands, under steps of its reference.

    Without anti-windup the controller knows of no limits; its command is cut off behind its back. The governor, which
    keeps steps from meeting limits, is left out where it is not asked for.
    """
    rest, plant = operating_point(point), Plant.at(point)
    design = design_controller(point, SAMPLE_TIME_S)
    wide = np.full(2, np.inf)
    if not governed:
        design = replace(design, lead=wide)
    used = design if anti_windup else replace(design, command_min=-wide, command_max=wide, command_rate=wide)
    controller = Controller(used)
    outputs, inputs = rest.outputs, rest.inputs.copy()
    ticks = round(until_s / SAMPLE_TIME_S)
    pressure, commands = np.empty(ticks), np.empty((ticks, 2))
    for k in range(ticks):
        target = [kpa for start_s, kpa in targets_kpa if start_s <= k * SAMPLE_TIME_S][-1:] or [0.0]
        reference = rest.outputs[:2] + np.array([target[0] * KPA, 0.0])
        pressure[k] = (outputs[0] - rest.outputs[0]) / KPA
        command = controller.step(reference, outputs, np.zeros(2))
        if not anti_windup:
            stride = design.command_rate * SAMPLE_TIME_S
            command = np.clip(np.clip(command, inputs[:2] - stride, inputs[:2] + stride), 0.0, design.command_max)
        inputs[:2] = commands[k] = command
        outputs = plant.step(inputs, SAMPLE_TIME_S)
    return {"p_e": pressure, "N": commands[:, 0] / RPM, "alpha": 100.0 * commands[:, 1]}


def overshoot(pressure: NDArray[np.float64], start: float, target: float) -> float:
    """How far beyond `target` a step from `start` goes, over its size."""
    return float(((pressure - target) / (target - start)).max())


@pytest.mark.parametrize("governed", [True, False])
@pytest.mark.parametrize(("point", "asked_kpa"), [("high", -70.0), ("low", -80.0)])
def test_it_comes_back_from_a_reference_out_of_reach_without_overshoot(
    point: str, asked_kpa: float, governed: bool
) -> None:
    asked, back_s = [(10.0, asked_kpa), (210.0, 0.0)], 210.0
    subject = run(point, asked, 400.0, governed=governed)
    without = run(point, asked, 400.0, anti_windup=False)
    at_limits = (subject["N"] >= 6000.0 - 1e-9) | (subject["alpha"] <= 1e-9) | (subject["N"] <= 1e-9)
    assert at_limits.any() or np.abs(np.diff(subject["N"])).max() > 99.9  # it did saturate
    back = round(back_s / SAMPLE_TIME_S)
    held = subject["p_e"][back - 1]
    assert overshoot(subject["p_e"][back:], held, 0.0) < 0.1
    assert np.abs(subject["p_e"][-100:]).max() < 0.1
    worst = max(overshoot(without["p_e"][back:], held, 0.0), float(np.abs(without["p_e"][-1] / held)))
    assert worst > 0.5, "the windup that this guards against is not there"


@pytest.mark.parametrize(("point", "step_kpa"), [("med", 20.0), ("med", -20.0), ("high", 20.0), ("high", -20.0)])
def test_a_step_that_meets_the_rate_limits_does_not_overshoot(point: str, step_kpa: float) -> None:
    seen = run(point, [(10.0, step_kpa)], 150.0)
    moved = np.abs(np.diff(seen["alpha"])) / SAMPLE_TIME_S
    assert 24.99 < moved.max() < 25.01
    assert np.abs(np.diff(seen["N"])).max() / SAMPLE_TIME_S < 1000.01
    assert overshoot(seen["p_e"], 0.0, step_kpa) < 0.1
    assert np.abs(seen["p_e"][-100:] - step_kpa).max() < 0.05


@pytest.mark.parametrize("point", ["low", "med", "high"])
def test_a_new_controller_takes_over_from_what_the_actuators_do(point: str) -> None:
    """The first command is the actuators' own, and p_e goes to its reference without first running away."""
    rest, plant = operating_point(point), Plant.at(point)
    inputs = rest.inputs.copy()
    inputs[:2] += [0.05 * rest.inputs[0], 0.01]  # some safe command that is not the operating point's
    for _ in range(300):
        outputs = plant.step(inputs, SAMPLE_TIME_S)
    controller = Controller(design_controller(point, SAMPLE_TIME_S))
    controller.resume(inputs[:2], outputs[:2], rest.outputs[:2])
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
