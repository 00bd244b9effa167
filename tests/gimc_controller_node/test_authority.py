"""The compensator within its bounds: it can never destabilise a loop that K0 alone holds."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from ac_common.units import KPA, RPM
from ac_experiments.designs import designs_at
from ac_experiments.recording import Recording
from ac_experiments.scenario_schema import Scenario
from ac_experiments.simulate import simulate
from gimc_controller_node import Compensator
from gimc_controller_node.authority import (
    FIRST_WAIT_S,
    KEPT_WELL,
    LESS_GAIN,
    LONGER,
    LONGEST_WAIT_S,
    PROBATION,
    Authority,
)
from gimc_controller_node.compensator import OUTSIDE

SAMPLE_TIME_S, FADE_S = 0.1, 5.0
BOUND = np.array([10.0, 0.02])
POINTS = ("low", "med", "high")


def steps(point: str, kpa: float, kelvin: float, air_percent: float = 0.0, **more: object) -> Scenario:
    """Steps of both references and of the air flow, all at once, after 10 s."""
    scenario = {
        "name": "steps",
        "design": "paper",
        "operating_point": point,
        "duration_s": 400.0,
        "references": {
            "evaporator_pressure_kpa": [{"at_s": 10, "to": kpa}],
            "superheat_k": [{"at_s": 10, "to": kelvin}],
        },
        "air": {"mass_flow_percent": [{"at_s": 10, "to": air_percent}]},
    }
    return Scenario.model_validate({**scenario, **more})


def run(point: str, kpa: float, kelvin: float, air_percent: float = 0.0, **more: object) -> dict[bool, Recording]:
    """With K0 alone (True) and with the compensator (False)."""
    scenario = steps(point, kpa, kelvin, air_percent, **more)
    return {passive: simulate(scenario, passive=passive) for passive in (True, False)}


def swing_rpm(recording: Recording, until_s: float | None = None) -> float:
    """How far the compressor still swings in the 50 s before the end, or before another time."""
    end = len(recording.time_s) if until_s is None else round(until_s / SAMPLE_TIME_S)
    window = slice(end - round(50.0 / SAMPLE_TIME_S), end)
    return float(np.ptp(recording.series["controller/command:compressor"][window])) / RPM


def test_what_the_bounds_are_for_is_there() -> None:
    designs = designs_at("low", SAMPLE_TIME_S)
    alone = replace(designs.compensator, q_range=np.full(2, np.inf), reference_rest=np.empty(0))
    free = replace(designs, compensator=alone)
    unbounded = simulate(steps("low", 0.0, 5.0, duration_s=200.0), designs=free)
    assert swing_rpm(unbounded, until_s=90.0) > 100.0  # until the protection has caught it


@pytest.mark.parametrize(
    ("point", "kpa", "kelvin"),
    [
        ("low", 20.0, 0.0),
        ("low", 30.0, 0.0),
        ("low", 0.0, 5.0),
        ("med", 0.0, -10.0),
        ("low", 20.0, -5.0),
        ("low", -40.0, 0.0),
    ],
)
def test_a_step_that_the_guard_could_not_bear_settles_as_with_k0_alone(point: str, kpa: float, kelvin: float) -> None:
    found = run(point, kpa, kelvin, duration_s=600.0)
    alone, subject = swing_rpm(found[True]), swing_rpm(found[False])
    assert alone < 1.0
    assert subject < 1.0
    error = (
        found[False].series["plant/evaporator_pressure"][-1] - found[False].series["reference/evaporator_pressure"][-1]
    )
    assert abs(error) < 1.0 * KPA


@pytest.mark.parametrize("point", POINTS)
def test_random_steps_never_end_in_a_limit_cycle_where_k0_alone_settles(point: str) -> None:
    """One at low, +1.7 kPa, +4.4 K and more air, is where the guard's loop with all of its gain is not stable."""
    random, settled = np.random.default_rng(POINTS.index(point)), 0
    for _ in range(4 if point == "low" else 2):
        kpa, kelvin = random.uniform(-20.0, 20.0), random.uniform(-5.0, 5.0)
        found = run(point, kpa, kelvin, float(random.choice([-10.0, 0.0, 10.0])), duration_s=1000.0)
        if swing_rpm(found[True]) < 2.0:
            settled += 1
            assert swing_rpm(found[False]) < 4.0, f"{point}: {kpa:+.1f} kPa, {kelvin:+.1f} K"
    assert settled > 0, "K0 alone never settled, so nothing was compared"


