"""The decision: when a residual counts as a fault, which one, and when it is over."""

import math
from dataclasses import replace

import numpy as np
import pytest

from ac_common.faults import ISOLABLE_KINDS as FAULTS
from fdi_node.decision import JumpRule, Supervision
from fdi_node.detector import Detection, FaultDetector, FdiDesign

#: The readings are the residuals here, and jump as a superheat cannot.
NO_JUMPS = JumpRule(smallest=(math.inf, math.inf, math.inf))


def detector(**rules: float) -> FaultDetector:
    """Detector without dynamics: the residuals are minus the first two measurements, the thresholds one."""
    design = FdiDesign(
        a=np.zeros((1, 1)),
        b=np.zeros((1, 6)),
        c=1e-300 * np.ones((3, 1)),  # its state is zero, but all three sensors are used
        h_a=np.zeros((1, 1)),
        h_b=np.zeros((1, 3)),
        h_c=np.zeros((2, 1)),
        h_d=np.eye(2, 3),
        input_rest=np.zeros(3),
        output_rest=np.zeros(3),
        thresholds=np.ones(2),
        sample_time_s=0.1,
        supervision=Supervision(**rules),
        jump_rule=NO_JUMPS,
    )
    return FaultDetector(design)


def feed(subject: FaultDetector, residuals: list[tuple[float, float]], start_s: float = 0.0) -> list[Detection]:
    """Detections over ticks of 0.1 s in which the residuals are the given ones."""
    seen = []
    for k, (speed, pressure) in enumerate(residuals):
        seen.append(subject.observe(start_s + 0.1 * k, -np.array([speed, pressure, 0.0]), 0.0))
        subject.commanded(np.zeros(2))
    return seen


def test_silence_below_the_thresholds() -> None:
    last = feed(detector(), [(0.99, -0.99)] * 500)[-1]
    assert not last.detected
    assert last.isolated is None
    assert math.isnan(last.size)
    assert math.isnan(last.onset_s)


@pytest.mark.parametrize("fault", [0, 1])
@pytest.mark.parametrize("size", [-3.0, 3.0])
def test_the_leading_residual_names_the_fault(fault: int, size: float) -> None:
    residual = (size, 0.1) if fault == 0 else (0.1, size)
    seen = feed(detector(confirm_s=1.0, isolate_s=1.0), [(0.0, 0.0)] * 10 + [residual] * 40)
    assert seen[-1].isolated == FAULTS[fault]
    assert seen[-1].size == size
    assert seen[-1].onset_s == pytest.approx(1.0)
    assert not any(d.detected for d in seen[:20])
    assert all(d.detected for d in seen[20:])
    assert seen[-1].isolated_s == pytest.approx(2.1, abs=0.11)


def test_a_short_peak_is_not_a_fault() -> None:
    assert not any(d.detected for d in feed(detector(confirm_s=1.0), [(5.0, 0.0)] * 9 + [(0.0, 0.0)] * 50))


def test_two_residuals_alike_are_two_faults_but_not_at_once() -> None:
    seen = feed(detector(isolation_ratio=1.5, undecided_s=5.0), [(3.0, 2.5)] * 200)
    assert all(d.detected and d.isolated is None for d in seen[10:50])
    assert {seen[-1].isolated, seen[-1].also_isolated} == set(FAULTS)


def test_a_fault_that_goes_away_is_cleared_and_can_come_back() -> None:
    subject = detector(clear_s=2.0)
    assert feed(subject, [(3.0, 0.0)] * 50)[-1].isolated == FAULTS[0]
    assert not feed(subject, [(0.1, 0.0)] * 50, start_s=5.0)[-1].detected
    again = feed(subject, [(0.0, 3.0)] * 50, start_s=10.0)[-1]
    assert again.isolated == FAULTS[1]
    assert again.onset_s == pytest.approx(10.0)


def test_what_is_left_when_a_fault_is_over_is_not_taken_for_the_same_fault() -> None:
    """A residual of 0.7 of its threshold, as a small bias leaves it, must not hold the detection and its onset."""
    subject = detector(clear_s=2.0)
    assert feed(subject, [(3.0, 0.7)] * 50)[-1].isolated == FAULTS[0]
    assert not feed(subject, [(0.1, 0.7)] * 300, start_s=5.0)[-1].detected
    again = feed(subject, [(1.2, 3.0)] * 50, start_s=35.0)
    assert (again[-1].isolated, again[-1].also_isolated) == (FAULTS[1], None)
    assert again[-1].onset_s == pytest.approx(35.0)


def test_a_second_fault_that_outlives_the_first_before_it_is_isolated_is_a_detection_of_its_own() -> None:
    subject = detector(clear_s=2.0, cross_talk=(0.4, 0.9))
    assert feed(subject, [(3.0, 0.0)] * 50)[-1].isolated == FAULTS[0]
    assert feed(subject, [(3.0, 2.0)] * 20, start_s=5.0)[-1].also_isolated is None  # taken for cross-talk
    seen = feed(subject, [(0.1, 2.0)] * 50, start_s=7.0)
    assert all(found.detected for found in seen)
    assert (seen[-1].isolated, seen[-1].also_isolated) == (FAULTS[1], None)


def test_a_sensor_that_is_not_used_has_no_innovation_and_a_detector_can_join_without_it() -> None:
    whole = detector().design
    c = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
    two = replace(whole, a=0.5 * np.eye(2), b=np.eye(2, 6), c=c, h_d=np.eye(2, 3))
    subject = FaultDetector(two)
    measured = np.array([3.0, -2.0, 9.0])
    subject.warm_restart(measured, 0.0, np.array([1.0, 2.0]))
    seen = subject.observe(0.0, measured, 0.0)
    np.testing.assert_allclose(seen.innovation, 0.0, atol=1e-12)


def test_cross_talk_of_an_isolated_fault_is_no_second_fault() -> None:
    subject = detector(cross_talk=(0.4, 0.1))
    assert feed(subject, [(0.1, 9.0)] * 50)[-1].isolated == FAULTS[1]
    last = feed(subject, [(3.0, 9.0)] * 100, start_s=5.0)[-1]
    assert (last.isolated, last.also_isolated) == (FAULTS[1], None)


def test_a_second_fault_is_isolated_as_well_and_each_is_cleared_by_itself() -> None:
    subject = detector(clear_s=2.0)
    assert feed(subject, [(3.0, 0.0)] * 50)[-1].isolated == FAULTS[0]
    both = feed(subject, [(3.0, 5.0)] * 50, start_s=5.0)[-1]
    assert (both.isolated, both.also_isolated) == (FAULTS[1], FAULTS[0])
    assert (both.size, both.onset_s) == (5.0, pytest.approx(5.0))
    assert both.isolated_s == pytest.approx(5.5)
    left = feed(subject, [(0.1, 5.0)] * 50, start_s=10.0)[-1]
    assert (left.isolated, left.also_isolated, left.onset_s) == (FAULTS[1], None, pytest.approx(5.0))
    assert not feed(subject, [(0.1, 0.1)] * 50, start_s=15.0)[-1].detected
