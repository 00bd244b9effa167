"""Accommodation over the whole envelope: K0 with q reads the truth, and its speed comes out as commanded."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ac_common.design_file import from_file, to_bytes
from ac_common.units import KPA, RPM
from ac_design import ENVELOPE_CONTROLLER, design_controller
from ac_plant_node import Plant, operating_point
from ac_plant_node.saturation import saturation_temperature
from gimc_controller_node import GimcController
from gimc_controller_node.envelope_compensator import (
    AT_LIMIT,
    HARMFUL,
    EnvelopeCompensator,
    EnvelopeCompensatorDesign,
)

T = 0.1
ACTUATOR, SENSOR = "compressor_speed", "evaporator_pressure"
REFERENCE = np.array([2.5e5, 20.0])
errors = st.lists(st.tuples(st.floats(-5e3, 5e3), st.floats(-3.0, 3.0)), min_size=1, max_size=40)


@pytest.fixture(scope="module")
def design() -> EnvelopeCompensatorDesign:
    return EnvelopeCompensatorDesign(**vars(design_controller("med", T, ENVELOPE_CONTROLLER)), fade_in_s=1e-9)


def compensated(design, errors, f_n, f_p, isolated, also=None):
    """Commands of K0 with q, and of K0 that reads the truth, to which the inverse of f_N is added."""
    k0 = design
    with_q, truth, compensator = GimcController(k0), GimcController(k0), EnvelopeCompensator(design)
    pairs = []
    for error in errors:
        measured = REFERENCE - np.array(error)
        q = compensator.step((f_n, f_p), isolated, also, REFERENCE, measured)
        last = with_q.step(REFERENCE, measured, q)
        with_q.sent(last)
        compensator.commanded(last)
        ideal = truth.step(REFERENCE, measured - np.array([f_p, 0.0]), np.zeros(2))
        truth.sent(ideal)
        pairs.append((last, ideal))
    return np.array(pairs)


@given(errors, st.floats(-15.0, 15.0))
def test_with_a_sensor_fault_k0_reads_the_truth(design, errors, kpa):
    pairs = compensated(design, errors, 0.0, kpa * KPA, SENSOR)
    assert pairs[:, 0] == pytest.approx(pairs[:, 1], rel=1e-6, abs=1e-6)


@given(st.floats(-80.0, 120.0), st.floats(-15.0, 15.0))
def test_a_fault_of_the_speed_is_taken_off_the_command(design, rpm, kpa):
    pairs = compensated(design, [(-kpa * KPA, 0.0)] * 60, rpm * RPM, kpa * KPA, ACTUATOR, SENSOR)
    sent, ideal = pairs[-1]
    assert sent[0] + rpm * RPM == pytest.approx(ideal[0], abs=0.5 * RPM)
    assert sent[1] == pytest.approx(ideal[1], abs=1e-6)


@given(st.floats(-100.0, 100.0), st.floats(-1e4, 1e4), st.sampled_from([None, "unknown"]))
def test_without_a_fault_that_is_known_there_is_no_q(design, f_n, f_p, isolated):
    q = EnvelopeCompensator(design).step((f_n, f_p), isolated, None, REFERENCE, REFERENCE)
    assert not q.any()


def test_it_comes_and_goes_without_a_jump(design):
    slow = replace(design, fade_in_s=0.7)
    compensator, estimates = EnvelopeCompensator(slow), (40.0 * RPM, 0.0)
    coming = [compensator.step(estimates, ACTUATOR, None, REFERENCE, REFERENCE) for _ in range(100)]
    going = [compensator.step(estimates, "unknown", None, REFERENCE, REFERENCE) for _ in range(400)]
    speeds = np.array([np.zeros(2), *coming, *going])[:, 0]
    assert np.abs(np.diff(speeds)).max() < 10.0 * RPM
    assert abs(speeds[-1]) < 1e-2 * np.abs(speeds).max()


def test_a_derived_superheat_is_corrected_with_the_pressure(design):
    derived = EnvelopeCompensator(replace(design, derived=1.0))
    truth, f_p = GimcController(design), 5.0 * KPA
    measured = np.array([2.6e5, 18.0])
    q = derived.step((0.0, f_p), SENSOR, None, REFERENCE, measured)
    actual = measured - [f_p, saturation_temperature(2.6e5 - f_p) - saturation_temperature(2.6e5)]
    with_q = GimcController(design).step(REFERENCE, measured, q)
    assert with_q == pytest.approx(truth.step(REFERENCE, actual, np.zeros(2)), rel=1e-9)


def test_growing_errors_withdraw_it_until_nothing_is_isolated(design):
    compensator = EnvelopeCompensator(design)
    far = REFERENCE - np.array([40.0 * KPA, 10.0])
    for _ in range(600):
        compensator.step((40.0 * RPM, 0.0), ACTUATOR, None, REFERENCE, far)
    assert compensator.does == HARMFUL
    for _ in range(600):  # its name is in doubt for a while
        assert np.abs(compensator.step((40.0 * RPM, 0.0), None, None, REFERENCE, far, True)).max() < 5.0
    compensator.step((40.0 * RPM, 0.0), ACTUATOR, None, REFERENCE, far)
    assert compensator.does == HARMFUL
    compensator.step((0.0, 0.0), None, None, REFERENCE, REFERENCE)
    assert compensator.does == ""


def test_errors_of_k0_alone_withdraw_nothing(design):
    compensator = EnvelopeCompensator(design)
    for _ in range(600):
        compensator.step((40.0 * RPM, 0.0), None, None, REFERENCE, REFERENCE - np.array([40.0 * KPA, 10.0]), True)
    assert compensator.does == ""


@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("stop", ["command_min", "command_max"])
def test_errors_at_a_stop_are_not_its_doing(design, joint, stop):
    compensator = EnvelopeCompensator(design)
    command = design.command_rest.copy()
    command[joint] = getattr(design, stop)[joint]
    far = REFERENCE - np.array([40.0 * KPA, 10.0])
    for _ in range(600):
        compensator.commanded(command)
        compensator.step((0.0, 5.0 * KPA), SENSOR, None, REFERENCE, far)
    assert compensator.does == ""


def test_errors_while_the_protection_caps_the_speed_are_not_its_doing(design):
    """Near the highest condenser pressure nothing holds p_e; before, errors that large withdraw q."""
    for p_c, said in ((2.85e6, ""), (2.5e6, HARMFUL)):
        compensator = EnvelopeCompensator(replace(design, capped_head_pa=2.8e6))
        far = (*(REFERENCE - np.array([40.0 * KPA, 10.0])).tolist(), p_c)
        for _ in range(600):
            compensator.step((0.0, 5.0 * KPA), SENSOR, None, REFERENCE, far)
        assert compensator.does == said
        for _ in range(round(0.9 * design.recover_s / T)):  # the speed comes back slowly
            compensator.step((0.0, 5.0 * KPA), SENSOR, None, REFERENCE, (*far[:2], 2.7e6))
        assert compensator.does == said


def test_without_a_condenser_pressure_it_watches_as_before(design):
    """A superheat, which is then the last reading, is not taken for one."""
    compensator = EnvelopeCompensator(replace(design, capped_head_pa=10.0))
    for _ in range(600):
        compensator.step((0.0, 5.0 * KPA), SENSOR, None, REFERENCE, REFERENCE - np.array([40.0 * KPA, -10.0]))
    assert compensator.does == HARMFUL


def test_a_limit_that_leaves_a_part_of_the_fault_is_announced(design):
    compensator = EnvelopeCompensator(design)
    compensator.commanded(design.command_min)
    compensator.step((80.0 * RPM, 0.0), ACTUATOR, None, REFERENCE, REFERENCE)
    assert compensator.does == AT_LIMIT


@settings(max_examples=20)
@given(errors, errors)
def test_one_that_is_restored_goes_on_bit_by_bit(design, before, after):
    own, other = EnvelopeCompensator(design), EnvelopeCompensator(design)

    def step(which, error):
        return which.step((3.0, 2e3), ACTUATOR, SENSOR, REFERENCE, REFERENCE - np.array(error))

    own.commanded(design.command_rest + np.array([20.0 * RPM, 0.0]))
    for error in before:
        step(own, error)
    other.restore(json.loads(json.dumps(own.state())))
    assert all(np.array_equal(step(own, error), step(other, error)) for error in after)


def test_a_state_of_something_else_is_refused(design):
    with pytest.raises(ValueError, match="not the state"):
        EnvelopeCompensator(design).restore({"_state": [1.0]})


def test_a_design_survives_its_file(design, tmp_path):
    file = tmp_path / "compensator.npz"
    file.write_bytes(to_bytes(design))
    again = from_file(EnvelopeCompensatorDesign, str(file), T)
    assert all(np.array_equal(value, getattr(again, name)) for name, value in vars(design).items())


@pytest.mark.parametrize("point", ["low", "med", "high"])
def test_both_faults_are_taken_back_on_the_plant(design, point):
    op, k0 = operating_point(point), GimcController(design)
    plant, compensator = Plant.at(point), EnvelopeCompensator(replace(design, fade_in_s=0.7))
    f_n, f_p, reference = 40.0 * RPM, 5.0 * KPA, np.array(op.outputs[:2])
    k0.warm_restart(op.inputs[:2], reference, reference)
    outputs, command = op.outputs, np.array(op.inputs[:2])
    for _ in range(1200):
        measured = outputs[:2] + np.array([f_p, 0.0])
        q = compensator.step((f_n, f_p), ACTUATOR, SENSOR, reference, measured)
        command = k0.step(reference, measured, q)
        k0.sent(command)
        compensator.commanded(command)
        outputs = plant.step(np.array([command[0] + f_n, command[1], *op.inputs[2:]]), T)
    assert outputs[0] == pytest.approx(reference[0], abs=0.01 * KPA)
    assert outputs[1] == pytest.approx(reference[1], abs=0.01)
    assert (command[0] - op.inputs[0]) / RPM == pytest.approx(-40.0, abs=0.1)
