"""Zones come and go: starts, stops, shut and open valves, large steps, and an hour of random inputs."""

import numpy as np
import pytest

from ac_common.units import RPM
from ac_plant_node import POINTS, Plant, operating_point
from ac_plant_node.dynamics.balances import H_DISCHARGE, REGIME_C, REGIME_E
from ac_plant_node.inputs import FAULTS, INPUT_HIGH, INPUT_LOW, TO_SI
from ac_plant_node.properties.lookup import saturation, vapour
from ac_plant_node.properties.tables import load_tables
from bringup.benchmarks.plant_speed import random_holds


class Ledger:
    """Mass and energy of a plant against what they were, and what has leaked since."""

    def __init__(self, plant):
        self.plant, self.mass, self.energy = plant, plant.refrigerant_mass_kg, plant.stored_energy_j

    def check(self, mass=1e-6, energy=1e-4):
        plant = self.plant
        assert abs((plant.refrigerant_mass_kg + plant.leaked_mass_kg) / self.mass - 1.0) < mass
        gained_j = plant.heat_in_j - plant.leaked_energy_j
        assert abs(plant.stored_energy_j - self.energy - gained_j) < energy * plant.heat_moved_j


def regimes(plant):
    return int(plant._aux[REGIME_E]), int(plant._aux[REGIME_C])


@pytest.mark.parametrize("goal", POINTS)
@pytest.mark.parametrize("start", POINTS)
def test_step_between_operating_points_settles_on_the_equilibrium(start, goal):
    """From high to low the superheated zone empties on the way; there is one place to settle all the same."""
    plant = Plant.at(start)
    ledger = Ledger(plant)
    at = operating_point(goal)
    plant.step(at.inputs, 600.0)
    y = plant.step(at.inputs, 600.0)
    assert abs(y[0] - at.outputs[0]) < 50.0
    assert abs(y[1] - at.outputs[1]) < 0.02
    np.testing.assert_allclose(plant.state[:9], at.state[:9], rtol=1e-6)
    ledger.check()


def test_high_to_low_passes_through_an_evaporator_without_superheat():
    plant, w = Plant.at("high"), operating_point("low").inputs
    seen = set()
    for _ in range(300):
        plant.step(w, 0.1)
        seen.add(regimes(plant)[0])
    assert seen == {0, 1}


@pytest.mark.parametrize("point", POINTS)
def test_reaches_table_one_from_five_per_cent_off(point):
    """Every component of the state 5 % of its size off, charge as it was."""
    at = operating_point(point)
    s = at.conserved.copy()
    s[:] *= np.array([1.05, 1.05, 1.0, 1.0, 1.05, 1.0, 1.0, 0.95, 1.0, 1.0, 0.95, 1.05])
    s[5] -= s[0] - at.conserved[0]
    s[2] += 1500.0
    s[8] -= 1500.0
    s[[3, 9]] += 1.0
    plant = Plant(s, at.inputs)
    first = plant.step(at.inputs, 0.0)
    assert abs(first[0] / at.outputs[0] - 1.0) > 0.02
    y = plant.step(at.inputs, 900.0)
    assert abs(y[0] - at.outputs[0]) < 50.0
    assert abs(y[1] - at.outputs[1]) < 0.02


def test_shut_down_rests_at_equalised_pressure_and_starts_up_again():
    plant = Plant.at("med")
    ledger = Ledger(plant)
    plant.advance(3600.0, compressor_speed_rpm=0.0)
    y = plant.outputs
    # 30 degC on both sides: everything settles at that saturation pressure.
    tab = load_tables()
    assert y.evaporator_pressure_pa == pytest.approx(y.condenser_pressure_pa, rel=1e-4)
    assert saturation(tab, y.evaporator_pressure_pa)[0] - 273.15 == pytest.approx(30.0, abs=0.01)
    assert y.wall_temperature_c == pytest.approx(30.0, abs=0.01)
    assert abs(plant.heat_in_w) < 0.5
    plant.advance(1500.0, compressor_speed_rpm=1000.0)
    at = operating_point("med").outputs
    assert abs(plant.outputs.evaporator_pressure_pa - at[0]) < 50.0
    assert abs(plant.outputs.superheat_k - at[1]) < 0.02
    ledger.check()


def test_valve_shut_pumps_down_and_wide_open_floods():
    plant = Plant.at("med")
    ledger = Ledger(plant)
    plant.advance(120.0, valve_opening_percent=0.0)
    assert regimes(plant)[0] == 2
    assert 15e3 < plant.outputs.evaporator_pressure_pa < 60e3
    plant.advance(600.0, valve_opening_percent=100.0)
    assert regimes(plant) == (1, 1)
    assert plant.outputs.superheat_k == 0.0
    plant.advance(1200.0, valve_opening_percent=40.0)
    assert abs(plant.outputs.evaporator_pressure_pa - operating_point("med").outputs[0]) < 50.0
    ledger.check()


