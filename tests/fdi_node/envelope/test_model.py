"""The observer's linear model: Jacobians and transition against other ways to them."""

import numpy as np
import pytest
from scipy.linalg import expm

from ac_plant_node.dynamics.balances import N_STATES
from ac_plant_node.dynamics.workspace import N_WORK, views
from fdi_node.envelope.model import ENERGY, linearise
from fdi_node.envelope.transition import hold, transition
from tests.fdi_node.envelope.loops import Loop


@pytest.mark.parametrize("point", ["low", "med", "high"])
def test_jacobian_hardly_depends_on_the_step_where_the_plant_is_smooth(point: str) -> None:
    loop = Loop(point)
    list(loop.run(1.0))
    detector, m = loop.detector, loop.detector.memory
    found = []
    for step in (1.0e-5, 1.0e-4):
        A, C = np.zeros_like(m.A), np.zeros_like(m.C)
        linearise(
            views(m.work), m.x, detector.rules.rows, detector._told, detector.rules.nominal, m.par, detector._tab,
            np.full(len(m.P), step), A, C,
        )  # fmt: skip
        found.append(np.vstack([A, C]))
    first, second = found
    size = np.abs(first).max(axis=1, keepdims=True)
    assert np.abs(first - second).max() > 0.0
    assert (np.abs(first - second) < 2.0e-2 * size + 1.0e-9).all()


def test_columns_say_what_a_small_change_of_the_state_does_over_a_tick() -> None:
    loop = Loop("med")
    list(loop.run(1.0))
    F = loop.detector.memory.F
    state = views(loop.plant._array).y.copy()
    from ac_plant_node.dynamics.workspace import ERROR_SCALE

    for j in (1, 3, 6, 9):
        ends = []
        for sign in (1.0, -1.0):
            plant = loop.plant.copy()
            plant._work.y[j] = state[j] + sign * 1.0e-3 * ERROR_SCALE[j]
            plant._work.held[0] = np.nan
            plant.step(loop.inputs, 0.1)
            ends.append(plant._work.y.copy())
        column = (ends[0] - ends[1]) / (2.0e-3 * ERROR_SCALE)
        column[ENERGY] = F[ENERGY, j]
        assert column == pytest.approx(F[:, j], abs=0.05)


def test_transition_is_the_matrix_exponential() -> None:
    random = np.random.default_rng(3)
    A = random.normal(size=(N_STATES, N_STATES + 5)) * 20.0
    A[:, :N_STATES] -= 60.0 * np.eye(N_STATES)
    whole = np.zeros((N_STATES + 5, N_STATES + 5))
    whole[:N_STATES] = A
    F = np.zeros_like(A)
    assert transition(views(np.zeros(N_WORK)), A, 0.1, F)
    assert pytest.approx(expm(0.1 * whole)[:N_STATES], rel=1e-8, abs=1e-9) == F


def test_transition_that_no_plant_has_is_refused() -> None:
    A = np.zeros((N_STATES, N_STATES + 5))
    F = np.zeros_like(A)
    for rate in (200.0, 1.0e5):  # the second is beyond what a number can be
        A[2, 2] = rate
        assert not transition(views(np.zeros(N_WORK)), A, 0.1, F)
    hold(F)
    assert np.array_equal(F, np.eye(N_STATES, N_STATES + 5))
