"""Observer and decision in a loop: consistent when healthy, right about faults, never lost."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ac_common.design_file import from_file, to_bytes
from ac_common.errors import UserError
from ac_common.units import KPA, RPM
from ac_design.envelope import design_envelope_fdi
from ac_plant_node.properties.tables import P_MIN_PA
from fdi_node.envelope import EnvelopeDesign, EnvelopeDetector
from tests.fdi_node.envelope.loops import Loop, design


@pytest.mark.parametrize("point", ["low", "med", "high"])
def test_innovations_of_a_healthy_plant_are_as_large_as_the_filter_says(point: str) -> None:
    loop, white = Loop(point), []
    for said in loop.run(60.0):
        assert not said.detected
        white.append(loop.detector.memory.white.copy())
    rms = np.sqrt((np.array(white[100:]) ** 2).mean(axis=0))
    assert (rms > 0.8).all()
    assert (rms < 1.15).all()


def test_air_flow_that_nobody_measures_is_estimated_and_is_no_fault() -> None:
    loop = Loop("med")
    for _ in loop.run(30.0):
        pass
    loop.inputs[2] *= 0.7
    assert not any(said.isolated for said in loop.run(60.0))
    assert np.exp(loop.detector.memory.x[2]) == pytest.approx(0.7, rel=0.05)


@pytest.mark.parametrize("rpm", [40.0, -40.0])
def test_compressor_fault_is_isolated_with_its_size(rpm: float) -> None:
    loop = Loop("med")
    list(loop.run(30.0))
    said = list(loop.run(15.0, speed_fault=rpm * RPM))
    assert {one.isolated for one in said} == {None, "compressor_speed"}
    assert said[-1].size / RPM == pytest.approx(rpm, abs=4.0)
    assert said[-1].onset_s == pytest.approx(30.0, abs=2.0)


@pytest.mark.parametrize("kpa", [5.0, -15.0])
def test_jump_of_the_pressure_sensor_shows_as_nothing_else(kpa: float) -> None:
    loop = Loop("med")
    list(loop.run(30.0))
    said = list(loop.run(5.0, reading_fault=(kpa * KPA, 0.0, 0.0, 0.0)))
    assert {one.isolated for one in said} - {None} == {"evaporator_pressure"}
    assert said[9].isolated == "evaporator_pressure"
    assert said[-1].size / KPA == pytest.approx(kpa, abs=0.3)
    assert max(abs(one.residual[0]) for one in said) < 3.0 * RPM


def test_a_step_of_the_blower_leaves_what_was_told_of_a_small_fault() -> None:
    loop = Loop("low")
    list(loop.run(30.0))
    m, fault = loop.detector.memory, (0.4 * KPA, 0.0, 0.0, 0.0)
    list(loop.run(4.0, reading_fault=fault))
    before = m.ratios[1]
    loop.inputs[2] *= 1.3
    said = list(loop.run(2.0, reading_fault=fault))
    assert not any(one.isolated for one in said)
    assert m.x[2] == pytest.approx(np.log(1.3), abs=0.15)
    assert m.ratios[1] > 0.8 * before > 0.0
    assert list(loop.run(40.0, reading_fault=fault))[-1].isolated == "evaporator_pressure"


def test_fault_that_goes_away_is_over_and_leaves_nothing_behind() -> None:
    loop = Loop("med")
    list(loop.run(30.0))
    list(loop.run(10.0, reading_fault=(5.0 * KPA, 0.0, 0.0, 0.0)))
    after = list(loop.run(40.0))
    assert after[-1].isolated is None
    assert not after[-1].detected
    assert abs(after[-1].residual[1]) < 0.1 * KPA


@pytest.mark.parametrize("fault", [(0.0, 3.0, 0.0, 0.0), (0.0, 0.0, -2.0, 0.0)])
def test_jump_of_another_sensor_is_unknown(fault: tuple[float, ...]) -> None:
    loop = Loop("med")
    list(loop.run(30.0))
    assert {one.isolated for one in loop.run(10.0, reading_fault=fault)} == {None, "unknown"}


def test_state_makes_a_detector_that_goes_on_bit_by_bit() -> None:
    loop = Loop("high")
    list(loop.run(22.0))
    list(loop.run(3.0, reading_fault=(5.0 * KPA, 0.0, 0.0, 0.0)))
    other = EnvelopeDetector(design())
    other.restore(json.loads(json.dumps(loop.detector.state())))
    twin = Loop("high")
    twin.detector, twin.plant, twin.tick = other, loop.plant.copy(), loop.tick
    twin._noise.bit_generator.state = loop._noise.bit_generator.state
    ours, theirs = list(loop.run(10.0)), list(twin.run(10.0))
    assert repr(ours) == repr(theirs)
    assert loop.detector.state() == twin.detector.state()


@pytest.mark.parametrize("spoil", [{"memory": [1.0]}, {"told": None}, {"decision": {}}])
def test_what_is_no_state_is_refused_and_changes_nothing(spoil: dict[str, Any]) -> None:
    loop = Loop("med")
    list(loop.run(2.0))
    before = loop.detector.state()
    with pytest.raises(ValueError, match="not the state of such a detector"):
        loop.detector.restore(before | spoil)
    assert loop.detector.state() == before


def test_one_that_begins_anew_keeps_what_is_isolated_and_nothing_that_only_seemed_likely() -> None:
    loop, fault = Loop("med"), (5.0 * KPA, 0.0, 0.0, 0.0)
    list(loop.run(30.0))
    list(loop.run(5.0, reading_fault=fault))
    o = loop.plant.outputs
    now = np.array([o.evaporator_pressure_pa, o.superheat_k, o.wall_temperature_c, o.condenser_pressure_pa]) + fault
    loop.detector.warm_restart(now, float(loop.inputs[3]), float(loop.inputs[5]), loop.command)
    said = list(loop.run(60.0, reading_fault=fault))
    assert {one.isolated for one in said} == {"evaporator_pressure"}
    assert max(abs(one.residual[1] - 5.0 * KPA) for one in said[50:]) < 0.5 * KPA

    healthy = Loop("med")
    list(healthy.run(30.0))
    healthy.detector._decision.since.certain = 20.0
    o = healthy.plant.outputs
    now = np.array([o.evaporator_pressure_pa, o.superheat_k, o.wall_temperature_c, o.condenser_pressure_pa])
    healthy.detector.warm_restart(now, float(healthy.inputs[3]), float(healthy.inputs[5]), healthy.command)
    assert not any(one.detected for one in healthy.run(30.0))


@pytest.mark.parametrize("missed", [None, 5, 50])
def test_ticks_that_were_missed_are_no_fault(missed: int | None) -> None:
    loop = Loop("med")
    list(loop.run(30.0))
    for _ in range(missed or 20):
        loop.plant.step(loop.inputs, 0.1)
        loop.tick += 1
    o = loop.plant.outputs
    now = (o.evaporator_pressure_pa, o.superheat_k, o.wall_temperature_c, o.condenser_pressure_pa)
    loop.detector.warm_restart(now, float(loop.inputs[3]), float(loop.inputs[5]), loop.command, missed)
    assert not any(said.isolated for said in loop.run(60.0))


levels = st.tuples(
    st.floats(0.0, 6000.0), st.floats(0.0, 1.0), st.floats(0.02, 0.3), st.floats(10.0, 65.0), st.floats(0.1, 1.5),
    st.floats(0.0, 50.0),
)  # fmt: skip
garbage = st.tuples(*(st.floats(-size, size) for size in (4e5, 60.0, 60.0, 3e6)))


@given(st.lists(st.tuples(levels, st.integers(1, 80), st.none() | garbage), min_size=1, max_size=6))
@settings(max_examples=15, deadline=None)
def test_nothing_that_comes_in_makes_the_observer_leave_or_diverge(
    story: list[tuple[tuple[float, ...], int, tuple[float, ...] | None]],
) -> None:
    loop = Loop("med")
    for (speed, opening, *air), ticks, fault in story:
        loop.command = np.array([speed * RPM, opening])
        loop.inputs[2:6] = air
        for _ in range(ticks):
            loop.step(reading_fault=fault or (0.0, 0.0, 0.0, 0.0))
        m = loop.detector.memory
        assert np.isfinite(loop.detector._flat[np.arange(len(loop.detector._flat)) > len(m.work)]).all()
        assert P_MIN_PA < m.out[0] < 3e6
        assert P_MIN_PA < m.out[3] < 5e6
        assert (np.diag(m.P) >= -1e-12).all()
        assert (np.diag(m.P) <= 101.0).all()


def test_the_papers_three_sensors_are_enough_for_large_faults() -> None:
    loop = Loop("med", sensors=("p_e", "superheat", "T_w"))
    list(loop.run(30.0))
    assert {said.isolated for said in loop.run(15.0, speed_fault=40.0 * RPM)} == {None, "compressor_speed"}


def test_a_known_blower_needs_no_estimate() -> None:
    """Of air that is turned down by a third nothing is left to explain, unless nobody tells."""
    left = {}
    for air_flow in ("none", "blower"):
        loop = Loop("med", air_flow=air_flow)
        list(loop.run(20.0))
        loop.inputs[2] *= 0.67
        assert not any(said.isolated for said in loop.run(60.0))
        left[air_flow] = abs(loop.detector.memory.x[2])
    assert left["blower"] < 0.01
    assert left["none"] == pytest.approx(-np.log(0.67), abs=0.05)


def test_a_design_travels_in_a_file(tmp_path: Path) -> None:
    file = tmp_path / "fdi.npz"
    file.write_bytes(to_bytes(design()))
    again = from_file(EnvelopeDesign, str(file), 0.1)
    for name in EnvelopeDesign.__dataclass_fields__:
        assert np.array_equal(getattr(again, name), getattr(design(), name))


@pytest.mark.parametrize(
    "wrong",
    [
        {"sensors": ("p_e",)},
        {"sensors": ("p_e", "superheat", "T_x")},
        {"sample_time_s": 1.0},
        {"air_flow": "fan"},
    ],
)
def test_a_design_that_there_is_not_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(UserError):
        design_envelope_fdi(**{"sample_time_s": 0.1} | wrong)
