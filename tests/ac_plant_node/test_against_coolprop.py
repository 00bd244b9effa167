"""Tables, right-hand side and steady cycle against CoolProp's equation of state, which none of them calls."""

import CoolProp
import numpy as np
import pytest
from CoolProp.CoolProp import PropsSI

from ac_plant_node import POINTS, Plant, load_parameters, operating_point, table_inputs
from ac_plant_node.coolprop_model import CoolPropModel
from ac_plant_node.equilibrium import RATE_SCALE, equilibrium
from ac_plant_node.properties import lookup
from ac_plant_node.properties.tables import ENTROPY_SPAN_J_KGK, P_MIN_PA, VAPOUR_SPAN_J_KG, load_tables

# Largest errors allowed over the whole envelope (8 kPa to 0.92 of the critical pressure), and up to 0.8 of it, where
# the plant lives: relative for densities and the saturation line, K, J/(kg K), J/kg.
WHOLE = {"rho_v": 5e-4, "T_v": 0.05, "s_v": 0.15, "h_s": 60.0, "rho_l": 5e-4, "T_l": 0.05, "sat": 5e-5}
USUAL = {"rho_v": 1e-5, "T_v": 1e-3, "s_v": 5e-3, "h_s": 1.0, "rho_l": 1e-5, "T_l": 1e-3, "sat": 1e-7}


def table_errors(refrigerant, p_low, p_high, n=2500):
    tab, fluid = load_tables(refrigerant), CoolProp.AbstractState("HEOS", refrigerant)
    rng = np.random.default_rng(1)
    worst = dict.fromkeys(WHOLE, 0.0)

    def note(key, error):
        worst[key] = max(worst[key], abs(error))

    for p in np.exp(rng.uniform(np.log(p_low), np.log(p_high), n)):
        sat = lookup.saturation(tab, p)
        for quality, rows in ((0.0, (1, 3, 5)), (1.0, (2, 4, 6))):
            fluid.update(CoolProp.PQ_INPUTS, p, quality)
            note("sat", sat[0] / fluid.T() - 1)
            for row, exact in zip(rows, (fluid.hmass(), fluid.rhomass(), fluid.smass()), strict=True):
                note("sat", sat[row] / exact - 1)
        h = sat[2] + rng.uniform(0, VAPOUR_SPAN_J_KG)
        fluid.update(CoolProp.HmassP_INPUTS, h, p)
        rho, _, _, temp = lookup.vapour(tab, p, sat[14], h, sat[2], sat[9])
        note("rho_v", rho / fluid.rhomass() - 1)
        note("T_v", temp - fluid.T())
        note("s_v", lookup.vapour_entropy(tab, p, sat[14], h, sat[2], sat[9])[0] - fluid.smass())
        s = sat[6] + rng.uniform(0, ENTROPY_SPAN_J_KGK)
        fluid.update(CoolProp.PSmass_INPUTS, p, s)
        note("h_s", lookup.isentrope(tab, p, sat[14], s, sat[2], sat[9], sat[6], sat[13], sat[0])[0] - fluid.hmass())
        h = sat[1] - rng.uniform(0, 1) * (sat[1] - tab.grid[6])
        fluid.update(CoolProp.HmassP_INPUTS, h, p)
        rho, _, _, temp = lookup.liquid(tab, p, sat[14], h, sat[1], sat[8])
        note("rho_l", rho / fluid.rhomass() - 1)
        note("T_l", temp - fluid.T())
    return worst


@pytest.mark.parametrize("refrigerant", ["R134a", "R1234yf"])
def test_table_accuracy(refrigerant):
    critical = PropsSI("pcrit", refrigerant)
    whole = table_errors(refrigerant, P_MIN_PA, 0.9199 * critical)
    usual = table_errors(refrigerant, P_MIN_PA, 0.8 * critical)
    print(refrigerant, "whole", whole, "up to 0.8 p_crit", usual)
    for key, bar in WHOLE.items():
        assert whole[key] < bar, key
    for key, bar in USUAL.items():
        assert usual[key] < bar, key


def test_slopes_are_those_of_the_tables_themselves():
    """Mass is kept to round-off only if d(rho)/dp and d(rho)/dh are the exact slopes of the tabulated rho."""
    tab = load_tables()
    rng = np.random.default_rng(2)

    def vapour(p, h):
        sat = lookup.saturation(tab, p)
        return lookup.vapour(tab, p, sat[14], h, sat[2], sat[9])[0]

    def liquid(p, h):
        sat = lookup.saturation(tab, p)
        return lookup.liquid(tab, p, sat[14], h, sat[1], sat[8])[0]

    for _ in range(300):
        p = np.exp(rng.uniform(np.log(2e4), np.log(3e6)))
        sat = lookup.saturation(tab, p)
        for function, look, h, row in (
            (vapour, lookup.vapour, sat[2] + rng.uniform(5e3, 150e3), 2),
            (liquid, lookup.liquid, sat[1] - rng.uniform(0.05, 0.95) * (sat[1] - tab.grid[6]), 1),
        ):
            _, slope_p, slope_h, _ = look(tab, p, sat[14], h, sat[row], sat[row + 7])
            dp, dh = 1e-5 * p, 0.5
            assert slope_p == pytest.approx((function(p + dp, h) - function(p - dp, h)) / (2 * dp), rel=1e-4)
            assert slope_h == pytest.approx((function(p, h + dh) - function(p, h - dh)) / (2 * dh), rel=1e-4)


