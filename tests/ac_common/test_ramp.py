"""Changes of references and air while the loop runs: where they start, where they end, and the way between."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ac_common.ramp import LiveOffset
from ac_experiments.scenario import _moves
from ac_experiments.scenario_schema import Air, Change, References, targets_within

SAMPLE_TIME_S = 0.1


def test_nothing_asked_for_adds_nothing() -> None:
    offset = LiveOffset()
    assert [offset.value(k * SAMPLE_TIME_S) for k in range(5)] == [0.0] * 5


@given(first=st.floats(-100.0, 100.0), second=st.floats(-100.0, 100.0), ramp_s=st.just(0.0) | st.floats(0.05, 20.0))
def test_live_change_has_the_shape_of_a_scheduled_one(first: float, second: float, ramp_s: float) -> None:
    time_s = np.arange(500) * SAMPLE_TIME_S
    offset = LiveOffset()
    live = []
    for k, t in enumerate(time_s):
        if k in (20, 250):
            offset.change(first if k == 20 else second, ramp_s)
        live.append(offset.value(float(t)))
    changes = [Change(at_s=float(time_s[k]), to=to, ramp_s=ramp_s) for k, to in ((20, first), (250, second))]
    np.testing.assert_allclose(live, _moves(time_s, changes), atol=1e-9)
    assert live[-1] == second  # exactly: a step back to nothing must leave nothing


@given(targets=st.lists(st.floats(-100.0, 100.0), min_size=2, max_size=6), ramp_s=st.floats(0.5, 20.0))
def test_change_on_the_way_to_another_goes_on_from_where_it_is(targets: list[float], ramp_s: float) -> None:
    offset = LiveOffset()
    values = [offset.value(0.0)]
    for k in range(450):
        if k % 40 == 0 and k // 40 < len(targets):
            offset.change(targets[k // 40], ramp_s)
        values.append(offset.value((k + 1) * SAMPLE_TIME_S))
    # No tick moves by more than the steepest of the ramps: 200 units within ramp_s.
    assert np.max(np.abs(np.diff(values))) <= 200.0 * SAMPLE_TIME_S / ramp_s + 1e-9
    assert values[-1] == targets[-1]


def test_limits_are_those_of_a_scenario() -> None:
    assert targets_within(References, "superheat_k").highest == 30.0
    with pytest.raises(ValueError, match="allowed: -90 to 300"):
        targets_within(Air, "mass_flow_percent")([Change(at_s=0.0, to=301.0)])
