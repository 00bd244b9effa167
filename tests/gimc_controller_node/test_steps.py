"""The controller's and the compensator's steps: limits, anti-windup, handing over."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gimc_controller_node.compensator import Compensator, CompensatorDesign
from gimc_controller_node.controller import ControllerDesign, GimcController
from gimc_controller_node.limited_controller import Q_FADE_S, LimitedController, limited_k0

NO_Q = np.zeros(2)


def integrators(rate: float = 0.1, read_back: float = 0.5, rate_limit: float = 1e6) -> ControllerDesign:
    """Two integrators in the V~, U~ form: V~^-1 U~ adds `rate * error` a tick, V~'s poles are at `1 - read_back`."""
    return ControllerDesign(
        phi=(1.0 - read_back) * np.eye(2),
        gamma=np.hstack([rate * np.eye(2), read_back * np.eye(2)]),
        c=np.eye(2),
        d=np.zeros((2, 2)),
        command_rest=np.array([100.0, 0.4]),
        command_min=np.zeros(2),
        command_max=np.array([628.0, 1.0]),
        command_rate=np.array([rate_limit, 1.0]),
        sample_time_s=0.1,
    )


def test_at_rest_the_command_is_the_operating_point_s() -> None:
    controller = limited_k0(integrators())
    for _ in range(10):
        command = controller.step(np.array([2e5, 20.0]), np.array([2e5, 20.0, 25.0]), np.zeros(2))
        assert command == pytest.approx([100.0, 0.4], abs=1e-12)


def test_the_factored_form_integrates() -> None:
    controller = limited_k0(integrators(rate=0.1))
    commands = [controller.step(np.array([1.0, 0.0]), np.zeros(3), np.zeros(2)) for _ in range(50)]
    assert np.diff([u[0] for u in commands]) == pytest.approx(0.1, abs=1e-12)


def test_the_command_keeps_its_limits_and_does_not_wind_up() -> None:
    controller = limited_k0(integrators(rate=10.0))
    pushed = [controller.step(np.array([10.0, 0.0]), np.zeros(3), np.zeros(2)) for _ in range(500)]
    assert pushed[-1][0] == 628.0
    back = [controller.step(np.array([-10.0, 0.0]), np.zeros(3), np.zeros(2)) for _ in range(5)]
    assert back[2][0] < 628.0  # an integrator that had wound up would need hundreds of ticks


def test_q_enters_before_the_inverse_of_v() -> None:
    controller = limited_k0(integrators(read_back=0.5))
    first = controller.step(np.zeros(2), np.zeros(3), np.array([1.0, 0.0]))
    second = controller.step(np.zeros(2), np.zeros(3), np.zeros(2))
    assert first[0] - 100.0 == pytest.approx(1.0)  # V~^-1 = (z - 0.5) / (z - 1): one, then a half for ever
    assert second[0] - 100.0 == pytest.approx(0.5)


def test_the_command_keeps_its_rate_and_the_state_knows() -> None:
    controller = limited_k0(integrators(rate=50.0, rate_limit=100.0))
    pushed = [controller.step(np.array([1.0, 0.0]), np.zeros(3), NO_Q)[0] for _ in range(20)]
    assert np.diff(pushed) == pytest.approx([10.0] * 19)
    assert controller.at_limit == (True, False)
    turned = [controller.step(np.array([-1.0, 0.0]), np.zeros(3), NO_Q)[0] for _ in range(3)]
    assert turned[-1] < turned[-2]  # at once, not when an integral that ran ahead has come back


def test_what_was_missing_of_q_fades_out_and_in() -> None:
    """A silent compensator leaves K0 by and by, one that is back is met by and by; no jump beyond a fade's part."""
    controller = limited_k0(integrators(rate=0.0, read_back=0.0))
    q, part = np.array([5.0, 0.2]), 1.0 - np.exp(-0.1 / Q_FADE_S)
    commands = [controller.step(NO_Q, NO_Q, q) for _ in range(5)]
    commands += [controller.step(NO_Q, NO_Q, None) for _ in range(100)]
    assert commands[-1] == pytest.approx([100.0, 0.4], abs=1e-6)
    back = [controller.step(NO_Q, NO_Q, q) for _ in range(400)]
    moves = np.diff(np.array(commands[4:] + back), axis=0)
    assert (np.abs(moves) <= part * q * (1.0 + 1e-9)).all()
    assert back[-1] == pytest.approx(commands[4], abs=1e-12)


def test_a_controller_that_resumes_begins_with_the_actuators_command() -> None:
    controller = limited_k0(integrators())
    measured, reference = np.array([2.0, 1.0, 0.0]), np.array([3.0, -1.0])
    controller.warm_restart(np.array([120.0, 0.3]), measured, reference)
    assert controller.step(reference, measured, None) == pytest.approx([120.0, 0.3], abs=1e-9)
    controller.warm_restart(np.array([700.0, 0.3]), measured, reference)  # a fault took the actuator beyond the limit
    assert controller.step(reference, measured, NO_Q) == pytest.approx([628.0, 0.3], abs=1e-9)
    with pytest.raises(ValueError, match="cannot go on"):
        controller.warm_restart(np.array([np.nan, 0.3]), measured, reference)


class OfItsOwnClass(GimcController):
    """K0, but not known as such: it is asked tick by tick as any controller is."""


