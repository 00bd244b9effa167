"""The observer's step and products against slower ways to the same."""

import numpy as np
import pytest

from ac_plant_node.dynamics import integrator
from ac_plant_node.dynamics.balances import N_STATES
from ac_plant_node.dynamics.workspace import ERROR_SCALE, N_STEPS, TOLERANCE, views
from fdi_node.envelope.detector import rules_of
from fdi_node.envelope.memory import packed, rules_in
from fdi_node.envelope.model import ENERGY, apply
from fdi_node.envelope.products import multiply, subtract, terms
from fdi_node.envelope.step import go_on
from tests.fdi_node.envelope.loops import NOISE, Loop, design


def ends(point: str, share: float, exact: bool) -> tuple[np.ndarray, np.ndarray, float]:
    """State and outputs, in units of the scales, one tick after both commands have changed by a share; steps taken."""
    loop = Loop(point)
    list(loop.run(2.5))
    loop.step()
    detector, m = loop.detector, loop.detector.memory
    detector._told[:2] *= 1.0 + share
    apply(m.x, detector.rules.rows, detector._told, detector.rules.nominal, m.par, m.held)
    out, k = np.zeros(4), views(m.work)
    taken = k.memory[N_STEPS]
    if exact:
        k.memory[TOLERANCE], k.held[0] = 1.0e-8, np.nan
        assert integrator.run(m.work, m.par, detector._tab, m.held, 0.1, out) == 0
    else:
        assert not np.isnan(go_on(k, m.work, m.par, detector._tab, m.held, 0.1, m.C, out))
    return np.delete(k.y / ERROR_SCALE, ENERGY), out / NOISE, k.memory[N_STEPS] - taken


@pytest.mark.parametrize("point", ["low", "med", "high"])
def test_step_is_that_of_the_plant_at_a_tight_tolerance(point: str) -> None:
    (state, outputs, _), (ours, shown, taken) = (ends(point, 2.0e-3, exact) for exact in (True, False))
    assert taken == 0.0  # it is none of the integration's own
    assert ours == pytest.approx(state, abs=1.0e-3)
    assert shown == pytest.approx(outputs, abs=0.1)


def test_step_is_the_plants_own_after_a_large_change() -> None:
    (state, outputs, _), (ours, shown, taken) = (ends("high", 0.2, exact) for exact in (True, False))
    assert taken > 0.0
    assert ours == pytest.approx(state, abs=1.0e-2)
    assert shown == pytest.approx(outputs, abs=0.1)


def test_products_are_those_of_matrices() -> None:
    random, m = np.random.default_rng(1), Loop("med").detector.memory
    rows, n = rules_of(design()).rows, len(m.P)
    F, V, P = random.normal(size=(N_STATES, n)), random.normal(size=(n, 83)), np.eye(n)
    F[:, ENERGY] = V[ENERGY] = 0.0
    F[:, N_STATES:][:, rows[:, 0] == 2.0] = 0.0
    D = np.zeros((N_STATES, 83))
    columns = terms(rows, P, False)
    multiply(F, V, columns, 83, D)
    assert pytest.approx(F @ V) == D
    assert len(columns) % 4 == 0
    P[0, 0] = 0.0
    assert {*columns} - {*terms(rows, P, False)} == {0}
    assert 0 in terms(rows, P, True)
    K, gains, G = random.normal(size=(4, n)), random.normal(size=4), random.normal(size=(4, 83))
    K[:, 3] = 0.0
    expected = V - K.T @ np.diag(gains) @ G
    subtract(K, gains, G, n, V)
    assert pytest.approx(expected) == V


def test_rules_come_out_of_one_array_as_they_went_in() -> None:
    rules = rules_of(design())
    for ours, theirs in zip(rules, rules_in(packed(rules)), strict=True):
        assert np.array_equal(ours, theirs)