def test_compressor_off_the_charge_goes_where_it_is_cold():
    plant = Plant.at("med")
    ledger = Ledger(plant)
    plant.advance(5000.0, compressor_speed_rpm=0.0, air_inlet_temperature_c=10.0)
    assert regimes(plant) == (1, 2)
    temperature = saturation(load_tables(), plant.outputs.evaporator_pressure_pa)[0] - 273.15
    assert temperature == pytest.approx(10.0, abs=0.02)
    ledger.check()


def random_faults(rng):
    """Any number of faults at once, of any size; a leak of 5 kg/h leaves a fifth of the charge in six minutes."""
    drawn = (FAULTS[k] for k in rng.choice(len(FAULTS), size=rng.integers(0, len(FAULTS) + 1), replace=False))
    return {row.kind: rng.uniform(row.low, row.high) / TO_SI[row.unit](1.0) for row in drawn}


def discharge_k(plant):
    """Return the temperature of the gas that the compressor would deliver now."""
    tab, p, h = plant._tab, plant.outputs.condenser_pressure_pa, plant._aux[H_DISCHARGE]
    sat = saturation(tab, p)
    return vapour(tab, p, sat.ln_p, h, sat.h_g, sat.h_g_p)[3] if h > sat.h_g else sat.t


def random_hour(seed, seconds=3600.0, faulty=False):
    """One run of random inputs; returns extremes of the outputs, and what the balances say."""
    rng = np.random.default_rng(seed)
    plant = Plant.at(POINTS[seed % 3])
    ledger = Ledger(plant)
    elapsed, rows = 0.0, []
    while elapsed < seconds:
        w = rng.uniform(INPUT_LOW, INPUT_HIGH)
        w[0] *= rng.random() > 0.1  # the compressor's clutch open, the valve shut: now and then exactly
        w[1] *= rng.random() > 0.1
        if faulty:
            plant.set_faults(random_faults(rng))
        hold = rng.uniform(5.0, 60.0)
        for _ in range(int(hold)):
            y = plant.step(w, 1.0)
            o = plant.outputs
            told = (
                o.air_outlet_temperature_c,
                o.cooling_power_w,
                o.condensed_water_kg_s,
                discharge_k(plant) if faulty else 0.0,
            )
            rows.append((*y, *plant.state, *told))
        elapsed += hold
    table = np.array(rows)
    ledger.check()
    return table.min(axis=0), table.max(axis=0)


def check_bounds(low, high, faulty=False):
    """Physical bounds: p, SH, T_w, p_c, the state x, the air behind the evaporator, its heat and water, hot gas."""
    assert np.isfinite(low).all()
    assert np.isfinite(high).all()
    assert low[0] > 15e3
    assert high[0] < 2.0e6
    assert low[1] >= 0.0
    assert high[1] < 150.0
    assert low[2] > -60.0
    # Air of 65 degC, and hot gas that a condenser without liquid passes on; the hotter the less its air takes away.
    assert high[2] < (100.0 if faulty else 75.0)
    assert low[3] > 0.28e6  # 293 kPa: saturation at 0 degC, the coldest condenser air
    assert high[3] < 3.45e6
    lengths = [4, 9, 10]
    assert low[lengths].min() >= 0.0
    assert high[lengths].max() <= 1.0
    assert low[[7, 8, 13, 14, 15]].min() > 210.0
    # With half the isentropic efficiency and next to no air the gas, and the wall that it heats, may be very hot.
    assert high[[7, 8, 13, 14, 15]].max() < (high[19] + 1.0 if faulty else 400.0)
    assert low[16] > -50.0
    assert high[16] < 75.0
    assert low[18] >= 0.0


@pytest.mark.parametrize("seed", range(6))
def test_random_inputs_over_the_whole_box(seed):
    check_bounds(*random_hour(seed))


@pytest.mark.parametrize("seed", range(6))
def test_random_inputs_and_faults_over_the_whole_box(seed):
    check_bounds(*random_hour(seed, faulty=True), faulty=True)


@pytest.mark.slow
def test_random_inputs_for_a_day():
    for seed in range(6, 24):
        faulty = seed % 2 == 0
        check_bounds(*random_hour(seed, faulty=faulty), faulty=faulty)


def test_inputs_beyond_the_box_saturate():
    plant, other = Plant.at("med"), Plant.at("med")
    a = plant.step(np.array([9e3, 1.7, 2.0, 80.0]), 30.0)
    b = other.step(INPUT_HIGH[:4], 30.0)
    assert (a == b).all()
    assert (plant.inputs[:4] == INPUT_HIGH[:4]).all()
    a = plant.step(np.array([-50.0 * RPM, -0.1, 0.0, -40.0]), 30.0)
    assert (plant.inputs[:4] == INPUT_LOW[:4]).all()
    assert np.isfinite(a).all()


def test_regimes_meet_without_a_jump():
    """Pressure as a function of mass and energy is continuous where the superheated zone vanishes and comes back."""
    plant, w = Plant.at("high"), operating_point("low").inputs
    before = plant.step(w, 0.01)
    regime, jumps = regimes(plant)[0], 0
    for _ in range(3000):
        after = plant.step(w, 0.005)
        if regimes(plant)[0] != regime:
            regime, jumps = regimes(plant)[0], jumps + 1
            assert abs(after[0] - before[0]) < 500.0
        before = after
    assert jumps >= 2


