"""With dry air, 30 degC at the condenser and no fault, the plant is the one of Table I: against numbers recorded of it.

`dry_air_at_30_degc.json` was written by the model before it knew humidity, the condenser's air and faults: equilibria,
gains, and runs through changing inputs with their balances. What runs do from the 26th on, in the whole box of inputs,
was recorded anew when the regularisation in thin vapour and of short zones changed (p_e by up to 0.55 kPa).
"""

import json
from pathlib import Path

import numpy as np
import pytest

from ac_plant_node import POINTS, Plant, linearize, load_parameters, operating_point, table_inputs
from ac_plant_node.equilibrium import equilibrium

RECORDED = json.loads((Path(__file__).parent / "dry_air_at_30_degc.json").read_text(encoding="utf-8"))
SAME = {"rtol": 1e-12, "atol": 0.0}


@pytest.mark.parametrize("point", POINTS)
def test_equilibria_and_gains(point):
    at, was = operating_point(point), RECORDED[point]
    for name in ("inputs", "outputs", "state", "conserved"):
        np.testing.assert_allclose(getattr(at, name), was[name], **SAME)
    for name in ("mass_flow_kg_s", "cooling_power_w", "compressor_power_w", "subcooling_k"):
        assert getattr(at, name) == pytest.approx(was[name], rel=1e-12)
    # Gains come out of differences, solvers and the linear algebra library of the machine.
    np.testing.assert_allclose(linearize(point).dcgain(), was["dc_gain"], rtol=1e-8)


def test_the_other_refrigerant():
    other = equilibrium(table_inputs("med"), load_parameters().replace(refrigerant="R1234yf"))
    np.testing.assert_allclose(other.outputs, RECORDED["r1234yf_med"], **SAME)


@pytest.mark.parametrize("given", [4, 7])
@pytest.mark.parametrize("point", POINTS)
def test_runs(point, given):
    """Inputs near the point, then anywhere in the box of four, with the further inputs left out or told."""
    at, plant, rng = operating_point(point), Plant.at(point), np.random.default_rng(7)
    low, high = np.array([0.0, 0.0, 0.02, 10.0]), np.array([6000.0 * np.pi / 30.0, 1.0, 0.3, 50.0])
    for k, was in enumerate(RECORDED[point]["run"]):
        w = at.inputs * rng.uniform(0.8, 1.2, 4) if k < 25 else rng.uniform(low, high)
        w = np.append(w, [0.55, 30.0, 0.0])[:given]
        for duration_s in (0.1, 0.1, 1.0, 5.0):
            y = plant.step(w, duration_s)
        now = [*y, plant.stored_energy_j, plant.heat_in_j, plant.refrigerant_mass_kg, plant.outputs.cooling_power_w]
        np.testing.assert_allclose(now, was, **SAME)
