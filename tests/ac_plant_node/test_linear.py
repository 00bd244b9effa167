"""The linear model against the nonlinear simulation."""

import control
import numpy as np
import pytest

from ac_plant_node import INPUTS, OUTPUTS, POINTS, Plant, linearize, operating_point
from ac_plant_node.linear import descriptor


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