def dried_out(speed_rpm, air_c, air_kg_s):
    """Return a plant whose valve was shut until its evaporator held vapour only, and its balances since before that."""
    plant = Plant.at("med")
    ledger = Ledger(plant)
    plant.advance(
        60.0, compressor_speed_rpm=speed_rpm, valve_opening_percent=0.0, air_inlet_temperature_c=air_c,
        air_mass_flow_kg_s=air_kg_s, condenser_air_inlet_temperature_c=40.0,
    )  # fmt: skip
    assert regimes(plant)[0] == 2
    return plant, ledger


def stood_still(_, air_c, air_kg_s):
    """Return a plant that has stood still in the heat, and its balances since before that."""
    plant = Plant.at("med")
    ledger = Ledger(plant)
    plant.advance(
        900.0, compressor_speed_rpm=0.0, air_inlet_temperature_c=air_c, air_mass_flow_kg_s=air_kg_s,
        condenser_air_inlet_temperature_c=40.0,
    )  # fmt: skip
    return plant, ledger


@pytest.mark.parametrize("begin", [dried_out, stood_still])
@pytest.mark.parametrize("air_kg_s", [0.05, 0.3])
@pytest.mark.parametrize("air_c", [25.0, 60.0])
@pytest.mark.parametrize("opening_percent", [8.0, 40.0])
@pytest.mark.parametrize("speed_rpm", [900.0, 4000.0])
def test_two_phase_zone_comes_back_and_leads_to_the_one_place_to_settle(
    speed_rpm, opening_percent, air_c, air_kg_s, begin
):
    """A wet feed wets the inlet: where the plant comes from does not decide where it comes to rest."""
    other = Plant.at("med")
    other.advance(
        1500.0, compressor_speed_rpm=speed_rpm, valve_opening_percent=opening_percent, air_inlet_temperature_c=air_c,
        air_mass_flow_kg_s=air_kg_s, condenser_air_inlet_temperature_c=40.0,
    )  # fmt: skip
    plant, ledger = begin(speed_rpm, air_c, air_kg_s)
    plant.advance(1500.0, compressor_speed_rpm=speed_rpm, valve_opening_percent=opening_percent)
    assert regimes(plant)[0] != 2
    assert plant.outputs.evaporator_pressure_pa == pytest.approx(other.outputs.evaporator_pressure_pa, abs=50.0)
    assert plant.outputs.superheat_k == pytest.approx(other.outputs.superheat_k, abs=0.05)
    assert plant.outputs.cooling_power_w == pytest.approx(other.outputs.cooling_power_w, rel=1e-3)
    ledger.check(mass=1e-12, energy=1e-12)


@pytest.mark.parametrize("speed_rpm", [900.0, 2000.0, 4000.0])
def test_return_of_the_two_phase_zone_conserves_and_does_not_jump(speed_rpm):
    """Across the switch itself, 5 ms by 5 ms: balances to round-off, no jump of pressure, an outlet not too hot."""
    plant, ledger = dried_out(speed_rpm, 60.0, 0.17)
    inputs = plant.inputs
    inputs[1] = 0.2
    before, returned = plant.step(inputs, 0.0), None
    for step in range(1200):
        after = plant.step(inputs, 0.005)
        ledger.check(mass=1e-12, energy=1e-9)
        assert abs(after[0] - before[0]) < 2e3
        before = after
        if returned is None and regimes(plant)[0] == 0:
            returned = step
        outlet_c = after[1] + saturation(load_tables(), after[0])[0] - 273.15
        assert returned is None or outlet_c < 60.0 + 5.0  # where its heat flow ends, above air and walls
    assert returned is not None
    assert plant.state[0] > 0.02


def test_a_shut_valve_leaves_the_evaporator_dry():
    plant, _ = dried_out(2000.0, 40.0, 0.17)
    plant.advance(600.0, valve_opening_percent=0.0)
    assert regimes(plant)[0] == 2


@pytest.mark.parametrize("seed", [5, 17])
def test_no_control_interval_takes_many_steps(seed):
    """Hours of random inputs with slugs of liquid, and feeds into an evaporator that has been pumped down to 20 kPa."""
    plant, most = Plant.at(POINTS[seed % 3]), 0.0
    for w, ticks in random_holds(seed):
        for _ in range(ticks):
            before = plant.steps_tried
            plant.step(w, 0.1)
            most = max(most, plant.steps_tried - before)
    assert most <= 35


def test_zone_of_discharge_gas_does_not_grow_without_discharge():
    """Out of round-off, while the compressor stands still and the condenser's air is warmer than its refrigerant."""
    plant = Plant.at("med", 1.0e-8)
    plant.step(np.array([0.0, 0.88, 0.05, 20.0, 0.2, 45.0, 0.5]), 120.0)
    assert plant.outputs.compressor_power_w == 0.0
    assert plant.state[5] < 1e-6
