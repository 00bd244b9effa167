"""Corners of the cycle against the plant's own state, and against CoolProp."""

import math

import numpy as np
import pytest
from CoolProp import CoolProp

from ac_plant_node import POINTS, Plant, operating_point
from bringup.dash.cycle import corners, dome, subcooled_enthalpy


@pytest.mark.parametrize("point", POINTS)
def test_at_rest_the_corners_are_the_plants(point: str) -> None:
    at = operating_point(point)
    p_e, superheat, _, p_c = at.outputs
    got = corners(p_e, superheat, p_c, subcooled_enthalpy(p_c, at.state[8]))
    h_1, h_2, h_3, h_4 = got.enthalpy_j_kg
    assert h_1 == pytest.approx(at.state[2], abs=1.0)
    assert h_2 == pytest.approx(at.discharge_enthalpy_j_kg, abs=1.0)
    assert h_3 == h_4 == pytest.approx(at.state[8], abs=1e-6)
    np.testing.assert_array_equal(got.pressure_pa, [p_e, p_c, p_c, p_e])
    # What the cycle says of the cooling, against the refrigerant's balance.
    assert at.mass_flow_kg_s * (h_1 - h_4) == pytest.approx(at.cooling_power_w, rel=1e-3)


def test_on_the_move_the_corners_are_the_plants() -> None:
    plant = Plant.at("med")
    for speed in (1300.0, 700.0):
        for _ in range(30):
            out = plant.advance(1.0, compressor_speed_rpm=speed)
            x = plant.state
            below = subcooled_enthalpy(out.condenser_pressure_pa, x[8])
            got = corners(out.evaporator_pressure_pa, out.superheat_k, out.condenser_pressure_pa, below)
            assert got.enthalpy_j_kg[0] == pytest.approx(x[2], abs=1.0)
            assert got.enthalpy_j_kg[2] == pytest.approx(x[8], abs=1e-6)


def test_against_coolprop() -> None:
    p_e, superheat, p_c = 3.0e5, 20.0, 1.3e6
    got = corners(p_e, superheat, p_c, 0.0)
    t_1 = CoolProp.PropsSI("T", "P", p_e, "Q", 1, "R134a") + superheat
    h_1, s_1 = (CoolProp.PropsSI(key, "P", p_e, "T", t_1, "R134a") for key in "HS")
    h_2s = CoolProp.PropsSI("H", "P", p_c, "S", s_1, "R134a")
    assert got.enthalpy_j_kg[0] == pytest.approx(h_1, abs=20.0)
    assert got.enthalpy_j_kg[1] == pytest.approx(h_1 + (h_2s - h_1) / 0.68, abs=60.0)
    assert got.enthalpy_j_kg[2] == pytest.approx(CoolProp.PropsSI("H", "P", p_c, "Q", 0, "R134a"), abs=20.0)


def test_without_superheat_dry_vapour_is_drawn() -> None:
    got = corners(3.0e5, 0.0, 1.3e6, 0.0)
    assert got.enthalpy_j_kg[0] == pytest.approx(CoolProp.PropsSI("H", "P", 3.0e5, "Q", 1, "R134a"), abs=20.0)


def test_the_dome_closes_towards_its_top() -> None:
    h, p = dome()
    middle = len(h) // 2
    widths = h[::-1][:middle] - h[:middle]
    assert (np.diff(widths) < 0.0).all()
    assert math.isclose(p[0], p[-1])
