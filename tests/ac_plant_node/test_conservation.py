"""Mass and energy are kept, the rest state rests, and a duration may be cut anywhere."""

import numpy as np
import pytest

from ac_plant_node import POINTS, Plant, operating_point


@pytest.mark.parametrize("point", POINTS)
def test_rests_at_an_operating_point(point):
    plant = Plant.at(point)
    plant.advance(100.0)
    np.testing.assert_allclose(plant.step(plant.inputs, 0.0), operating_point(point).outputs, rtol=1e-9)


def test_mass_and_energy_over_600_s_with_steps_in_every_input():
    plant = Plant.at("med")
    mass, energy = plant.refrigerant_mass_kg, plant.stored_energy_j
    for speed, valve, air, temperature in (
        (1060, 40, 0.13, 30), (1060, 43, 0.13, 30), (1060, 43, 0.145, 30), (950, 40, 0.145, 33), (1000, 38, 0.12, 28),
        (1000, 40, 0.13, 30),
    ):  # fmt: skip
        plant.advance(100.0, speed, valve, air, temperature)
    assert abs(plant.refrigerant_mass_kg / mass - 1.0) < 1e-8
    assert abs(plant.stored_energy_j - energy - plant.heat_in_j) < 1e-6 * plant.heat_moved_j


def test_energy_balance_by_an_outside_quadrature():
    """The heat summed from the public property alone, by Simpson's rule between input steps."""
    plant = Plant.at("med")
    energy = plant.stored_energy_j
    heat = moved = 0.0
    for speed in (1040, 970):
        plant.advance(0.0, compressor_speed_rpm=speed)
        for _ in range(1500):
            first = plant.heat_in_w
            plant.advance(0.02)
            middle = plant.heat_in_w
            plant.advance(0.02)
            heat += 0.04 / 6.0 * (first + 4.0 * middle + plant.heat_in_w)
            moved += 0.04 * plant.outputs.cooling_power_w
    assert abs(plant.stored_energy_j - energy - heat) < 1e-6 * moved


def test_cutting_a_duration_changes_no_bit():
    whole, cut = Plant.at("med"), Plant.at("med")
    w = whole.inputs
    w[0] *= 1.05
    a = whole.step(w, 20.0)
    for _ in range(200):
        b = cut.step(w, 0.1)
    assert (a == b).all()
    assert (whole.state == cut.state).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("which", range(4))
def test_inputs_that_are_not_finite_are_refused_with_one_line_and_leave_the_plant_as_it_is(which, bad):
    plant, other = Plant.at("med"), Plant.at("med")
    w = plant.inputs
    w[which] = bad
    with pytest.raises(ValueError, match="4 to 7 finite numbers") as refused:
        plant.step(w, 0.1)
    assert "\n" not in str(refused.value)
    w = other.inputs * 1.01
    assert (plant.step(w, 0.1) == other.step(w, 0.1)).all()


@pytest.mark.parametrize("shape", [(3,), (8,), (1, 4), (4, 4)])
def test_other_than_four_to_seven_inputs_are_refused(shape):
    with pytest.raises(ValueError, match="4 to 7 finite numbers"):
        Plant.at("med").step(np.ones(shape), 0.1)


def test_a_state_is_the_same_read_on_the_way_or_at_the_end_of_a_step():
    """Commands that jump every tick: reading in between changes no bit of what comes after, and reads the truth."""
    rng = np.random.default_rng(1)
    whole, cut, exact = Plant.at("med"), Plant.at("med"), Plant.at("med", tolerance=1e-9)
    rest = whole.inputs[:4]
    between = []
    for _ in range(200):
        w = rest * (1.0 + 0.01 * rng.standard_normal(4))
        a = whole.step(w, 0.1)
        between.append(cut.step(w, 0.023) - exact.step(w, 0.023))
        b = cut.step(w, 0.077)
        assert (a == b).all()
        exact.step(w, 0.077)
    assert (np.abs(between).max(axis=0) < [20.0, 0.02, 0.02, 40.0]).all()


def test_a_small_jump_is_one_exponential_step_and_as_good_as_many_small_ones():
    """Both kinds of step solve the same equations: they agree to a thousandth of the sensors' noise."""
    one, many = Plant.at("med"), Plant.at("med", tolerance=1e-9)
    w = one.inputs[:4] * np.array([1.005, 1.002, 1.0, 1.0])
    tried = one.steps_tried
    a, b = one.step(w, 0.1), many.step(w, 0.1)
    assert one.steps_tried == tried + 1
    assert many.steps_tried > 10
    assert (np.abs(a - b) < [0.2, 1e-4, 5e-5, 0.2]).all()