@given(
    curvatures=st.tuples(st.sampled_from([0.0, 5e-3]), st.sampled_from([0.0, 2.0])),
    ticks=st.lists(
        st.tuples(st.floats(-50.0, 50.0), st.floats(-1.0, 1.0), st.floats(-20.0, 20.0), st.booleans()), max_size=40
    ),
)
def test_k0_in_one_call_is_k0_asked_as_any_controller(
    curvatures: tuple[float, float], ticks: list[tuple[float, float, float, bool]]
) -> None:
    more = {"priority": np.array([[2.0, 0.5], [0.5, 3.0]]), "lead": np.full(2, 10.0)}
    design = replace(integrators(rate_limit=100.0), curvature=np.array(curvatures), **more)
    one, other = (LimitedController(kind(design), design) for kind in (GimcController, OfItsOwnClass))
    for pressure, superheat, speed, arrives in ticks:
        seen = np.array([pressure, superheat]), np.zeros(3), np.array([speed, 0.1]) if arrives else None
        np.testing.assert_array_equal(one.step(*seen), other.step(*seen))
        assert one.at_limit == other.at_limit


TICK = np.ones(3)
ACT, SEN = "compressor_speed", "evaporator_pressure"


def compensator(accommodate: bool = True, washout_s: float = 1e9) -> Compensator:
    """Filters that are gains: the guard answers f_e = 1 with 4 rad/s, Q_act with 1 rad/s, Q_sen with a valve of 2."""
    gains = np.zeros((6, 3))
    gains[0, 0], gains[2, 0], gains[5, 0] = 4.0, 1.0, 2.0
    design = CompensatorDesign(
        np.zeros((1, 1)), np.zeros((1, 3)), np.zeros((6, 1)), gains, 1.0, 0.5, washout_s, 0.1, np.full(2, 1e3)
    )
    return Compensator(design, accommodate)


def test_the_guard_acts_until_a_fault_is_isolated() -> None:
    subject = compensator()
    assert all(subject.step(TICK, None) == pytest.approx([4.0, 0.0]) for _ in range(20))
    assert subject.step(np.zeros(3), None) == pytest.approx([0.0, 0.0], abs=1e-6)


@pytest.mark.parametrize(("fault", "rest"), [(ACT, [1.0, 0.0]), (SEN, [0.0, 2.0])])
def test_the_isolated_fault_s_filter_has_the_say_at_rest_and_comes_without_a_jump(
    fault: str, rest: list[float]
) -> None:
    subject = compensator()
    before = subject.step(TICK, None)
    over = np.array([before, *(subject.step(TICK, fault).copy() for _ in range(200))])
    assert over[-1] == pytest.approx(rest, abs=1e-6)
    assert np.abs(np.diff(over, axis=0)).max() < 0.2
    back = np.array([over[-1], *(subject.step(TICK, None).copy() for _ in range(200))])
    assert back[-1] == pytest.approx([4.0, 0.0], abs=1e-6)
    assert np.abs(np.diff(back, axis=0)).max() < 0.2 * 4.0


def test_a_second_fault_meets_the_guard_first() -> None:
    """Q_act has the say for what lasts; what comes suddenly is the guard's."""
    subject = compensator()
    for _ in range(300):
        settled = subject.step(TICK, ACT)
    sudden = subject.step(3.0 * TICK, ACT)
    assert sudden - settled == pytest.approx([8.0, 0.0], abs=0.1)


def test_with_both_faults_the_guard_is_alone_again() -> None:
    subject = compensator()
    for _ in range(300):
        subject.step(TICK, ACT)
    assert [subject.step(TICK, SEN, ACT) for _ in range(100)][-1] == pytest.approx([4.0, 0.0], abs=1e-6)


def test_what_is_there_without_a_fault_is_forgotten_and_stays_so_while_one_is() -> None:
    subject = compensator(washout_s=2.0)
    for _ in range(600):
        forgotten = subject.step(0.1 * TICK, None)
    assert forgotten == pytest.approx([0.0, 0.0], abs=1e-6)
    for _ in range(600):
        fault = subject.step(1.1 * TICK, ACT)
    assert fault == pytest.approx([1.0, 0.0], abs=1e-3)


def test_passive_means_no_q() -> None:
    subject = compensator(accommodate=False)
    assert all(np.array_equal(subject.step(TICK, ACT), np.zeros(2)) for _ in range(20))


def test_a_design_that_does_not_say_what_q_is_bounded_by_is_bounded_by_its_own_answer() -> None:
    """The guard answers a Pa with 2 mrad/s, Q_sen a kelvin of superheat with 1 % of valve: 5 kPa and 0.3 K, times 5."""
    gains = np.zeros((6, 3))
    gains[0, 0], gains[5, 1] = 2e-3, 0.01
    design = CompensatorDesign(np.zeros((1, 1)), np.zeros((1, 3)), np.zeros((6, 1)), gains, 1.0, 0.5, 1e9, 0.1)
    assert design.q_range == pytest.approx([50.0, 0.015])
    stored = {name: np.asarray(getattr(design, name)) for name in CompensatorDesign.__dataclass_fields__}
    del stored["q_range"]
    assert CompensatorDesign.from_arrays(stored).q_range == pytest.approx(design.q_range)


def test_isolation_that_comes_and_goes_is_not_followed_for_a_while() -> None:
    subject = compensator()
    for _ in range(3):
        for fault, ticks in ((ACT, 300), (None, 300)):
            for _ in range(ticks):
                q = subject.step(TICK, fault)
    at_once = [subject.step(TICK, ACT) for _ in range(300)][-1]
    assert q == pytest.approx([4.0, 0.0], abs=1e-3)
    assert at_once == pytest.approx([4.0, 0.0], abs=1e-3), "the guard still has the say"
    for _ in range(12000):
        subject.step(TICK, None)
    assert [subject.step(TICK, ACT) for _ in range(300)][-1] == pytest.approx([1.0, 0.0], abs=1e-3)
