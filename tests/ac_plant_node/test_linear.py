"""The linear model against the nonlinear simulation."""

import control
import numpy as np
import pytest

from ac_plant_node import INPUTS, OUTPUTS, POINTS, Plant, linearize, operating_point
from ac_plant_node.equilibrium import equilibrium
from ac_plant_node.inputs import FAULTS, N_INPUTS, N_PHYSICS, TO_SI
from ac_plant_node.inputs import INPUTS as PLANT_INPUTS
from ac_plant_node.linear import ALL_INPUTS, MORE_OUTPUTS, descriptor


@pytest.mark.parametrize("point", POINTS)
def test_charge_is_the_only_mode_projected_out(point):
    a, b, m = descriptor(operating_point(point))
    assert np.max(np.abs(m @ a)) < 1e-8 * np.max(np.abs(m) @ np.abs(a))
    assert np.max(np.abs(m @ b)) < 1e-8 * np.max(np.abs(m) @ np.abs(b))
    model = linearize(point)
    assert model.nstates == 11
    assert list(model.input_labels) == list(INPUTS)
    assert list(model.output_labels) == list(OUTPUTS)
    full, reduced = np.linalg.eigvals(a), model.poles()
    kept = np.delete(full, np.argmin(np.abs(full)))
    np.testing.assert_allclose(np.sort_complex(kept), np.sort_complex(reduced), rtol=1e-4)
    assert reduced.real.max() < 0.0


@pytest.mark.parametrize("point", POINTS)
@pytest.mark.parametrize("channel", range(4))
def test_small_step_matches_the_nonlinear_plant(point, channel):
    """Central difference of two nonlinear responses: what is left is third order in the step."""
    size = np.array([0.2, 2e-4, 1e-4, 0.05])[channel]
    at, model = operating_point(point), linearize(point)
    n, h = 600, 0.1
    responses = []
    for sign in (1.0, -1.0):
        plant, w = Plant.at(point, tolerance=1e-8), at.inputs.copy()
        w[channel] += sign * size
        responses.append(np.array([plant.step(w, h)[:3] for _ in range(n)]))
    nonlinear = 0.5 * (responses[0] - responses[1])
    u = np.zeros((4, n + 1))
    u[channel] = size
    _, linear = control.forced_response(model, np.arange(n + 1) * h, u)
    error = np.abs(nonlinear - linear[:, 1:].T).max(axis=0) / np.abs(linear).max(axis=1)
    assert error.max() < 5e-3


@pytest.mark.parametrize("name", [row.name for row in PLANT_INPUTS[4:]] + [row.kind for row in FAULTS[:N_PHYSICS]])
def test_further_inputs_and_outputs_match_the_nonlinear_plant(name):
    """Condenser air, humidity and faults as inputs; p_c, subcooling, heat and work as outputs, some fed through."""
    humid = equilibrium(np.append(operating_point("med").inputs, [0.6, 33.0, 0.5]))
    outputs = (*OUTPUTS, *MORE_OUTPUTS)
    model = linearize(humid, (name,), outputs)
    assert model.nstates == (12 if name == "refrigerant_leak" else 11)
    n, h = 300, 0.1
    column = ALL_INPUTS.index(name)
    size = 5.0 * [row.step for row in (*PLANT_INPUTS, *FAULTS)][column]

    def response(share):
        plant, w = Plant(humid.conserved, humid.inputs, tolerance=1e-9), humid.inputs.copy()
        if column < N_INPUTS:
            w[column] += share * size
        else:
            plant.set_faults({name: share * size / TO_SI[FAULTS[column - N_INPUTS].unit](1.0)})
        rows = []
        for _ in range(n):
            plant.step(w, h)
            o = plant.outputs
            rows.append(
                [o.evaporator_pressure_pa, o.superheat_k, o.wall_temperature_c, o.condenser_pressure_pa, o.subcooling_k,
                 o.cooling_power_w, o.latent_cooling_w, o.compressor_power_w, o.condensed_water_kg_s]
            )  # fmt: skip
        return np.array(rows)

    # Twice the response to half the step, less that to the whole one: what is left is third order there, too.
    base = response(0.0)
    nonlinear = 4.0 * (response(0.5) - base) - (response(1.0) - base)
    _, linear = control.forced_response(model, np.arange(n + 1) * h, np.full((1, n + 1), size))
    linear = linear[:, 1:].T
    error = np.abs(nonlinear - linear).max(axis=0) / np.abs(linear).max(axis=0)
    print(name, error)
    assert error.max() < 5e-3


def test_signals_that_the_linear_plant_does_not_have_are_one_line():
    with pytest.raises(
        ValueError, match="no signal 'valve_stuck' of the linear plant: allowed are compressor_speed"
    ) as e:
        linearize("med", inputs=("valve_stuck",))
    assert "\n" not in str(e.value)
    with pytest.raises(ValueError, match="no signal 'noise' of the linear plant: allowed are evaporator_pressure"):
        linearize("med", outputs=("noise",))
