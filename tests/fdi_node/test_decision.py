"""The state machine of the decision: a reading that jumps, spikes, gaps, and a memory that takes up where it was."""

import json
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ac_common.faults import ISOLABLE_KINDS, UNKNOWN
from fdi_node.decision import Conclusion, Decision, JumpRule, State, Supervision

T = 0.1
REST = (2.5e5, 20.0, 12.0)
QUIET = [0.0, 0.0]


def decision() -> Decision:
    return Decision(Supervision(), JumpRule(), T)


def run(subject: Decision, ticks: int, start: int = 0, ratios: list[float] = QUIET, **moved: float) -> list[Conclusion]:
    """Ticks with constant ratios and readings, those of rest but for what has moved."""
    p_e, superheat, wall = REST
    seen = []
    for k in range(start, start + ticks):
        readings = p_e + moved.get("p_e", 0.0), superheat + moved.get("superheat", 0.0), wall + moved.get("wall", 0.0)
        seen.append(subject.step(k * T, ratios, *readings))
    return seen


@pytest.mark.parametrize("size", [-10.0, -2.5, 2.5, 10.0])
def test_a_superheat_that_jumps_alone_is_an_unknown_fault_after_its_confirmation(size: float) -> None:
    subject = decision()
    assert not any(found.detected for found in run(subject, 100))
    seen = run(subject, 20, 100, superheat=size)
    first = next(k for k, found in enumerate(seen) if found.detected)
    assert first * T == pytest.approx(Supervision().confirm_s)
    last = seen[-1]
    assert (last.isolated, last.residual, last.also_isolated) == (UNKNOWN, -1, None)
    assert last.onset_s == pytest.approx(10.0)
    assert subject.phase is State.UNKNOWN


@pytest.mark.parametrize(
    "moved",
    [
        {"superheat": 1.9},  # no more than the evaporator can do
        {"p_e": 5000.0},  # what a fault of the pressure's sensor does
        {"p_e": 5000.0, "superheat": -6.0},  # and with a derived superheat
        {"superheat": 3.0, "wall": 2.0},  # all readings of the zone
        {"wall": 20.0},  # the superheated zone ends
    ],
)
def test_what_a_filter_is_for_and_what_is_physical_is_no_jump(moved: dict[str, float]) -> None:
    subject = decision()
    run(subject, 100)
    assert not any(found.detected for found in run(subject, 100, 100, **moved))


def test_a_spike_is_ridden_through() -> None:
    subject = decision()
    run(subject, 100)
    run(subject, 2, 100, superheat=5.0)
    assert not any(found.detected for found in run(subject, 100, 102))


def test_a_gap_in_the_readings_is_no_jump() -> None:
    subject = decision()
    run(subject, 100)
    subject.forget_jumps()
    assert not any(found.detected for found in run(subject, 100, 200, superheat=5.0))


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), deviation=st.floats(0.0, 5.0))
def test_noise_is_no_jump_however_much_of_it_there_is(seed: int, deviation: float) -> None:
    """Standard deviation of the superheat's noise from none to more than ten times what designs are made for."""
    subject, random = decision(), np.random.default_rng(seed)
    for k in range(600):
        off = deviation * random.standard_normal(3) * (2000.0, 1.0, 0.5)
        assert not subject.step(k * T, QUIET, *(np.array(REST) + off)).detected


def test_nothing_else_is_isolated_while_it_is_there_and_the_residuals_count_again_when_it_is_over() -> None:
    subject = decision()
    run(subject, 100)
    seen = run(subject, 1500, 100, [3.0, 9.0], superheat=4.0)
    assert {found.isolated for found in seen if found.detected} == {UNKNOWN}
    back = run(subject, 1400, 1600, [3.0, 9.0])  # the reading is back, but the residuals remain: another fault is there
    gone = next(k for k, found in enumerate(back) if found.isolated != UNKNOWN)
    assert gone * T == pytest.approx(JumpRule().aftermath_s, abs=0.11)
    assert back[-1].isolated == ISOLABLE_KINDS[1]


def test_it_is_over_as_soon_as_no_residual_tells_of_it() -> None:
    subject = decision()
    run(subject, 100)
    run(subject, 100, 100, [3.0, 3.0], superheat=4.0)
    seen = run(subject, 250, 200, superheat=4.0)
    over = next(k for k, found in enumerate(seen) if not found.detected)
    assert over * T == pytest.approx(Supervision().clear_s, abs=0.11)
    assert subject.phase is State.QUIET


@settings(max_examples=50, deadline=None)
@given(
    parts=st.lists(st.tuples(st.floats(0.0, 5.0), st.floats(0.0, 5.0), st.floats(-5.0, 5.0)), min_size=2, max_size=8),
)
def test_whoever_takes_its_place_concludes_the_same(parts: list[tuple[float, float, float]]) -> None:
    """After a gap in which nothing happens; a jump at the very cut is lost, since nobody saw it."""
    whole, taken = decision(), decision()
    k = 0
    for first, second, superheat in parts:
        whole_seen = run(whole, 60, k, [first, second], superheat=superheat)
        taken_seen = run(taken, 60, k, [first, second], superheat=superheat)
        assert repr(whole_seen) == repr(taken_seen)
        heir = decision()
        heir.restore(json.loads(json.dumps(taken.state())))
        assert heir.state() == taken.state()
        whole.forget_jumps()
        taken, k = heir, k + 60


def test_a_memory_of_something_else_is_refused() -> None:
    memory = decision().state()
    for key in memory:
        with pytest.raises((KeyError, TypeError, ValueError)):
            decision().restore({name: value for name, value in memory.items() if name != key})
    with pytest.raises(ValueError, match="1 residuals, expected 2"):
        decision().restore({**memory, "watches": memory["watches"][:1]})


def test_states_follow_each_other_as_the_table_says() -> None:
    subject = decision()
    states = []
    for ticks, ratios in ((100, [0.0, 0.0]), (20, [1.2, 1.1]), (60, [1.4, 0.2]), (400, [0.1, 0.1])):
        k = len(states)
        for tick in range(k, k + ticks):
            subject.step(tick * T, ratios, *REST)
            states.append(subject.phase)
    assert [a for a, b in pairwise([*states, None]) if a is not b] == [
        State.QUIET,
        State.DETECTED,
        State.ISOLATED,
        State.QUIET,
    ]
    assert math.isnan(subject.step(100.0, [0.0, 0.0], *REST).onset_s)
