"""Table I: found by the solver, and reproduced by the calibration."""

import numpy as np
import pytest

from ac_plant_node import POINTS, TABLE_I, calibrate, linearize, load_parameters, operating_point, table_inputs
from ac_plant_node.equilibrium import RATE_SCALE, equilibrium, rates
from ac_plant_node.parameters.values import SOLVED
from ac_plant_node.properties.tables import load_tables


@pytest.mark.parametrize("row", TABLE_I, ids=lambda r: r.name)
def test_table_one_is_an_equilibrium(row):
    point = operating_point(row.name)
    assert point.outputs[0] / 1e3 == pytest.approx(row.evaporator_pressure_kpa, abs=0.05)
    assert point.outputs[1] == pytest.approx(20.0, abs=0.02)
    parameters = load_parameters()
    s, ds, _ = rates(point.state, point.inputs, parameters, load_tables())
    assert s[0] + s[5] == pytest.approx(parameters["charge_kg"], abs=1e-12)
    assert np.max(np.abs(ds / RATE_SCALE)) < 1e-9


def test_calibration_reproduces_the_shipped_parameters():
    shipped = load_parameters()
    scrambled = shipped.replace(eta_v_offset=0.9, eta_v_speed=0.0, valve_area_0_m2=0.0, valve_area_1_m2=3e-6)
    solved, points = calibrate(scrambled)
    for name in SOLVED:
        assert solved[name] == pytest.approx(shipped[name], rel=1e-6)
    assert [p.row.name for p in points] == list(POINTS)


def test_gain_of_speed_on_pressure_with_superheat_held_is_the_papers():
    """The paper's passive loop answers 5 kPa with 50 rpm: -0.1 kPa/rpm, which nothing here was fitted to."""
    base = table_inputs("med")

    def held(speed_factor):
        w = base.copy()
        w[0] *= speed_factor
        low, high = 0.35, 0.45
        start = operating_point("med").state
        for _ in range(40):
            w[1] = 0.5 * (low + high)
            at = equilibrium(w, start=start)
            low, high = (w[1], high) if at.outputs[1] > 20.0 else (low, w[1])
        return at.outputs[0]

    gain = (held(1.01) - held(0.99)) / 1e3 / (0.02 * 1000.0)
    assert -0.11 < gain < -0.09
    g = np.asarray(linearize("med").dcgain())
    linear = (g[0, 0] - g[0, 1] * g[1, 0] / g[1, 1]) * (2 * np.pi / 60) / 1e3
    assert linear == pytest.approx(gain, rel=0.01)


def test_unknown_point_is_one_line():
    with pytest.raises(ValueError, match="allowed are low, med, high") as info:
        operating_point("medium")
    assert "\n" not in str(info.value)
