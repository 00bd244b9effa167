"""The observer's step and products against slower ways to the same."""

import numpy as np
import pytest

from ac_plant_node.dynamics import integrator
from ac_plant_node.dynamics.balances import N_STATES
from ac_plant_node.dynamics.workspace import ERROR_SCALE, N_STEPS, TOLERANCE, views
from fdi_node.envelope.detector import rules_of
from fdi_node.envelope.memory import Memory, memory_of, new_memory, packed, remembered, rules_in
from fdi_node.envelope.model import ENERGY, apply
from fdi_node.envelope.products import combine, multiply, subtract, terms
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


@pytest.mark.parametrize(("precision", "rel"), [(np.float64, 1.0e-12), (np.float32, 1.0e-4)])
def test_products_are_those_of_matrices(precision: type[np.floating], rel: float) -> None:
    random, m = np.random.default_rng(1), Loop("med").detector.memory
    rows, n = rules_of(design()).rows, len(m.P)
    F, V, P = random.normal(size=(N_STATES, n)), random.normal(size=(n, 83)), np.eye(n)
    F[:, ENERGY] = V[ENERGY] = 0.0
    F[:, N_STATES:][:, rows[:, 0] == 2.0] = 0.0
    V = V.astype(precision)
    D, room = np.zeros((N_STATES, 83), precision), np.zeros(n + 4)

    def counting(all_of_them: bool) -> list[float]:
        return room[: terms(rows, P, all_of_them, room)].tolist()

    columns = counting(False)
    multiply(F, V, room, len(columns), 83, D)
    assert pytest.approx(F @ V, rel=rel, abs=rel) == D
    assert len(columns) % 4 == 0
    P[0, 0] = 0.0
    assert {*columns} - {*counting(False)} == {0}
    assert 0 in counting(True)
    K, gains, G = random.normal(size=(4, n)), random.normal(size=4), random.normal(size=(4, 83)).astype(precision)
    K[:, 3] = 0.0
    expected = V - K.T @ np.diag(gains) @ G
    subtract(K, gains, G, n, V)
    assert pytest.approx(expected, rel=rel, abs=rel) == V
    combine(K, V, G)
    assert pytest.approx(K @ V, rel=rel, abs=rel) == G


@pytest.mark.parametrize(("unknowns", "jumping"), [(1, 3), (17, 11), (20, 12)])
def test_parts_of_the_memory_fill_it_and_do_not_overlap(unknowns: int, jumping: int) -> None:
    flat = new_memory(unknowns, jumping)
    parts = memory_of(flat, unknowns, jumping)
    for number, part in enumerate(parts, start=1):
        assert (part == 0.0).all(), Memory._fields[number - 1]
        assert part.ctypes.data % 64 == 0
        part[:] = number
    assert flat.nbytes >= sum(part.nbytes for part in parts) > flat.nbytes - 64 * len(parts)
    assert all((part == number).all() for number, part in enumerate(parts, start=1))
    ends = flat.ctypes.data + 8 * remembered(unknowns, jumping)
    is_room = [part.ctypes.data >= ends for part in parts]
    assert is_room == [number >= Memory._fields.index("step") for number in range(len(parts))]


def test_rules_come_out_of_one_array_as_they_went_in() -> None:
    rules = rules_of(design())
    for ours, theirs in zip(rules, rules_in(packed(rules)), strict=True):
        assert np.array_equal(ours, theirs)
