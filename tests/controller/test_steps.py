"""The controller's and the compensator's steps: limits, anti-windup, fading."""

import numpy as np
import pytest

from gimc_controller_node.compensator import Compensator, CompensatorDesign
from gimc_controller_node.controller import Controller, ControllerDesign


def integrators(rate: float = 0.1, read_back: float = 0.5) -> ControllerDesign:
    """Two integrators in the V~, U~ form: V~^-1 U~ adds `rate * error` a tick, V~'s poles are at `1 - read_back`."""
    return ControllerDesign(
        phi=(1.0 - read_back) * np.eye(2),
        gamma=np.hstack([rate * np.eye(2), read_back * np.eye(2)]),
        c=np.eye(2),
        d=np.zeros((2, 2)),
        command_rest=np.array([100.0, 0.4]),
        command_min=np.zeros(2),
        command_max=np.array([628.0, 1.0]),
        sample_time_s=0.1,
    )


def test_at_rest_the_command_is_the_operating_point_s() -> None:
    controller = Controller(integrators())
    for _ in range(10):
        command = controller.step(np.array([2e5, 20.0]), np.array([2e5, 20.0, 25.0]), np.zeros(2))
        assert command == pytest.approx([100.0, 0.4], abs=1e-12)


def test_the_factored_form_integrates() -> None:
    controller = Controller(integrators(rate=0.1))
    commands = [controller.step(np.array([1.0, 0.0]), np.zeros(3), np.zeros(2)) for _ in range(50)]
    assert np.diff([u[0] for u in commands]) == pytest.approx(0.1, abs=1e-12)


def test_the_command_keeps_its_limits_and_does_not_wind_up() -> None:
    controller = Controller(integrators(rate=10.0))
    pushed = [controller.step(np.array([10.0, 0.0]), np.zeros(3), np.zeros(2)) for _ in range(500)]
    assert pushed[-1][0] == 628.0
    back = [controller.step(np.array([-10.0, 0.0]), np.zeros(3), np.zeros(2)) for _ in range(5)]
    assert back[2][0] < 628.0  # an integrator that had wound up would need hundreds of ticks


def test_q_enters_before_the_inverse_of_v() -> None:
    controller = Controller(integrators(read_back=0.5))
    first = controller.step(np.zeros(2), np.zeros(3), np.array([1.0, 0.0]))
    second = controller.step(np.zeros(2), np.zeros(3), np.zeros(2))
    assert first[0] - 100.0 == pytest.approx(1.0)  # V~^-1 = (z - 0.5) / (z - 1): one, then a half for ever
    assert second[0] - 100.0 == pytest.approx(0.5)


def compensator(accommodate: bool = True) -> Compensator:
    gains = np.zeros((6, 3))
    gains[0, 0], gains[2, 0], gains[5, 0] = 4.0, 1.0, 2.0  # guard, Q_act, Q_sen
    design = CompensatorDesign(np.zeros((1, 1)), np.zeros((1, 3)), np.zeros((6, 1)), gains, 1.0, 0.1)
    return Compensator(design, accommodate)


def test_the_guard_acts_until_a_fault_is_isolated() -> None:
    subject = compensator()
    assert all(subject.step(np.ones(3), None) == pytest.approx([4.0, 0.0]) for _ in range(20))
    assert subject.step(np.zeros(3), None) == pytest.approx([0.0, 0.0])


def test_the_isolated_fault_s_filter_takes_over_in_a_straight_fade() -> None:
    subject = compensator()
    subject.step(np.ones(3), None)
    over = [subject.step(np.ones(3), "compressor_speed") for _ in range(20)]
    assert over[0] == pytest.approx([0.9 * 4.0 + 0.1, 0.0])
    assert over[-1] == pytest.approx([1.0, 0.0])
    changed = [subject.step(np.ones(3), "evaporator_pressure") for _ in range(20)]
    assert changed[4] == pytest.approx([0.5, 1.0])
    assert changed[-1] == pytest.approx([0.0, 2.0])
    assert [subject.step(np.ones(3), None) for _ in range(20)][-1] == pytest.approx([4.0, 0.0])
    assert max(np.abs(np.diff([q[0] for q in over]))) < 0.31  # never a jump


def test_passive_means_no_q() -> None:
    subject = compensator(accommodate=False)
    assert all(np.array_equal(subject.step(np.ones(3), "compressor_speed"), np.zeros(2)) for _ in range(20))
