"""Campaigns: what a seed picks, what a message suffers, how promises are judged, and one seed through the graph."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ac_common.health import Restart
from ac_common.topics import BY_NAME, COMPENSATOR, CONTROLLER, FDI, RECORDER
from ac_experiments.campaign.checks import CHECKS, REASONS, Evidence, Limits, judge
from ac_experiments.campaign.message_faults import LATEST_S, Delivery, with_faults
from ac_experiments.campaign.plan import (
    APART_S,
    END_S,
    MESSAGE_FAULTS,
    START_S,
    VICTIMS,
    MessageFault,
    Plan,
    ProcessFault,
    plan,
)
from ac_ros_common.messages import BadMessage, message_class, message_reader

PRESSURE, COMMAND = "measured/evaporator_pressure", "actuator/command"

# ------------------------------------------------------------------------------------------------------ what is picked


@settings(deadline=None)
@given(seed=st.integers(0, 2**31 - 1), duration_s=st.floats(12.0, 60.0))
@example(seed=199059, duration_s=52.875)  # a fault that rounding would put behind the last moment for one
def test_a_seed_always_picks_the_same_and_what_it_picks_can_be_run(seed: int, duration_s: float) -> None:
    chosen = plan(seed, duration_s)
    assert chosen == plan(seed, duration_s)
    times = [fault.at_s for fault in chosen.processes]
    assert all(after - before >= APART_S - 0.1 for before, after in itertools.pairwise(times))
    assert all(START_S <= time_s <= duration_s - END_S for time_s in times)
    nodes = [fault.node for fault in chosen.processes]
    assert len(set(nodes)) == len(nodes)
    assert chosen.messages
    assert len(chosen.lines()) == len(chosen.scenario.faults) + len(chosen.processes) + len(chosen.messages)


def test_many_seeds_reach_every_kind_of_fault() -> None:
    plans = [plan(seed) for seed in range(60)]
    assert {fault.node for chosen in plans for fault in chosen.processes} == set(VICTIMS)
    assert {fault.kind for chosen in plans for fault in chosen.processes} == {"kill", "stop"}
    assert {fault.kind for chosen in plans for fault in chosen.messages} == set(MESSAGE_FAULTS)
    assert {fault.kind for chosen in plans for fault in chosen.scenario.faults} == {
        "compressor_speed",
        "evaporator_pressure",
    }


# --------------------------------------------------------------------------------------------- what a message suffers


def suffer(
    kind: str, topic: str = PRESSURE, time_s: float = 5.0, values: tuple[float, ...] = (2.5e5,)
) -> list[Delivery]:
    return with_faults([MessageFault(kind, 1.0, 4.0, 6.0)], 1, topic, time_s, values)  # type: ignore[arg-type]


def test_each_fault_does_what_it_says() -> None:
    assert suffer("lost") == []
    assert suffer("twice") == [Delivery(0.0, (2.5e5,))] * 2
    (late,) = suffer("late")
    assert 0.0 < late.delay_s <= LATEST_S
    assert late.values == (2.5e5,)
    assert math.isnan(suffer("nan")[0].values[0])
    assert suffer("wrong_unit")[0].values == (250.0,)
    np.testing.assert_allclose(suffer("wrong_unit", "measured/superheat", values=(20.0,))[0].values, [293.15])
    np.testing.assert_allclose(suffer("wrong_unit", COMMAND, values=(100.0, 0.4))[0].values, [100 * 30 / np.pi, 40.0])


@pytest.mark.parametrize("kind", MESSAGE_FAULTS)
def test_nothing_suffers_outside_its_time(kind: str) -> None:
    for time_s in (3.9, 6.0):
        assert suffer(kind, time_s=time_s) == [Delivery(0.0, (2.5e5,))]


@pytest.mark.parametrize("kind", ["nan", "wrong_unit", "out_of_range"])
@pytest.mark.parametrize(("topic", "values"), [(PRESSURE, (2.5e5,)), (COMMAND, (100.0, 0.4))])
def test_spoiled_values_are_such_as_a_node_refuses(kind: str, topic: str, values: tuple[float, ...]) -> None:
    (delivery,) = suffer(kind, topic, values=values)
    described = BY_NAME[topic]
    message = message_class(described.type)()
    if described.joints:
        message.name = list(described.joints)
        message.velocity, message.position = [delivery.values[0], math.nan], [math.nan, delivery.values[1]]
        message.effort = [math.nan, math.nan]
    else:
        message.fluid_pressure = delivery.values[0]
    with pytest.raises(BadMessage) as refused:
        message_reader(described)(message)
    assert refused.value.reason == REASONS[kind]  # type: ignore[index]


@given(share=st.floats(0.05, 0.95), seed=st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_the_share_that_suffers_is_the_one_asked_for(share: float, seed: int) -> None:
    faults = [MessageFault("lost", share, 0.0, 1000.0)]
    kept = sum(bool(with_faults(faults, seed, PRESSURE, 0.1 * k, (1.0,))) for k in range(2000))
    assert abs(kept / 2000 - (1.0 - share)) < 0.06


# ------------------------------------------------------------------------------------------------ how it is judged

LIMITS = Limits(np.array([0.0, 0.0]), np.array([600.0, 1.0]), np.array([5.0, 0.01]))
KILLED = ProcessFault(4.0, FDI, "kill")


def good(processes: tuple[ProcessFault, ...] = (KILLED,)) -> Evidence:
    """A run of 20 s in which all went well."""
    chosen = plan(0, 20.0)
    chosen = Plan(0, chosen.scenario, processes, (MessageFault("nan", 0.1, 1.0, 3.0),))
    return Evidence(
        plan=chosen,
        problem="",
        ticks=200,
        command=np.tile([100.0, 0.4], (200, 1)),
        command_s=np.arange(200) * 0.1,
        pressure_kpa=np.full(200, 250.0),
        superheat_k=np.full(200, 20.0),
        restarts=[Restart(fault.node, fault.at_s, "SIGKILL", fault.at_s + 1.5) for fault in processes],
        rejected={FDI: {"not finite": 3}},
        limits=LIMITS,
        stand_ins=[(k + 0.5, COMPENSATOR, 10 * k, min(10 * k, 30)) for k in range(20)],
    )


def broken(evidence: Evidence) -> list[str]:
    return [verdict.promise for verdict in judge(evidence) if verdict.kept is False]


def test_a_run_in_which_all_went_well_breaks_no_promise() -> None:
    assert broken(good()) == []
    assert all(verdict.kept for verdict in judge(good()))
    assert broken(good(())) == []


def without(evidence: Evidence, *ticks: int) -> Evidence:
    keep = ~np.isin(np.arange(200), ticks)
    return replace(evidence, command=evidence.command[keep], command_s=evidence.command_s[keep])


def changed(values: np.ndarray, tick: int, value: object) -> np.ndarray:
    result = values.copy()
    result[tick] = value
    return result


def test_every_promise_can_be_broken() -> None:
    run = good()
    restart = run.restarts[0]
    cases = {
        "the run goes on to its end": replace(run, problem="node fdi died"),
        "killed nodes come back": replace(run, restarts=[replace(restart, back_s=math.nan)]),
        "back within 3 s": replace(run, restarts=[replace(restart, back_s=7.5)]),
        "no other node dies": replace(run, restarts=[restart, Restart("compensator", 5.0, "exit code 1", 6.0)]),
        "no nan on controller/command": replace(run, command=changed(run.command, 9, math.nan)),
        "commands within their limits": replace(run, command=run.command - [0.0, 0.401]),
        "no jump of the command": replace(run, command=changed(run.command, 9, [105.1, 0.4])),
        "no command is missed": without(run, 45),
        "bad messages are refused": replace(run, rejected={FDI: {"stale": 9, "out of range": 2}}),
        "the plant stays safe": replace(run, superheat_k=changed(run.superheat_k, 9, -0.1)),
        "the bag is complete": replace(run, pressure_kpa=changed(run.pressure_kpa, 9, math.nan)),
        "in step again at the end": replace(run, stand_ins=[(1.0 * k, CONTROLLER, 10 * k, 9 * k) for k in range(20)]),
        "nothing is left running": replace(run, left=["fdi"]),
    }
    assert len(cases) == len(CHECKS)
    for promise, evidence in cases.items():
        assert promise in broken(evidence), promise
        assert len(broken(evidence)) == 1, (promise, broken(evidence))


def test_a_tick_that_the_plant_tells_as_missed_is_not_lost() -> None:
    silent = replace(without(good(), 90), pressure_kpa=changed(good().pressure_kpa, 90, math.nan))
    assert broken(silent) == ["the bag is complete"]
    assert broken(replace(silent, told={90})) == []


def test_commands_may_be_missing_only_around_the_death_of_who_sends_or_records_them() -> None:
    for node in (CONTROLLER, RECORDER):
        run = good((ProcessFault(4.0, node, "kill"),))
        assert broken(without(run, 42, 50)) == []
        assert "no command is missed" in broken(without(run, 42, 120))
    assert broken(without(good((ProcessFault(4.0, FDI, "kill"),)), 42)) == ["no command is missed"]


def test_a_jump_across_a_gap_may_be_as_large_as_the_gap_is_long() -> None:
    run = good((ProcessFault(4.0, CONTROLLER, "kill"),))
    ahead = run.command + np.where(np.arange(200)[:, None] >= 50, [20.0, 0.0], 0.0)
    assert "no jump of the command" in broken(replace(run, command=ahead))
    assert broken(without(replace(run, command=ahead), *range(46, 50))) == []


def test_a_lag_that_stays_behind_is_seen() -> None:
    def ended(*rows: tuple[float, str, int, int]) -> bool | None:
        run = replace(good(()), stand_ins=rows)
        (verdict,) = (v for v in judge(run) if v.promise == "in step again at the end")
        return verdict.kept

    assert ended() is None
    # Messages suffer until 3 s: what was missing by then does not count.
    calm = [(2.0, COMPENSATOR, 20, 0), (5.0, COMPENSATOR, 50, 25), (19.0, COMPENSATOR, 190, 26)]
    assert ended(*calm) is True
    assert ended(*calm, (19.5, COMPENSATOR, 195, 171), (20.5, COMPENSATOR, 205, 205)) is False
    assert ended((18.9, CONTROLLER, 189, 0), (19.2, CONTROLLER, 192, 3)) is None  # too short to tell


def test_a_command_that_is_missing_while_the_machine_stood_still_is_told_and_not_held_against_the_graph() -> None:
    run = without(good(()), 42)
    assert broken(run) == ["no command is missed"]
    assert broken(replace(run, stalls=[(4.1, 4.11)])) == ["no command is missed"]  # too short to cost a tick
    stood_still = replace(run, stalls=[(4.15, 4.25)])
    assert broken(stood_still) == []
    assert [v.seen for v in judge(stood_still) if v.promise == "no command is missed"] == [
        "1 while the machine stood still"
    ]
    assert broken(replace(run, stalls=[(9.0, 9.5)])) == ["no command is missed"]
