"""What the governor passes on: small steps to the last bit, large ones as the loop can follow them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ac_design.analysis.step_response import run
from gimc_controller_node.reference_governor import ReferenceGovernor

SAMPLE_TIME_S = 0.1
LEAD, LAG_S = 8e3, 2.5


def started(output: float) -> ReferenceGovernor:
    governor = ReferenceGovernor(LEAD, LAG_S, SAMPLE_TIME_S)
    governor.start(output)
    return governor


@given(st.floats(-LEAD, LEAD))
def test_a_small_step_is_passed_on_to_the_last_bit(reference: float) -> None:
    governor = started(0.0)
    assert all(governor.step(reference) == reference for _ in range(50))


@given(st.lists(st.floats(-1e5, 1e5), min_size=1, max_size=200))
def test_it_is_never_further_ahead_than_the_lead_and_between_where_it_was_and_what_is_wanted(
    wanted: list[float],
) -> None:
    governor, expected = started(0.0), 0.0
    for reference in wanted:
        passed = governor.step(reference)
        assert abs(passed - expected) <= LEAD * (1.0 + 1e-12)
        assert min(expected, reference) <= passed <= max(expected, reference)
        expected -= math.expm1(-SAMPLE_TIME_S / LAG_S) * (passed - expected)


def test_a_large_step_arrives_after_the_time_that_lead_and_lag_say() -> None:
    governor = started(0.0)
    passed = np.array([governor.step(40e3) for _ in range(300)])
    per_tick = -LEAD * math.expm1(-SAMPLE_TIME_S / LAG_S)  # of where the loop is expected: 3.1 kPa/s
    np.testing.assert_allclose(np.diff(passed[:90]), per_tick, rtol=1e-9)
    arrived = int(np.argmax(passed == 40e3))
    assert arrived == math.ceil((40e3 - LEAD) / per_tick)
    assert (passed[arrived:] == 40e3).all()


def test_it_begins_with_the_first_reference_and_does_not_hide_what_is_no_number() -> None:
    governor = ReferenceGovernor(LEAD, LAG_S, SAMPLE_TIME_S)
    assert governor.step(250e3) == governor.step(250e3) == 250e3
    assert math.isnan(governor.step(math.nan))


@pytest.mark.parametrize(
    ("point", "step_k"),
    [*((point, step_k) for point in ("med", "high") for step_k in (10.0, -10.0)), ("low", 5.0), ("low", -10.0)],
)
def test_a_step_of_the_superheat_and_back_overshoots_by_less_than_a_twentieth(point: str, step_k: float) -> None:
    """At the low point without the governor +5 K overshoots by 16 % and moves p_e by 33 kPa."""
    seen = run(point, [(10.0, 0.0, step_k), (210.0, 0.0, 0.0)], 410.0)
    superheat = seen.superheat_k
    assert (superheat[:2100] / step_k).max() < 1.05
    assert (-superheat[2100:] / step_k).max() < 0.05
    assert np.abs(superheat[[2099, -1]] - [step_k, 0.0]).max() < 0.05
    assert np.abs(seen.pressure_kpa).max() < 2.0
