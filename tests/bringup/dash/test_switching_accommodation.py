"""Accommodation switched off and on while the loop runs: q goes and comes without a jump, and off means off."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gimc_controller_node.compensator import Compensator, CompensatorDesign

FADE_S = 5.0
TICKS = round(FADE_S / 0.1)


def compensator(accommodate: bool = True) -> Compensator:
    """A guard that is a gain of 4 rad/s and nothing else, so that q tells what is let through."""
    gains = np.zeros((6, 3))
    gains[0, 0] = 4.0
    design = CompensatorDesign(
        a=np.zeros((0, 0)),
        b=np.zeros((0, 3)),
        c=np.zeros((6, 0)),
        d=gains,
        handover_time_s=5.0,
        fade_time_s=FADE_S,
        washout_time_s=1e9,
        sample_time_s=0.1,
    )
    return Compensator(design, accommodate)


def step(target: Compensator) -> float:
    return float(target.step(np.ones(3), None)[0])


@given(switches=st.lists(st.integers(0, 120), max_size=6))
def test_q_never_jumps(switches: list[int]) -> None:
    target = compensator()
    q = []
    for k in range(130):
        if k in switches:
            target.accommodate = not target.accommodate
        q.append(step(target))
    assert np.max(np.abs(np.diff(q))) <= 4.0 / TICKS + 1e-6
    assert min(q) >= 0.0


def test_off_is_silence_and_on_is_all_of_it() -> None:
    target = compensator()
    full = step(target)
    target.accommodate = False
    going = [step(target) for _ in range(TICKS + 1)]
    np.testing.assert_allclose(going[TICKS // 2 - 1], full / 2, rtol=1e-6)
    assert going[-1] == 0.0
    target.accommodate = True
    coming = [step(target) for _ in range(TICKS + 1)]
    np.testing.assert_allclose(coming[-1], full, rtol=1e-6)


def test_one_that_was_never_switched_is_untouched() -> None:
    active, passive = compensator(), compensator(accommodate=False)
    assert [step(active) for _ in range(3)] == [4.0, 4.0, 4.0]
    # Positive zeros: a passive run records the same bits as before there was a switch.
    assert [np.copysign(1.0, step(passive)) for _ in range(3)] == [1.0, 1.0, 1.0]
    assert step(passive) == 0.0


def test_filters_run_on_while_it_is_off() -> None:
    """Switched on late, the compensator is where it would be if it had been on all the time."""
    lag = CompensatorDesign(
        a=np.array([[0.9]]),
        b=np.array([[0.1, 0.0, 0.0]]),
        c=np.array([[1.0], [0.0], [0.0], [0.0], [0.0], [0.0]]),
        d=np.zeros((6, 3)),
        handover_time_s=5.0,
        fade_time_s=FADE_S,
        washout_time_s=1e9,
        sample_time_s=0.1,
    )
    always, late = Compensator(lag), Compensator(lag, accommodate=False)
    for k in range(200):
        if k == 100:
            late.accommodate = True
        expected, got = always.step(np.ones(3), None), late.step(np.ones(3), None)
    np.testing.assert_array_equal(got, expected)
