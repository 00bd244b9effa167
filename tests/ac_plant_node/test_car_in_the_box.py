"""A car over the whole ranges of its surroundings, commands and faults: within the domain, and its balances close."""

import numpy as np
import pytest

from ac_common.signals import AirSide, CarSide
from ac_common.units import RPM
from ac_plant_node import POINTS
from ac_plant_node.cabin import CabinParameters, CabinState, Surroundings, cabin_energy, cabin_step
from ac_plant_node.car import Car, cabin_at_start
from ac_plant_node.dynamics.integrator import LEAST_PRESSURE_PA
from ac_plant_node.inputs import FAULT_HIGH, FAULT_LOW, INPUT_HIGH, INPUT_LOW, N_FAULTS
from ac_plant_node.properties.tables import load_tables

#: Of the fields of `AirSide` and `CarSide`; a car has no use for those of `AirSide` that are results.
AIR_LOW, AIR_HIGH = AirSide(0.02, 0.0, 0.0, 0.0, 0.0), AirSide(0.3, 0.0, 0.0, 50.0, 1.0)
CAR_LOW, CAR_HIGH = CarSide(0.0, 0.0, 0.0, 0.0, 0.0), CarSide(70.0, 1400.0, 9.0, 1.0, 6000.0 * RPM)


def random_inputs(rng: np.random.Generator) -> np.ndarray:
    """Return inputs of a car; the compressor stands now and then, and so does the car; every other one has a belt."""
    command, air = rng.uniform(INPUT_LOW[:2], INPUT_HIGH[:2]), rng.uniform(AIR_LOW, AIR_HIGH)
    command *= rng.random(2) > 0.1
    side = CarSide(*rng.uniform(CAR_LOW, CAR_HIGH))
    side = side._replace(belt_speed=side.belt_speed * (rng.random() > 0.5))
    return np.array([*command, *air, *side._replace(vehicle_speed=side.vehicle_speed * (rng.random() > 0.2))])


def random_faults(rng: np.random.Generator) -> list[float]:
    """Return any number of faults of any size, the others zero."""
    there = rng.permutation(N_FAULTS) < rng.integers(0, N_FAULTS + 1)
    return (there * rng.uniform(FAULT_LOW, FAULT_HIGH)).tolist()


def random_start(rng: np.random.Generator) -> CabinState:
    """Return the cabin of a car that has stood somewhere, in the sun or not."""
    around = Surroundings(rng.uniform(0.0, 50.0), rng.random(), rng.uniform(0.0, 1400.0))
    return cabin_at_start(around, rng.choice([None, rng.uniform(0.0, 70.0)]))


def drive(seed: int, seconds: float = 1800.0) -> tuple[np.ndarray, np.ndarray]:
    """Return least and largest values over a drive: outputs, acted inputs, cabin (two temperatures, humidity ratio)."""
    rng = np.random.default_rng(seed)
    car = Car(POINTS[seed % 3], random_start(rng))
    plant, cabin, elapsed, rows = car.plant, CabinParameters(), 0.0, []
    mass, energy = plant.refrigerant_mass_kg, plant.stored_energy_j
    while elapsed < seconds:
        given, duration_s = random_inputs(rng), float(rng.choice([0.1, 1.0, 5.0]))
        around = Surroundings(given[5], given[6], *given[8:11])
        car.hold_faults(random_faults(rng))
        for _ in range(int(rng.uniform(5.0, 60.0) / duration_s)):
            before = car._state.cabin
            outputs = car.step(given, duration_s)
            elapsed += duration_s
            after = cabin_step(before, *plant.vent_air, car.acted[2], around, duration_s, cabin)
            assert car._state.cabin == after.state
            (energy_j, water_kg), (energy_after_j, water_after_kg) = (
                cabin_energy(before, cabin),
                cabin_energy(after.state, cabin),
            )
            assert abs(energy_after_j - energy_j - after.energy_in_j) <= 1e-12 * 1e7
            assert abs(water_after_kg - water_kg - after.water_in_kg) <= 1e-14
            rows.append([*outputs, *car.acted, after.state.air_c, after.state.interior_c, after.state.humidity_ratio])
        assert car.acted[0] == min(given[11] if given[11] > 0.0 else given[0], INPUT_HIGH[0])
    assert (plant.refrigerant_mass_kg + plant.leaked_mass_kg) / mass == pytest.approx(1.0, abs=1e-6)
    gained_j = plant.heat_in_j - plant.leaked_energy_j
    assert abs(plant.stored_energy_j - energy - gained_j) < 1e-4 * plant.heat_moved_j
    table = np.array(rows)
    return table.min(axis=0), table.max(axis=0)


@pytest.mark.parametrize("seed", range(6))
def test_random_drives_stay_within_the_domain(seed: int) -> None:
    low, high = drive(seed)
    assert np.isfinite(low).all()
    assert np.isfinite(high).all()
    assert 15e3 < low[0] < high[0] < 2.0e6
    assert 0.0 <= low[1] < high[1] < 150.0
    assert 0.28e6 < low[3] < high[3] < 3.45e6
    assert (low[4:11] >= INPUT_LOW).all()
    assert (high[4:11] <= INPUT_HIGH).all()
    # Sun through the aperture onto a closed cabin in the heat: 28 K over the outside air, the interior 7 K hotter.
    assert low[11:13].min() > -30.0
    assert high[11:13].max() < 90.0
    assert low[13] >= 0.0


@pytest.mark.slow
def test_random_drives_for_a_day() -> None:
    highest = float(load_tables("R134a").grid[8])  # where the limiter has long ended the compressor's flow
    for seed in range(6, 54):
        low, high = drive(seed)
        assert 0.9 * LEAST_PRESSURE_PA < low[3] < high[3] < highest  # a leak may empty a condenser that nothing feeds
