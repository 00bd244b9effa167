"""The plant is not asked for what it cannot do: caps when the evaporator is too cold or the superheat is gone."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ac_common.units import RPM
from ac_design import design_controller
from ac_experiments.bags.reader import read_bag
from ac_experiments.scenario import built_in_scenarios, check, load
from ac_experiments.scenario_schema import Scenario
from ac_experiments.simulate import simulate
from bringup.launch.launch import run_graph
from gimc_controller_node import limited_k0
from gimc_controller_node.fallback import FallbackController
from gimc_controller_node.protection import COLD, DRY, HIGH, IDLE, UP, ProtectionLimits, limits_for, protect

T = 0.1
LIMITS = ProtectionLimits()
FINE = (250e3, 20.0, 1.3e6)
COMMAND = (2000.0 * RPM, 0.4)
LOWEST = LIMITS.lowest_reference


def after(ticks, state=IDLE, command=COMMAND):
    for measured in ticks:
        state = protect(state, measured, command, LIMITS, T)
    return state


def disturbed(**what: object) -> Scenario:
    return check({"name": "disturbed", "design": "paper", "duration_s": 150.0, **what})


def air_flow(percent: float, point: str) -> Scenario:
    return disturbed(operating_point=point, air={"mass_flow_percent": [{"at_s": 1.0, "to": percent}]})


#: Air flow that is nearly lost, which takes the superheat away.
LITTLE_AIR = air_flow(-80.0, "med")


def test_idle_while_all_is_well():
    assert after([FINE] * 100) is IDLE


def test_caps_what_helps_when_it_is_confirmed():
    assert after([(150e3, 20.0, 1.3e6)] * 2).reason == ""  # not for a spike of the noise
    ticks = [(150e3, 20.0, 1.3e6), (250e3, 1.0, 1.3e6), (250e3, 20.0, 2.95e6)]
    cold, dry, high = (after([measured] * 3) for measured in ticks)
    assert (cold.reason, dry.reason, high.reason) == (COLD, DRY, HIGH)
    assert cold.fastest == high.fastest == pytest.approx(COMMAND[0] - LIMITS.speed_rate_rad_s2 * T)
    assert dry.opening.value == pytest.approx(COMMAND[1] - LIMITS.opening_rate_1_s * T)
    assert cold.opening.value == high.opening.value == dry.fastest == math.inf
    assert after([(150e3, 1.0, 1.3e6)] * 3).reason == f"{COLD}; {DRY}"
    assert after([(150e3, 1.0, 2.95e6)] * 3).reason == f"{COLD}; {HIGH}; {DRY}"
    assert after([(150e3, 20.0, 2.95e6)] * 30).fastest == after([(150e3, 20.0, 1.3e6)] * 30).fastest


def test_a_condenser_pressure_that_is_not_measured_caps_nothing():
    assert after([(*FINE[:2], 0.0)] * 10) is IDLE
    assert limits_for(has_belt=False, measures_head=True) == LIMITS
    for has_belt, measures_head in ((True, True), (True, False), (False, False)):
        limits = limits_for(has_belt=has_belt, measures_head=measures_head)
        assert protect(IDLE, (*FINE[:2], 4.0e6), COMMAND, limits, T) is IDLE
        cold = protect(IDLE, (100e3, *FINE[1:]), COMMAND, limits, T)
        assert (cold is IDLE) == has_belt


def test_cap_comes_down_to_a_least_value_stands_and_goes_up_slowly():
    low = after([(250e3, 1.0, 1.3e6)] * 1000)
    assert low.opening.value == LIMITS.least_opening
    between = (250e3, LIMITS.lowest_superheat_k + 0.5 * LIMITS.superheat_margin_k, 1.3e6)
    assert after([between] * 100, low).opening.value == LIMITS.least_opening
    up = after([FINE] * 100, low)
    assert up.opening.value - low.opening.value == pytest.approx(UP * LIMITS.opening_rate_1_s * 100 * T)


def test_cap_is_gone_when_the_command_has_been_below_it_for_a_while():
    state, wait = after([(250e3, 1.0, 1.3e6)] * 4), round(LIMITS.release_s / T)
    lower = (COMMAND[0], 0.2)
    assert after([FINE] * wait, state, lower).reason == DRY
    assert after([FINE] * (wait + 2), state, lower) is IDLE
    assert after([(250e3, 1.0, 1.3e6)] * 3 * wait, state, (COMMAND[0], LIMITS.least_opening)).reason == DRY


def test_never_asks_for_more_than_the_command_was():
    stopped = after([(150e3, 1.0, 2.95e6)] * 50, command=(0.0, 0.0))
    assert (stopped.fastest, stopped.opening.value) == (0.0, 0.0)


@given(st.lists(st.tuples(st.floats(1e5, 4e5), st.floats(-5.0, 40.0), st.floats(1e6, 3.3e6)), max_size=80))
def test_acts_for_a_reason_only(ticks):
    state = IDLE
    for measured in ticks:
        before, state = state, protect(state, measured, COMMAND, LIMITS, T)
        pressure, superheat, head = measured
        if state.head.value < before.head.value:
            assert head > LIMITS.highest_head_pa
        if state.speed.value < before.speed.value:
            assert pressure < LIMITS.lowest_pressure_pa
        if state.opening.value < before.opening.value:
            assert superheat < LIMITS.lowest_superheat_k
    lowest = (LIMITS.lowest_pressure_pa, LIMITS.lowest_superheat_k)
    if all(p >= lowest[0] and s >= lowest[1] and c <= LIMITS.highest_head_pa for p, s, c in ticks):
        assert state is IDLE


@pytest.mark.parametrize(
    "change", [{"lowest_pressure_pa": -1.0}, {"lowest_superheat_k": math.nan}, {"least_opening": math.inf}]
)
def test_limits_that_make_no_sense_are_refused(change):
    with pytest.raises(ValueError, match="protection"):
        ProtectionLimits(**change)


def test_controller_keeps_below_the_caps_and_goes_on_from_there_without_a_jump():
    design = design_controller("med", T)
    controller = FallbackController(limited_k0(design))
    reference = np.array([251.2e3, 20.0])
    dry = np.array([251.2e3, 1.0])
    for _ in range(300):  # a q that would open the valve wide
        command = controller.step(reference, dry, np.array([0.0, 1.0]))
        assert command[1] <= controller.protection.opening.value
    assert controller.does == DRY
    assert command[1] == controller.protection.opening.value == LIMITS.least_opening
    back = [controller.step(reference, reference, np.zeros(2)) for _ in range(600)]
    assert controller.does == ""
    assert np.all(np.abs(np.diff([command, *back], axis=0)) <= design.command_rate * T + 1e-9)


def test_reference_that_the_plant_must_not_be_asked_for_is_raised_and_announced():
    design = design_controller("med", T)
    controllers = [FallbackController(limited_k0(design)) for _ in range(2)]
    for change in ((-1e3, -1.0), (1e3, -1.0), (-1e3, 1.0)):
        reference = np.add(LOWEST, change)
        raised = [
            one.step(r, np.array(FINE), np.zeros(2))
            for one, r in zip(controllers, (reference, np.maximum(reference, LOWEST)), strict=True)
        ]
        np.testing.assert_array_equal(*raised)
        assert controllers[0].does == "reference too low: raised to 175 kPa, 8 K at least"
        assert controllers[1].does == ""


@pytest.mark.parametrize("name", built_in_scenarios())
def test_built_in_scenarios_stay_clear_of_it(name, tmp_path):
    drive = tmp_path / "drive.csv"
    drive.write_text("".join(f"{k},{54.8 * np.sin(0.05 * k) ** 2:.1f}\n" for k in range(601)))
    files = {"sc03": "car.drive_cycle", "sc03_ram_air": "air.drive_cycle.file"}
    overrides = [f"{files[name]}={drive}"] if name in files else []
    events = simulate(load(name, overrides)).metadata["events"]
    said = {event["what"] for event in events}
    assert (HIGH in said) if name == "idle_in_the_heat" else not said


@pytest.mark.ros
def test_protection_is_announced_and_the_same_in_graph_and_simulation(tmp_path: Path) -> None:
    run = run_graph(LITTLE_AIR, tmp_path)
    recorded, simulated = read_bag(run.bag), simulate(LITTLE_AIR)
    assert recorded.metadata["events"] == simulated.metadata["events"]
    assert DRY in [event["what"] for event in recorded.metadata["events"]]
    np.testing.assert_array_equal(
        recorded.series["controller/command:expansion_valve"], simulated.series["controller/command:expansion_valve"]
    )
    assert "superheat too low" in (tmp_path / "log" / "gimc_controller.log").read_text()


@pytest.mark.parametrize("kpa", [90.0, -90.0])
def test_a_large_step_of_the_reference_needs_no_protection(kpa):
    """Which is the governor's doing: without it +90 kPa takes the superheat away for some seconds."""
    step = disturbed(references={"evaporator_pressure_kpa": [{"at_s": 1.0, "to": kpa}]})
    whats = [event["what"] for event in simulate(step).metadata["events"] if event["node"] == "gimc_controller"]
    assert not [what for what in whats if COLD in what or DRY in what]


