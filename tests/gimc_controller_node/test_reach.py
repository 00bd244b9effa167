"""The gain of q over the references: a margin is left wherever they lead, and nothing is lost where they do not."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ac_common.units import KPA
from ac_design import design_compensator, design_controller, design_fdi
from ac_design.analysis.loop_stability import loop_stability
from ac_design.closed_loop import ROWS, plant_away
from ac_design.reach import MARGIN
from ac_experiments.scenario import check
from ac_experiments.simulate import simulate
from gimc_controller_node import Compensator
from gimc_controller_node.reach import SLOWER_UP, Reach

T, FADE_S = 0.1, 5.0
REST = np.array([250e3, 20.0])
OFFSETS = np.array([[-20e3, 0.0, 20e3], [-5.0, 0.0, 5.0]])
EXCESS = np.array([[0.5, 0.0, 2.0], [0.8, 0.0, 4.0]])


def reach() -> Reach:
    return Reach(REST, OFFSETS, EXCESS, T, FADE_S)


@pytest.mark.parametrize(
    ("kpa", "kelvin", "gain"),
    [(0.0, 0.0, 1.0), (10.0, 1.0, 1.0), (20.0, 0.0, 0.5), (0.0, 2.5, 0.5), (0.0, 5.0, 0.25), (15.0, 9.0, 0.25)],
)
def test_a_run_begins_with_the_gain_of_its_references(kpa: float, kelvin: float, gain: float) -> None:
    assert reach().step(REST[0] + kpa * KPA, REST[1] + kelvin) == pytest.approx(gain)


def test_a_design_that_knows_nothing_of_it_is_not_scaled() -> None:
    subject = Reach(np.empty(0), np.empty((2, 0)), np.empty((2, 0)), T, FADE_S)
    assert subject.step(1e9, 1e9) == 1.0


def test_what_does_not_belong_together_is_refused() -> None:
    with pytest.raises(ValueError, match=r"needed \(2,\), \(2, m\)"):
        Reach(REST, OFFSETS, EXCESS[:, :2], T, FADE_S)


@given(st.lists(st.tuples(st.floats(-1e5, 1e5), st.floats(-20.0, 20.0)), min_size=2, max_size=60))
def test_it_never_jumps_and_stays_between_nothing_and_one(offsets: list[tuple[float, float]]) -> None:
    subject = reach()
    gains = np.array([subject.step(REST[0] + pressure, REST[1] + superheat) for pressure, superheat in offsets])
    assert np.all((gains > 0.0) & (gains <= 1.0))
    moved = np.diff(gains)
    assert moved.min() >= -T / FADE_S - 1e-12
    assert moved.max() <= T / FADE_S / SLOWER_UP + 1e-12


@pytest.mark.parametrize(("point", "kpa", "kelvin"), [("low", 0.0, 5.0), ("med", 0.0, 10.0), ("high", 40.0, 0.0)])
def test_the_margin_that_is_left_is_the_one_that_is_said(point: str, kpa: float, kelvin: float) -> None:
    """By bisection of the loop's poles, where all of q would leave less."""
    compensator = design_compensator(point, T)
    designs = design_fdi(point, T), design_controller(point, T), compensator
    plant = plant_away(point, kpa * KPA, kelvin)
    margin = min(loop_stability(plant, *designs, block).margin for block in ROWS)
    rest = compensator.reference_rest
    subject = Reach(rest, compensator.reach_offsets, compensator.reach_excess, T, FADE_S)
    gain = subject.step(rest[0] + kpa * KPA, rest[1] + kelvin)
    assert margin < MARGIN
    assert MARGIN * 0.99 < margin / gain < MARGIN * 1.25


def step_up_at_low(**more: object) -> dict[bool, np.ndarray]:
    """p_e off its reference [kPa] with K0 alone (True) and with the compensator, under +5 K of superheat."""
    scenario = {"name": "up", "design": "paper", "operating_point": "low", "duration_s": 400.0, **more}
    scenario["references"] = {"superheat_k": [{"at_s": 10.0, "to": 5.0}]}
    off = {}
    for passive in (True, False):
        recording = simulate(check(scenario), passive=passive)
        assert recording.metadata["events"] == []
        series = recording.series
        off[passive] = (series["plant/evaporator_pressure"] - series["reference/evaporator_pressure"]) / KPA
    return off


def test_where_all_of_q_would_not_be_stable_the_loop_is_calm() -> None:
    off = step_up_at_low()[False]
    assert np.abs(off).max() < 4.0  # 18.6 kPa with all of q, which then left by its bounds
    assert np.abs(off[-500:]).max() < 0.1


@pytest.mark.parametrize(
    "fault", [{"kind": "compressor_speed", "size_rpm": 40}, {"kind": "evaporator_pressure", "size_kpa": 5}]
)
def test_a_fault_there_does_no_more_than_with_k0_alone(fault: dict[str, object]) -> None:
    off = step_up_at_low(faults=[{**fault, "onset_s": 200.0}])
    assert np.abs(off[False][2000:]).max() < 1.1 * np.abs(off[True][2000:]).max()


def test_one_that_takes_its_place_goes_on_with_the_gain() -> None:
    design = design_compensator("low", T)
    one, other = Compensator(design), Compensator(design)
    away = (float(design.reference_rest[0]), float(design.reference_rest[1]) + 5.0)
    f_e = np.array([1e3, 0.3, 0.1])
    one.step(f_e, None, reference=(away[0], away[1] - 5.0))
    for _ in range(20):
        one.step(f_e, None, reference=away)
    other.restore(json.loads(json.dumps(one.state())))
    for _ in range(50):
        np.testing.assert_array_equal(one.step(f_e, None, reference=away), other.step(f_e, None, reference=away))
