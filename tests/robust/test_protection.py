"""The plant is not asked for what it cannot do: caps when the evaporator is too cold or the superheat is gone."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bringup.bags.reader import read_bag
from bringup.loop import simulate
from bringup.ros.graph import run_graph
from bringup.scenario import built_in_scenarios, check, load
from gimc_controller_node import Controller, design_controller
from gimc_controller_node.fallback import FallbackController
from gimc_controller_node.protection import COLD, DRY, IDLE, ProtectionLimits, protect, protective_command

T = 0.1
LIMITS = ProtectionLimits()
FINE = (250e3, 20.0)
#: A step of the superheat's reference that takes the superheat away on its way down.
TOO_LOW = {
    "name": "too_low",
    "duration_s": 150.0,
    "references": {"superheat_k": [{"at_s": 1.0, "to": -10.0}]},
}


def after(ticks, state=IDLE):
    for pressure, superheat in ticks:
        state = protect(state, pressure, superheat, LIMITS, T)
    return state


def test_idle_while_all_is_well():
    assert after([FINE] * 100) is IDLE


def test_acts_when_it_is_confirmed_and_until_all_has_been_well_for_a_while():
    assert after([(150e3, 20.0)] * 2).reason == ""  # not for a spike of the noise
    assert after([(150e3, 20.0)] * 4).reason == COLD
    state = after([(250e3, 1.0)] * 4)
    assert state.reason == DRY
    wait = round(LIMITS.release_s / T)
    assert after([FINE] * (wait - 1), state).reason == DRY
    assert after([FINE] * (wait - 1) + [(250e3, 4.0)] + [FINE] * (wait - 1), state).reason == DRY
    assert after([FINE] * (wait + 1), state).reason == ""


def test_waits_longer_when_it_has_to_act_again_and_forgets_in_the_end():
    state, waits = IDLE, []
    for _ in range(6):
        state = after([(250e3, 1.0)] * 4, state)
        ticks = 0
        while state.reason:
            state = after([FINE], state)
            ticks += 1
        waits.append(round(ticks * T))
    assert waits == [10, 20, 40, 80, 160, 160]
    assert after([FINE] * round(LIMITS.forget_s / T + 2), state) is IDLE


@given(st.lists(st.tuples(st.floats(1e5, 4e5), st.floats(-5.0, 40.0)), max_size=80))
def test_acts_for_a_reason_only(ticks):
    state = IDLE
    for pressure, superheat in ticks:
        before, state = state, protect(state, pressure, superheat, LIMITS, T)
        if state.reason and not before.reason:
            assert pressure < LIMITS.lowest_pressure_pa or superheat < LIMITS.lowest_superheat_k
    if all(p >= LIMITS.lowest_pressure_pa and s >= LIMITS.lowest_superheat_k for p, s in ticks):
        assert state is IDLE


@pytest.mark.parametrize(
    "change", [{"lowest_pressure_pa": -1.0}, {"lowest_superheat_k": math.nan}, {"valve_share": 1.5}]
)
def test_limits_that_make_no_sense_are_refused(change):
    with pytest.raises(ValueError, match="protection"):
        ProtectionLimits(**change)


def test_command_moves_in_ramps_and_the_controller_takes_over_without_a_jump():
    design = design_controller("med", T)
    controller = FallbackController(Controller(design))
    reference = np.array([251.2e3, 20.0])
    commands = [controller.step(reference, np.array([251.2e3, 1.0]), np.zeros(2)) for _ in range(100)]
    assert controller.does == DRY
    np.testing.assert_allclose(commands[-1], protective_command(DRY, tuple(design.command_rest), LIMITS))
    rates = np.array([LIMITS.speed_rate_rad_s2, LIMITS.valve_rate_1_s]) * T
    assert np.all(np.abs(np.diff(commands[3:], axis=0)) <= rates + 1e-9)
    back = [controller.step(reference, reference, np.zeros(2)) for _ in range(200)]
    assert controller.does == ""
    assert np.all(np.abs(np.diff([commands[-1], *back], axis=0)) <= rates + 1e-9)


@pytest.mark.parametrize("name", built_in_scenarios())
def test_built_in_scenarios_stay_clear_of_it(name):
    assert simulate(load(name)).metadata["events"] == []


@pytest.mark.ros
def test_protection_is_announced_and_the_same_in_graph_and_simulation(tmp_path: Path) -> None:
    scenario = check(TOO_LOW)
    run = run_graph(scenario, tmp_path)
    recorded, simulated = read_bag(run.bag), simulate(scenario)
    assert recorded.metadata["events"] == simulated.metadata["events"]
    assert recorded.metadata["events"][0]["what"] == DRY
    np.testing.assert_array_equal(
        recorded.series["controller/command:expansion_valve"], simulated.series["controller/command:expansion_valve"]
    )
    assert "superheat too low" in (tmp_path / "log" / "gimc_controller.log").read_text()


def test_protection_ends_the_swinging_of_a_loop_that_lost_its_superheat(monkeypatch):
    with_it = simulate(check(TOO_LOW))
    monkeypatch.setattr("gimc_controller_node.fallback.protect", lambda state, *_: state)
    without = simulate(check(TOO_LOW))
    dry = [np.mean(run.series["plant/superheat"] < 0.5) for run in (with_it, without)]
    assert dry[0] < 0.2 * dry[1]
