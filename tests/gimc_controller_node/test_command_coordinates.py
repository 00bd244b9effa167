"""K0 for the whole envelope: linear in coordinates of the commands that are nearly their logarithms."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ac_common.units import RPM
from ac_design import ENVELOPE_CONTROLLER, design_controller
from gimc_controller_node import ControllerDesign, GimcController, limited_k0

T = 0.1
MEASURED = np.array([2.5e5, 20.0])
speeds_rpm, openings = st.floats(0.0, 6000.0), st.floats(0.0, 1.0)
shares = st.one_of(st.just(0.0), st.floats(1e-4, 0.99))


@pytest.fixture(scope="module")
def k0() -> ControllerDesign:
    return design_controller("med", T, ENVELOPE_CONTROLLER)


@given(speeds_rpm, openings, shares, shares)
def test_commands_and_coordinates_are_each_others_inverse(k0, rpm, opening, of_speed, of_opening):
    design = replace(k0, curvature=np.array([of_speed, of_opening]) / k0.command_rest)
    command = np.array([rpm * RPM, opening])
    assert design.command_at(design.coordinates(command)) == pytest.approx(command, rel=1e-9, abs=1e-9)


@given(speeds_rpm, openings)
def test_slope_is_one_at_rest_and_falls_as_the_command_grows(k0, rpm, opening):
    command, step, rest = np.array([rpm * RPM, opening]), np.array([1e-3, 1e-6]), k0.command_rest
    slope = (k0.coordinates(command + step) - k0.coordinates(command)) / step
    offset = 1.0 / k0.curvature - rest
    assert np.array([300.0 * RPM, 0.02]) == pytest.approx(offset)
    assert slope == pytest.approx((rest + offset) / (command + offset), rel=1e-3)


def test_any_coordinates_have_a_finite_command(k0):
    assert all(np.isfinite(k0.command_at(np.full(2, value))).all() for value in (-1e9, -1e3, 0.0, 1e3, 1e9))


def test_any_command_that_a_controller_may_want_has_coordinates(k0):
    for wanted in ([-1e9, -1e9], [1e9, 1e9], [0.0, -5.0]):
        assert np.isfinite(k0.coordinates(np.array(wanted))).all()


def test_a_design_of_one_point_has_no_curvature():
    assert not design_controller("med", T).curvature.any()


@given(speeds_rpm, st.floats(0.05, 0.9), st.floats(-2e4, 2e4), st.floats(-10.0, 10.0))
def test_it_takes_over_from_any_command(k0, rpm, opening, pascal, kelvin):
    command, reference = np.array([rpm * RPM, opening]), MEASURED + np.array([pascal, kelvin])
    controller = GimcController(k0)
    controller.warm_restart(command, MEASURED, reference)
    assert controller.step(reference, MEASURED, np.zeros(2)) == pytest.approx(command, rel=1e-6, abs=1e-6)


@given(st.lists(st.tuples(st.floats(-1e5, 1e5), st.floats(-40.0, 40.0)), min_size=1, max_size=30))
def test_commands_stay_within_limits_in_size_and_rate(k0, errors):
    controller, last = limited_k0(k0), k0.command_rest
    for error in errors:
        command = controller.step(MEASURED + np.array(error), MEASURED, np.zeros(2))
        assert np.all((command >= k0.command_min - 1e-9) & (command <= k0.command_max + 1e-9))
        assert np.all(np.abs(command - last) <= k0.command_rate * T + 1e-9)
        last = command


@pytest.mark.parametrize("point", ["low", "high"])
def test_it_is_one_controller_whatever_the_origin_of_its_coordinates(k0, point):
    other = design_controller(point, T, ENVELOPE_CONTROLLER)
    command, both = np.array([900.0 * RPM, 0.3]), [GimcController(k0), GimcController(other)]
    for controller in both:
        controller.warm_restart(command, MEASURED, MEASURED)
    for tick in range(200):
        error = np.array([3e3 * np.sin(0.1 * tick), 2.0 * np.cos(0.07 * tick)])
        one, same = (controller.step(MEASURED + error, MEASURED, np.zeros(2)) for controller in both)
        assert same == pytest.approx(one, rel=2e-3)
        for controller in both:
            controller.sent(one)
