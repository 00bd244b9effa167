"""What controller and actuators do when something is missing: never a jump of their own making, never a NaN."""

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ac_common.faults import KINDS as FAULTS
from ac_common.safe_command import COMMAND_HOLD_S, SAFE_RATE, CommandHold
from ac_design import design_compensator, design_controller
from ac_design import design_fdi as design
from fdi_node import FaultDetector
from gimc_controller_node import Compensator, limited_k0
from gimc_controller_node.fallback import GIMC, K0_ALONE, SAFE, FallbackController

T = 0.1
REST = np.array([251.2e3, 20.0])


@pytest.fixture(scope="module")
def k0():
    return design_controller("med", T)


def test_without_q_k0_is_alone_within_one_tick_and_q_fades(k0):
    with_q, alone = FallbackController(limited_k0(k0)), limited_k0(k0)
    for _ in range(20):
        with_q.step(REST, REST, np.array([3.0, 0.01]))
        alone.step(REST, REST, np.zeros(2))
    before = with_q.step(REST, REST, np.array([3.0, 0.01]))
    commands = [with_q.step(REST, REST, None) for _ in range(60)]
    assert with_q.mode == K0_ALONE
    jumps = np.abs(np.diff([before, *commands], axis=0))
    assert np.all(jumps.max(axis=0) <= 0.5 * np.array([3.0, 0.01]))
    back = with_q.step(REST, REST, np.array([3.0, 0.01]))
    assert with_q.mode == GIMC
    assert np.all(np.abs(back - commands[-1]) <= np.array([3.0, 0.01]))


happenings = st.lists(
    st.one_of(
        st.just(("missed",)),
        st.tuples(st.just("step"), st.floats(-3e4, 3e4), st.floats(-15, 15), st.booleans()),
    ),
    min_size=1,
    max_size=60,
)


@settings(max_examples=50)
@given(happenings)
def test_every_tick_has_a_finite_command_within_limits(k0, ticks):
    controller = FallbackController(limited_k0(k0))
    for kind, *values in ticks:
        last = controller._command
        if kind == "missed":
            command = controller.on_missed_inputs()
            assert controller.mode == SAFE
            assert np.all(np.abs(command - last) <= np.array(SAFE_RATE) * T + 1e-12)
        else:
            p_e, superheat, has_q = values
            command = controller.step(REST, REST + np.array([p_e, superheat]), np.zeros(2) if has_q else None)
        assert np.isfinite(command).all()
        assert np.all(command >= k0.command_min)
        assert np.all(command <= k0.command_max)


def test_safe_command_is_left_without_a_jump(k0):
    controller = FallbackController(limited_k0(k0))
    for _ in range(100):
        controller.step(REST, REST + np.array([500.0, 0.5]), np.zeros(2))
    for _ in range(20):
        last = controller.on_missed_inputs()
    again = controller.step(REST, REST + np.array([500.0, 0.5]), np.zeros(2))
    np.testing.assert_allclose(again, last, atol=1e-9)


@given(st.lists(st.booleans(), max_size=80), st.floats(0.0, 600.0), st.floats(0.0, 1.0))
def test_actuators_hold_then_go_to_the_safe_command(commands_come, speed, opening):
    safe, command = np.array([104.7, 0.4]), np.array([speed, opening])
    hold = CommandHold(safe, T)
    silence = 0
    hold.commanded(command)
    for comes in commands_come:
        before = hold.setpoint.copy()
        if comes:
            hold.commanded(command)
            silence = 0
            np.testing.assert_array_equal(hold.setpoint, command)
            continue
        silence += 1
        now = hold.silent()
        if silence * T <= COMMAND_HOLD_S:
            np.testing.assert_array_equal(now, before)
        assert np.all(np.abs(now - before) <= np.array(SAFE_RATE) * T + 1e-12)
        assert np.all(np.abs(now - safe) <= np.abs(before - safe) + 1e-12)  # never away from it