@pytest.mark.parametrize("point", POINTS)
def test_operating_points_rest_without_tables_too(point):
    """The same equations on CoolProp itself: the rates at our equilibria vanish, and so the tables change nothing."""
    at, direct = operating_point(point), CoolPropModel()
    s = direct.conserved(at.state)
    assert s[0] + s[5] == pytest.approx(load_parameters()["charge_kg"], rel=1e-6)
    assert np.max(np.abs(direct.rates(s, at.inputs) / RATE_SCALE)) < 1e-5


@pytest.mark.parametrize("point", POINTS)
def test_rates_agree_away_from_equilibrium(point):
    at, direct = operating_point(point), CoolPropModel()
    w = at.inputs * np.array([1.2, 0.9, 1.1, 1.0])
    s = at.conserved * np.array([1.01, 1.01, 1.001, 1.002, 1.1, 1.0, 1.0, 0.97, 0.999, 1.001, 0.95, 1.05])
    plant = Plant(s, w)
    rates = direct.rates(s, w)
    assert plant.outputs.evaporator_pressure_pa == pytest.approx(direct.aux[1], rel=1e-6)
    assert plant.outputs.condenser_pressure_pa == pytest.approx(direct.aux[7], rel=1e-6)
    np.testing.assert_allclose(plant._work.f1[[0, 1, 2, 6, 7, 8]], rates[[0, 1, 2, 6, 7, 8]], rtol=1e-4)


@pytest.mark.parametrize("point", POINTS)
def test_steady_cycle_recomputed_by_hand(point):
    """Compressor, valve and the first law from pressures, superheat and subcooling alone, within 0.5 %."""
    at, parameters = operating_point(point), load_parameters()
    p_e, superheat, _, p_c = at.outputs

    def h(p, t):
        return PropsSI("H", "P", p, "T", t, "R134a")

    t_1 = PropsSI("T", "P", p_e, "Q", 1, "R134a") + superheat
    h_1, s_1 = h(p_e, t_1), PropsSI("S", "P", p_e, "T", t_1, "R134a")
    h_2s = PropsSI("H", "P", p_c, "S", s_1, "R134a")
    h_2 = h_1 + (h_2s - h_1) / parameters["isentropic_efficiency"]
    t_3 = PropsSI("T", "P", p_c, "Q", 0, "R134a") - at.subcooling_k
    h_3, rho_3 = h(p_c, t_3), PropsSI("D", "P", p_c, "T", t_3, "R134a")
    speed_rpm = at.inputs[0] * 60 / (2 * np.pi)
    eta_v = (
        parameters["eta_v_offset"]
        + parameters["eta_v_pressure_ratio"] * (p_c / p_e - 4)
        + parameters["eta_v_speed"] * (1 - 1000 / speed_rpm)
    )
    flow = eta_v * parameters["displacement_m3_rev"] * speed_rpm / 60 * PropsSI("D", "P", p_e, "T", t_1, "R134a")
    opening = at.inputs[1]
    area = sum(parameters[f"valve_area_{k}_m2"] * opening**k for k in range(3))
    through_valve = parameters["valve_discharge_coefficient"] * area * np.sqrt(2 * rho_3 * (p_c - p_e))
    assert through_valve == pytest.approx(flow, rel=5e-3)
    assert at.mass_flow_kg_s == pytest.approx(flow, rel=5e-3)
    assert at.cooling_power_w == pytest.approx(flow * (h_1 - h_3), rel=5e-3)
    assert at.compressor_power_w == pytest.approx(flow * (h_2 - h_1), rel=5e-3)
    rejected = at.cooling_power_w + at.compressor_power_w
    assert rejected == pytest.approx(flow * (h_2 - h_3), rel=5e-3)
    assert at.cop == pytest.approx((h_1 - h_3) / (h_2 - h_1), rel=5e-3)
    # Air side: what the refrigerant takes up, the air gives, and it stays above the coil.
    leaving = at.inputs[3] - at.cooling_power_w / (at.inputs[2] * parameters["air_cp_j_kgk"])
    assert PropsSI("T", "P", p_e, "Q", 1, "R134a") - 273.15 < leaving < at.inputs[3]


def test_r1234yf_finds_equilibria():
    """What new cars are filled with, in the same hardware: a little less cooling at the same inputs."""
    parameters = load_parameters().replace(refrigerant="R1234yf")
    for point in POINTS:
        ours, other = operating_point(point), equilibrium(table_inputs(point), parameters, name=point)
        assert 0.7 < other.cooling_power_w / ours.cooling_power_w < 1.0
        assert other.outputs[1] > 0.0
        assert other.subcooling_k > 0.0
