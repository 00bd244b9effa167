"""The car as a model: what it does with its inputs, faults and belt, and that its step is that of its parts."""

import numpy as np
import pytest

from ac_plant_node.cabin import CabinState, Surroundings, cabin_energy
from ac_plant_node.car import N_CAR, Car, CarState, cabin_at_start, car_inputs, car_step
from ac_plant_node.dynamics import moist_air
from ac_plant_node.inputs import FAULT, N_FAULTS
from ac_plant_node.plant import Plant

RPM = np.pi / 30.0
WARM = CabinState(35.0, 40.0, 0.012)


def inputs(speed_rpm: float = 1200.0, vehicle_m_s: float = 10.0, belt_rpm: float = 0.0) -> np.ndarray:
    """Valve at 45 %, blower 0.15 kg/s, 36 degC of 40 % outside; two people, half of the air recirculated, sun."""
    air, car = [0.15, 99.0, 9.9, 36.0, 0.4], [vehicle_m_s, 800.0, 2.0, 0.5, belt_rpm * RPM]
    return np.array([speed_rpm * RPM, 0.45, *air, *car])


def test_its_step_is_that_of_plant_cabin_and_front_end() -> None:
    car, plant, state = Car("med", WARM), Plant.at("med"), CarState(WARM)
    around = Surroundings(36.0, 0.4, 800.0, 2.0, 0.5)
    assert len(inputs()) == N_CAR
    for _ in range(50):
        acted = car_inputs(state, inputs()[:2], 0.15, around, 10.0)
        state, out = car_step(plant, state, acted, around, 0.1)
        outputs = car.step(inputs(), 0.1)
        np.testing.assert_array_equal(car.acted, acted)
        assert outputs.tolist() == [
            out.evaporator_pressure_pa, out.superheat_k, out.wall_temperature_c, out.condenser_pressure_pa
        ]  # fmt: skip
    assert car.cabin[:2] == (state.cabin.air_c, state.cabin.interior_c)
    assert car.cabin.condenser_air == acted[4]
    assert car.performance == plant.performance


def test_what_the_evaporator_breathes_is_a_result() -> None:
    car = Car("med", WARM)
    car.step(inputs(), 0.1)
    assert 35.0 < car.acted[3] < 36.0
    assert car.acted[5] == 36.0
    ratio = moist_air.humidity_ratio(car.acted[3], car.acted[6])
    assert ratio == pytest.approx(0.5 * (WARM.humidity_ratio + moist_air.humidity_ratio(36.0, 0.4)), rel=1e-6)


@pytest.mark.parametrize(
    ("outside_c", "recirculation", "cabin_c", "breathed_c"), [(2.0, 0.0, 20.0, 10.0), (45.0, 1.0, 77.0, 65.0)]
)
def test_what_the_evaporator_breathes_is_within_the_plant_s_limits(
    outside_c: float, recirculation: float, cabin_c: float, breathed_c: float
) -> None:
    car, plant = Car("med", CabinState(cabin_c, cabin_c, 0.004)), Plant.at("med")
    given = inputs()
    given[5], given[10] = outside_c, recirculation
    outputs = car.step(given, 0.1)
    assert car.acted[3] == breathed_c
    np.testing.assert_array_equal(plant.step(car.acted, 0.1), outputs)
    # Of a fault its command is told.
    sizes = np.zeros(N_FAULTS)
    sizes[FAULT["valve_stuck"]] = 1.0
    car.hold_faults(sizes.tolist())
    given[1] = 0.6
    car.step(given, 0.1)
    assert car.acted[:2].tolist() == given[:2].tolist()


def test_cabin_and_refrigerant_close_their_balances_together() -> None:
    """What the evaporator takes from recirculated air leaves the cabin: to the first order of the interval."""
    closed = inputs()
    closed[8:11] = [0.0, 0.0, 1.0]  # no sun, nobody, all air recirculated
    closed[5] = 35.0
    car = Car("med", CabinState(35.0, 35.0, 0.0))
    before, moved = cabin_energy(car._state.cabin)[0], 0.0
    for _ in range(600):
        car.step(closed, 0.1)
        moved += 0.1 * car.performance.cooling
        before += 0.1 * 58.0 * (35.0 - car.cabin.cabin_air)
    assert cabin_energy(car._state.cabin)[0] - before == pytest.approx(-moved, rel=0.02)


def test_a_dead_fan_leaves_the_ram_air() -> None:
    flows = []
    for vehicle in (0.0, 20.0):
        for lost in (0.0, 1.0):
            car, sizes = Car("med", WARM), np.zeros(N_FAULTS)
            sizes[FAULT["condenser_fan"]] = lost
            car.hold_faults(sizes.tolist())
            car.step(inputs(vehicle_m_s=vehicle), 0.1)
            flows.append(car.cabin.condenser_air)
    healthy, dead, moving, moving_dead = flows
    ram = 1.16 * 0.24 * 0.2 * 20.0
    assert (healthy, dead) == (pytest.approx(0.35), 0.1)
    assert moving == pytest.approx(np.hypot(ram, 0.35))
    assert moving_dead == pytest.approx(ram)


def test_on_the_belt_the_command_of_the_speed_says_nothing() -> None:
    runs = []
    for commanded in (0.0, 1200.0, 5000.0):
        car = Car("med", WARM)
        runs.append([car.step(inputs(commanded, belt_rpm=1500.0), 0.1).tolist() for _ in range(20)])
        assert car.acted[0] == 1500.0 * RPM
    assert runs[0] == runs[1] == runs[2]


def test_the_cabin_starts_with_the_outside_air_s_water() -> None:
    around = Surroundings(30.0, 0.5, 1000.0)
    ratio = moist_air.humidity_ratio(30.0, 0.5)
    assert cabin_at_start(around, 40.0) == CabinState(40.0, 40.0, ratio)
    assert cabin_at_start(around, None).humidity_ratio == ratio
    assert cabin_at_start(around, None).air_c > 45.0