def observed(detector, k, faulty):
    """One tick of a made-up run."""
    rest = detector.design.output_rest
    measured = rest + np.array([200.0, 0.1, 0.05]) * math.sin(0.05 * k) + (np.array([4e3, 0, 0]) if faulty else 0.0)
    command = detector.design.input_rest[:2] + np.array([0.5 * math.sin(0.03 * k), 0.0])
    found = detector.observe(k * T, measured, detector.design.input_rest[2])
    detector.commanded(command)
    return found, measured, command


def test_detector_with_the_memory_of_another_goes_on_bit_for_bit():
    fdi = design("med", T)
    one = FaultDetector(fdi)
    for k in range(300):
        observed(one, k, faulty=k > 100)
    other = FaultDetector(fdi)
    other.restore(json.loads(json.dumps(one.state())))
    for k in range(300, 320):
        first, second = observed(one, k, True)[0], observed(other, k, True)[0]
        np.testing.assert_array_equal(first.innovation, second.innovation)
        np.testing.assert_array_equal(first.residual, second.residual)
        assert (first.isolated, first.onset_s) == (second.isolated, second.onset_s)
    with pytest.raises(ValueError, match="not the state"):
        other.restore({"_in": [1.0]})
    whole = one.state()
    with pytest.raises(ValueError, match=r"\(1,\) instead of"):
        other.restore({**whole, "_in": [1.0]})
    first, second = observed(one, 320, True)[0], observed(other, 320, True)[0]
    np.testing.assert_array_equal(first.innovation, second.innovation)  # a memory that was refused has changed nothing


def test_detector_that_missed_two_seconds_is_nearly_where_it_would_be():
    fdi = design("med", T)
    whole, gap = FaultDetector(fdi), FaultDetector(fdi)
    for k in range(200):
        observed(whole, k, False)
        observed(gap, k, False)
    for k in range(200, 220):
        found, _, command = observed(whole, k, False)
    found, measured, _ = observed(whole, 220, False)
    gap.warm_restart(measured, fdi.input_rest[2], command, 20)
    late = gap.observe(220 * T, measured, fdi.input_rest[2])
    assert np.all(np.abs(np.subtract(late.residual, found.residual)) < 0.2 * fdi.thresholds)


def test_detector_that_knows_nothing_takes_no_transient_for_a_fault():
    fdi = design("med", T)
    detector = FaultDetector(fdi)
    rest = fdi.output_rest + np.array([5e3, -2.5, 0.3])  # somewhere else in its range
    detector.warm_restart(rest, fdi.input_rest[2], fdi.input_rest[:2])
    np.testing.assert_allclose(detector.observe(0.0, rest, fdi.input_rest[2]).innovation, 0.0, atol=1e-6)


def test_compensator_with_the_memory_of_another_goes_on_bit_for_bit():
    q = design_compensator("med", T)
    one, other = Compensator(q), Compensator(q)
    for k in range(100):
        one.step(np.array([500.0 * math.sin(0.1 * k), 0.1, 0.0]), FAULTS[0] if k > 50 else None)
    other.restore(json.loads(json.dumps(one.state())))
    for k in range(100, 120):
        innovation = np.array([500.0 * math.sin(0.1 * k), 0.1, 0.0])
        np.testing.assert_array_equal(one.step(innovation, FAULTS[0]), other.step(innovation, FAULTS[0]))
    with pytest.raises(ValueError, match="not the state"):
        other.restore({})


def test_a_detector_that_joins_takes_the_state_that_its_inputs_make_most_likely():
    from scipy.linalg import solve_discrete_lyapunov

    from fdi_node.detector import _covariance

    fdi = design("low", T)
    driven = fdi.b @ np.diag([4.0, 0.01, 1.0, 1000.0, 1.0, 0.5])
    expected = solve_discrete_lyapunov(fdi.a, driven @ driven.T)
    np.testing.assert_allclose(_covariance(fdi.a, driven @ driven.T), expected, rtol=1e-6, atol=1e-9 * expected.max())
