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


def test_nan_is_refused_with_one_line():
    with pytest.raises(ValueError, match="finite"):
        Plant.at("med").advance(0.1, compressor_speed_rpm=float("nan"))
