"""Air through the condenser: conductance over flow, the plant over its whole range, ram air and the fan's stages."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ac_plant_node import Plant, load_parameters, operating_point
from ac_plant_node.condenser_air import HIGH, LOW, OFF, FrontEnd, condenser_air_flow, fan_stage
from ac_plant_node.drive_cycle import DriveCycle, run_drive_cycle
from ac_plant_node.dynamics import drive as at
from ac_plant_node.equilibrium import equilibrium

PARAMETERS = load_parameters()
FLOWS = [0.1, 0.2, 0.35, 0.55, 0.8, 1.1, 1.5]


def test_conductance_is_the_power_law():
    """UA goes with the root of the flow, and the conductance with 1 - exp(-NTU) of that."""
    for flow in FLOWS:
        w = at.drive(np.append(operating_point("med").inputs, [flow, 30.0, 0.0]), PARAMETERS)
        capacity = flow * PARAMETERS["air_cp_j_kgk"]
        ua = PARAMETERS["condenser_air_ua_w_k"] * np.sqrt(flow / 0.55)
        assert w[at.G_C] == pytest.approx(capacity * -np.expm1(-ua / capacity), rel=1e-12)


@pytest.mark.parametrize("air_c", [0.0, 15.0, 30.0, 50.0])
def test_whole_range_settles_and_more_air_means_less_head_pressure(air_c):
    pressures, plant = [], Plant.at("med")
    for flow in FLOWS:
        out = plant.advance(900.0, condenser_air_mass_flow_kg_s=flow, condenser_air_inlet_temperature_c=air_c)
        pressures.append(out.condenser_pressure_pa)
    assert np.isfinite(pressures).all()
    assert (np.diff(pressures) < 0.0).all()


@pytest.mark.parametrize(("flow", "air_c"), [(0.15, 40.0), (1.5, 10.0), (0.8, 50.0), (0.3, 25.0)])
def test_solver_and_simulation_agree_off_the_nominal_air(flow, air_c):
    inputs = np.append(operating_point("med").inputs * [1.0, 0.9, 1.0, 1.0], [flow, air_c, 0.0])
    plant = Plant.at("med")
    plant.step(inputs, 2500.0)
    if plant.outputs.superheat_k > 0.0:
        np.testing.assert_allclose(plant.step(inputs, 0.0), equilibrium(inputs).outputs, rtol=1e-5)


def test_at_idle_in_the_heat_the_limiter_holds_the_head_pressure():
    """45 degC, the fan dead, the compressor fast: the plant's limiter takes over below its highest pressure."""
    plant = Plant.at("high")
    plant.set_faults({"condenser_fan": 100.0})
    out = plant.advance(600.0, condenser_air_inlet_temperature_c=45.0, compressor_speed_rpm=4000.0)
    assert 3.0e6 < out.condenser_pressure_pa < 3.45e6
    assert plant.state[7] == out.condenser_pressure_pa


@given(st.floats(0.0, 70.0), st.sampled_from([OFF, LOW, HIGH]), st.floats(0.0, 1.0))
def test_flow_grows_with_speed_and_stage(speed, stage, share):
    flow = condenser_air_flow(speed, stage, share)
    assert 0.1 <= flow <= 1.5
    assert flow <= condenser_air_flow(speed + 1.0, stage, share)
    assert flow <= condenser_air_flow(speed, HIGH, share)
    assert condenser_air_flow(speed, stage, 0.0) <= flow


def test_flow_at_its_corners():
    assert condenser_air_flow(0.0, HIGH) == PARAMETERS["condenser_air_kg_s"]
    assert condenser_air_flow(0.0, OFF) == condenser_air_flow(0.0, HIGH, fan_share=0.0) == 0.1
    assert condenser_air_flow(80 / 3.6, OFF) == pytest.approx(1.16 * 0.24 * 0.2 * 80 / 3.6)
    assert condenser_air_flow(60.0, HIGH) == 1.5


def test_fan_switches_with_hysteresis():
    front, stage, seen = FrontEnd(), OFF, []
    for pressure in [1.0e6, 1.5e6, 1.53e6, 1.4e6, 0.94e6, 0.92e6, 1.5e6]:
        stage = fan_stage(stage, pressure, compressor_on=True, front=front)
        seen.append(stage)
    assert seen == [LOW, LOW, HIGH, HIGH, HIGH, LOW, LOW]
    assert fan_stage(LOW, 1.2e6, compressor_on=False) == OFF
    assert fan_stage(HIGH, 1.2e6, compressor_on=False) == HIGH  # still hot: it runs on


def test_ram_air_in_a_drive_cycle():
    """Standstill, then 90 km/h: the ram air brings the head pressure down although the compressor turns faster."""
    cycle = DriveCycle(np.array([0.0, 300.0, 310.0, 600.0]), np.array([0.0, 0.0, 25.0, 25.0]))
    fixed, ram = run_drive_cycle(cycle, "med", 0.5), run_drive_cycle(cycle, "med", 0.5, front=FrontEnd())
    assert ram.outputs[-1, 3] < fixed.outputs[-1, 3] - 1.0e5
    assert abs(ram.mass_drift) < 1e-12
    assert abs(ram.energy_imbalance) < 1e-12