@pytest.mark.parametrize("point", POINTS)
def test_a_fault_of_four_times_the_design_s_size_is_still_accommodated(point: str) -> None:
    fault = {"kind": "evaporator_pressure", "size_kpa": 20.0, "onset_s": 10.0}
    found = run(point, 0.0, 0.0, faults=[fault])
    pressure = [np.abs(np.diff(recording.series["plant/evaporator_pressure"][[0, -1]])) for recording in found.values()]
    assert pressure[0] > 15.0 * KPA
    assert pressure[1] < 0.5 * KPA


@given(st.lists(st.tuples(st.floats(-1e3, 1e3), st.floats(-1.0, 1.0)), min_size=1, max_size=300))
def test_q_stays_within_its_bounds_keeps_its_direction_and_fades(asked: list[tuple[float, float]]) -> None:
    subject = Authority(BOUND, SAMPLE_TIME_S, FADE_S)
    for speed, valve in asked:
        factor = subject.step(speed, valve)
        assert 0.0 <= factor <= 1.0
        assert factor * abs(speed) <= BOUND[0] * (1.0 + 1e-12)
        assert factor * abs(valve) <= BOUND[1] * (1.0 + 1e-12)


def held(subject: Authority, ratio: float, seconds: float) -> NDArray[np.float64]:
    """Factors on a q of `ratio` times its bound, held."""
    speed = float(ratio * BOUND[0])
    return np.array([subject.step(speed, 0.0) for _ in range(round(seconds / SAMPLE_TIME_S))])


def test_within_its_bounds_q_is_not_touched() -> None:
    assert np.all(held(Authority(BOUND, SAMPLE_TIME_S, FADE_S), 0.999, 100.0) == 1.0)


def test_it_goes_out_over_its_fade_time_and_comes_back_after_a_quiet_while() -> None:
    subject = Authority(BOUND, SAMPLE_TIME_S, FADE_S)
    out = held(subject, 1.001, FADE_S + 0.2)
    assert subject.outside
    assert out[-1] == 0.0
    assert np.abs(np.diff(out)).max() < 1.01 * SAMPLE_TIME_S / FADE_S
    assert np.all(held(subject, 0.3, 2.0 * FIRST_WAIT_S) == 0.0), "beyond a quarter of the bound it stays out"
    assert np.all(held(subject, 0.2, FIRST_WAIT_S - 1.0) == 0.0)
    assert held(subject, 0.2, FADE_S + 2.0)[-1] == LESS_GAIN
    assert not subject.outside


def test_each_time_it_does_not_keep_well_it_stays_away_longer() -> None:
    subject = Authority(BOUND, SAMPLE_TIME_S, FADE_S)
    waits = []
    for ratio in (1.01, *5 * (1.01 * PROBATION,)):
        held(subject, ratio, 1.0)
        ticks = 0
        while subject.outside:
            subject.step(0.0, 0.0)
            ticks += 1
        waits.append(round(ticks * SAMPLE_TIME_S))
        held(subject, 0.1, 20.0)
    assert waits == [min(FIRST_WAIT_S * LONGER**k, LONGEST_WAIT_S) for k in range(6)]
    held(subject, 0.1, KEPT_WELL * waits[-1])
    assert np.all(held(subject, 0.99, 1.0) == 1.0), "the bound is whole again"
    held(subject, 1.01, 1.0)
    assert held(subject, 0.1, FIRST_WAIT_S + FADE_S + 1.0)[-1] == LESS_GAIN, "what was long ago is forgotten"


def test_one_that_takes_its_place_goes_on_where_it_was() -> None:
    design = designs_at("low", SAMPLE_TIME_S).compensator
    one, other = Compensator(design), Compensator(design)
    random = np.random.default_rng(1)
    for size in (3e3, 3e4):
        for f_e in size * random.standard_normal((50, 3)) * [1.0, 3e-4, 3e-4]:
            one.step(f_e, None)
    assert one.does == OUTSIDE
    other.restore(json.loads(json.dumps(one.state())))
    for f_e in 1e2 * random.standard_normal((400, 3)) * [1.0, 3e-4, 3e-4]:
        assert one.step(f_e, None) == pytest.approx(other.step(f_e, None), abs=0.0)
    assert one.does == other.does


@pytest.mark.parametrize("bounds", [[0.0, 1.0], [-1.0, 1.0], [1.0], [np.nan, 1.0]])
def test_bounds_that_are_none_are_refused(bounds: list[float]) -> None:
    with pytest.raises(ValueError, match="two numbers above zero"):
        Authority(np.array(bounds), SAMPLE_TIME_S, FADE_S)
