"""Jumps of readings, against the same rule written with numpy's differences and medians."""

import math
from collections import deque

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from fdi_node.decision import JumpRule
from fdi_node.reading_jumps import AWAY, DEVIATION, look_for_jump, new_jumps

LENGTH = 20


def is_alone(rule: JumpRule, recent: np.ndarray, i: int) -> bool:
    if 2 * len(recent) < LENGTH:
        return False
    moves = np.abs(np.diff(recent, axis=0))
    usual, still = DEVIATION * np.median(moves[:-1], axis=0), np.array(rule.still)
    stands = moves[-1] < still * np.clip(rule.still_deviations * usual / still, 1.0, 2.0)
    return bool(np.delete(stands, i).all() and moves[-1, i] > rule.deviations * usual[i])


@settings(max_examples=100, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    noise=st.floats(0.0, 0.3),
    jumps=st.lists(st.tuples(st.integers(0, 79), st.sampled_from([-5.0, -2.1, 2.1, 5.0])), max_size=6),
)
def test_it_finds_what_the_rule_says(seed: int, noise: float, jumps: list[tuple[int, float]]) -> None:
    rule, random = JumpRule(smallest=(math.inf, 2.0, 3.0)), np.random.default_rng(seed)
    readings = noise * random.standard_normal((80, 3)) * (300.0, 0.5, 0.5) + (2.5e5, 20.0, 12.0)
    for at, size in jumps:
        readings[at:, 1] += size
    memory = new_jumps(rule.smallest, rule.still, rule.deviations, rule.still_deviations, LENGTH)
    recent: deque[np.ndarray] = deque(maxlen=LENGTH)
    away = np.zeros(3)
    for now in readings:
        recent.append(now)
        found = look_for_jump(memory, *now)
        expected = False
        for i in range(3):
            move = recent[-1][i] - recent[-2][i] if len(recent) > 1 else 0.0
            if not expected and abs(move) > rule.smallest[i] and is_alone(rule, np.array(recent), i):
                away[i], expected = away[i] + move, True
                if abs(away[i]) < 0.5 * rule.smallest[i]:
                    away[i] = 0.0
        assert found == expected
        assert np.array_equal(memory[AWAY : AWAY + 3], away)
