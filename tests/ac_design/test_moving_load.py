"""Time-difference dynamics away from equilibria: against the linear plant, and against the plant itself."""

import numpy as np
import pytest
from scipy.linalg import expm

from ac_common.units import RPM
from ac_design import ENVELOPE_CONTROLLER, design_controller
from ac_design.analysis.moving_load import decay, plant_jacobians, slowest_pole, tick_jacobian
from ac_plant_node import Plant, linearize, operating_point

T = 0.1


@pytest.mark.parametrize("point", ["low", "med", "high"])
def test_at_an_equilibrium_it_is_the_linear_plant(point):
    at, known = operating_point(point), linearize(point)
    A, B, C = plant_jacobians(at.state, at.inputs)
    own, other = (np.sort(np.linalg.eigvals(one).real) for one in (A, known.A))
    assert own == pytest.approx(other, rel=1e-3, abs=1e-4)
    assert C @ np.linalg.solve(A, B) == pytest.approx(known.C[:2] @ np.linalg.solve(known.A, known.B[:, :2]), rel=1e-2)


def test_away_from_one_it_is_what_the_plant_does():
    plant, command = Plant.at("med"), np.array([1500.0 * RPM, 0.3])
    inputs = np.concatenate([command, plant.inputs[2:]])
    plant.step(inputs, 20.0)
    A, B, C = plant_jacobians(plant.state, plant.inputs)
    for column, size in enumerate((1.0, 0.005)):
        moved = []
        for sign in (1.0, -1.0):
            other, there = plant.copy(), inputs.copy()
            there[column] += sign * size
            moved.append(other.step(there, T)[:2])
        seen = (moved[0] - moved[1]) / (2.0 * size)
        expected = C @ np.linalg.solve(A, (expm(A * T) - np.eye(11)) @ B[:, column])
        assert expected == pytest.approx(seen, rel=0.05, abs=1e-3 * np.abs(seen).max())


@pytest.mark.parametrize("point", ["low", "med", "high"])
def test_differences_decay_where_the_loop_rests(point):
    at, k0 = operating_point(point), design_controller(point, T, ENVELOPE_CONTROLLER)
    J = tick_jacobian(at.state, at.inputs, k0)
    assert slowest_pole([J], T) < 0.0
    gains = decay([J] * 60, 10, 60)
    assert gains.shape == (1,)
    assert gains[0] < 1.0


def test_an_unstable_loop_is_seen():
    grows = np.diag([1.01, 0.5])
    assert slowest_pole([grows], T) > 0.0
    assert decay([0.5 * np.eye(2), grows, grows], 100, 2)[-1] > 1.0