def dry_shares(scenario: Scenario, monkeypatch: pytest.MonkeyPatch) -> tuple[float, float]:
    """Share of the time below the lowest superheat, with the protection and without it."""
    with_it = simulate(scenario)
    monkeypatch.setattr("gimc_controller_node.fallback.protect", lambda state, *_: state)
    without = simulate(scenario)
    first, second = (np.mean(run.series["plant/superheat"] < LIMITS.lowest_superheat_k) for run in (with_it, without))
    return float(first), float(second)


@pytest.mark.parametrize("point", ["med", "high"])
def test_less_liquid_to_the_compressor_when_the_air_flow_is_nearly_lost(point, monkeypatch):
    with_it, without = dry_shares(air_flow(-80.0, point), monkeypatch)
    assert with_it < 0.6 * without


@pytest.mark.parametrize(
    "scenario",
    [
        air_flow(-60.0, "high"),
        disturbed(faults=[{"kind": "evaporator_pressure", "onset_s": 1.0, "size_kpa": 80.0}]),
        disturbed(operating_point="low", faults=[{"kind": "evaporator_pressure", "onset_s": 1.0, "size_kpa": 80.0}]),
    ],
    ids=["air flow", "fault at med", "fault at low"],
)
def test_protection_costs_little_where_the_controller_would_do_without(scenario, monkeypatch):
    """A second of 150: a valve that is closed further than K0 would also keeps p_e up, and the superheat down."""
    with_it, without = dry_shares(scenario, monkeypatch)
    assert 0.0 < with_it <= without + 1.1 / 150.0
