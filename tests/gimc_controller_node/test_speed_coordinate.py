"""K0 for the whole envelope: linear in a coordinate of the speed that is nearly its logarithm."""

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
speeds_rpm = st.floats(0.0, 6000.0)


@pytest.fixture(scope="module")
def k0() -> ControllerDesign:
    return design_controller("med", T, ENVELOPE_CONTROLLER)


@given(speeds_rpm, st.one_of(st.just(0.0), st.floats(1e-6, 0.0095)))
def test_speed_and_coordinate_are_each_others_inverse(k0, rpm, curvature):
    design = replace(k0, speed_curvature=curvature)
    speed = rpm * RPM
    assert design.speed_at(design.speed_coordinate(speed)) == pytest.approx(speed, rel=1e-9, abs=1e-9)


@given(speeds_rpm)
def test_slope_is_one_at_the_point_of_the_design_and_falls_with_the_speed(k0, rpm):
    def slope(speed):
        return (k0.speed_coordinate(speed + 1e-3) - k0.speed_coordinate(speed)) / 1e-3

    rest = float(k0.command_rest[0])
    offset = 1.0 / k0.speed_curvature - rest
    assert slope(rest) == pytest.approx(1.0, rel=1e-4)
    assert slope(rpm * RPM) == pytest.approx((rest + offset) / (rpm * RPM + offset), rel=1e-3)


def test_any_coordinate_has_a_finite_speed(k0):
    assert np.isfinite([k0.speed_at(value) for value in (-1e9, -1e3, 0.0, 1e3, 1e9)]).all()


def test_a_design_of_one_point_has_no_curvature():
    assert design_controller("med", T).speed_curvature == 0.0


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
