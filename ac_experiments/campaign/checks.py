"""The promises of the graph, judged over what a run of a campaign has left: pure functions over recorded data."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ac_common.health import Restart
from ac_common.topics import COMPENSATOR, CONTROLLER, FDI, INJECTOR, PLANT, RECORDER
from ac_experiments.campaign.plan import MessageFaultKind, Plan, ProcessFault

#: A node that was killed is back in service within this, s.
BACK_WITHIN_S = 3.0
#: What the recorder may lose when it is killed, s: what it had not flushed.
UNFLUSHED_S = 0.5
#: How long after the end of a process fault its effects may last, s: restart, discovery, the loop's own hold.
AFTERMATH_S = 4.0
#: How far before its planned time a fault may show in the recording (what was in the recorder's hands), s.
BEFORE_S = 1.0
#: How long after the last fault the loop may take to be in step again, s; over how many ticks that is then looked at at
#: least, and in what share of them an input may be missing: a machine that is busy delays some, a lag that stays all.
SETTLING_S, FEWEST_TICKS, MOST_STAND_INS = 1.5, 8, 0.5
#: Rounding of a stride that was read back from a message.
ROUNDING = 1e-9
#: Where the plant's pressure and superheat stay, whatever is done to the software: kPa, K.
PRESSURE_KPA = (100.0, 600.0)
LOWEST_SUPERHEAT_K = 0.0

#: Why a node refuses a message that suffers from such a fault.
REASONS: dict[MessageFaultKind, str] = {
    "nan": "not finite",
    "wrong_unit": "out of range",
    "out_of_range": "out of range",
}
#: A stall of so much of a tick can cost a command: the controller waits about as long for what is late.
STALL_TICKS = 0.3


@dataclass(frozen=True)
class Limits:
    """Of the controller's command, shape (2,) each: smallest, largest [rad/s, 0..1], most change a tick."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    stride: NDArray[np.float64]


@dataclass(frozen=True)
class Evidence:
    """What a run has left.

    Attributes
    ----------
    plan : what was done.
    problem : why the run ended early; empty when it did not.
    ticks : number of ticks recorded.
    command : (n, 2) every recorded ``controller/command`` in the order of its stamps [rad/s, 0..1].
    command_s : (n,) stamps, s since the first tick.
    pressure_kpa, superheat_k : (ticks,) actual values; nan where the recorder was away.
    restarts : what bringup started again.
    rejected : messages refused, by node, then by reason.
    limits : of the command.
    left : nodes whose processes were still there after the run.
    told : ticks that the plant itself reports as missed; one that the machine did not wake in time has no messages.
    stand_ins : for each health report of compensator and controller when, s since the first tick, whose, how many ticks
        it had worked, and in how many of them the input that was missing most had to be made up for.
    stalls : (due, woken) of wake-ups that came late to a process above the loop's priority, s since the first tick.
    """

    plan: Plan
    problem: str
    ticks: int
    command: NDArray[np.float64]
    command_s: NDArray[np.float64]
    pressure_kpa: NDArray[np.float64]
    superheat_k: NDArray[np.float64]
    restarts: Sequence[Restart]
    rejected: Mapping[str, Mapping[str, int]]
    limits: Limits
    left: Sequence[str] = ()
    told: Collection[int] = ()
    stand_ins: Sequence[tuple[float, str, int, int]] = ()
    stalls: Sequence[tuple[float, float]] = ()


@dataclass(frozen=True)
class Verdict:
    """One promise: kept or broken, and what was seen; `kept` None: nothing in this run could show it."""

    promise: str
    kept: bool | None
    seen: str = ""


def run_goes_on(evidence: Evidence) -> Verdict:
    """Check that the run comes to its end, whatever dies but the plant."""
    return Verdict("the run goes on to its end", not evidence.problem, evidence.problem)


def killed_nodes_come_back(evidence: Evidence) -> Verdict:
    """Check that every node that was killed is started again and works."""
    killed = [fault.node for fault in evidence.plan.processes if fault.kind == "kill"]
    back = [restart.node for restart in evidence.restarts if math.isfinite(restart.back_s)]
    lost = sorted(set(killed) - set(back))
    if not killed:
        return Verdict("killed nodes come back", None)
    return Verdict("killed nodes come back", not lost, f"not back: {', '.join(lost)}" if lost else ", ".join(back))


def back_in_time(evidence: Evidence) -> Verdict:
    """Check that each is back within three seconds."""
    took = {r.node: r.back_s - r.died_s for r in evidence.restarts if math.isfinite(r.back_s)}
    if not took:
        return Verdict(f"back within {BACK_WITHIN_S:g} s", None)
    slowest = max(took, key=lambda node: took[node])
    seen = f"{slowest} after {took[slowest]:.1f} s"
    return Verdict(f"back within {BACK_WITHIN_S:g} s", took[slowest] <= BACK_WITHIN_S, seen)


def only_killed_nodes_were_restarted(evidence: Evidence) -> Verdict:
    """Check that nothing dies of itself, of bad messages, or of a neighbour's death."""
    killed = [fault.node for fault in evidence.plan.processes if fault.kind == "kill"]
    others = [f"{restart.node} ({restart.reason[:80]})" for restart in evidence.restarts if restart.node not in killed]
    return Verdict("no other node dies", not others, ", ".join(others))


def commands_are_numbers(evidence: Evidence) -> Verdict:
    """Check that controller/command has no nan and no inf."""
    bad = int(np.count_nonzero(~np.isfinite(evidence.command)))
    return Verdict("no nan on controller/command", bad == 0, f"{bad} of {evidence.command.size} values")


def commands_keep_their_limits(evidence: Evidence) -> Verdict:
    """Check that commands stay within 0-6000 rpm and 0-100 %."""
    limits = evidence.limits
    outside = int(np.count_nonzero((evidence.command < limits.low) | (evidence.command > limits.high)))
    return Verdict("commands within their limits", outside == 0, f"{outside} outside" if outside else "")


def commands_do_not_jump(evidence: Evidence) -> Verdict:
    """Check that commands keep to their rate limits from tick to tick, also across restarts of the controller."""
    if len(evidence.command) < 2:
        return Verdict("no jump of the command", None)
    tick_s = evidence.plan.scenario.sample_time_s
    ticks = np.maximum(np.rint(np.diff(evidence.command_s) / tick_s), 1.0)
    share = np.abs(np.diff(evidence.command, axis=0)) / (ticks[:, None] * evidence.limits.stride)
    worst = float(np.nanmax(share))
    return Verdict("no jump of the command", worst <= 1.0 + ROUNDING, f"at most {worst:.0%} of the rate limit")


def no_command_is_missed(evidence: Evidence) -> Verdict:
    """Check that each tick of the plant has a command, while controller, injector and recorder are alive and running.

    A tick in which the machine woke nobody is told, and not held against the graph.
    """
    tick_s = evidence.plan.scenario.sample_time_s
    ticks = np.rint(evidence.command_s / tick_s).astype(np.int64)
    begun = np.flatnonzero(np.isfinite(evidence.pressure_kpa))
    missing = np.setdiff1d(begun, ticks) * tick_s
    for fault in evidence.plan.processes:
        if fault.node in (CONTROLLER, RECORDER, INJECTOR):
            start_s, end_s = disturbed(fault, evidence.restarts)
            missing = missing[(missing < start_s) | (missing > end_s)]
    # The last tick's command may come after the plant has finished, and so after the recorder has.
    missing = missing[missing < (evidence.ticks - 3) * tick_s]
    stood_still = [
        (due_s - tick_s, woke_s + tick_s) for due_s, woke_s in evidence.stalls if woke_s - due_s > STALL_TICKS * tick_s
    ]
    ours = [time_s for time_s in missing.tolist() if not any(start <= time_s <= end for start, end in stood_still)]
    said = [f"{len(ours)} missed, the first at {ours[0]:.1f} s"] if ours else []
    if len(ours) < len(missing):
        said.append(f"{len(missing) - len(ours)} while the machine stood still")
    return Verdict("no command is missed", not ours, "; ".join(said))


def disturbed(fault: ProcessFault, restarts: Sequence[Restart]) -> tuple[float, float]:
    """Return from when to when a process fault may show in the recording, s."""
    ends = [r.back_s for r in restarts if r.node == fault.node and math.isfinite(r.back_s)]
    end_s = max([fault.at_s + fault.lasts_s, *ends])
    return fault.at_s - BEFORE_S, end_s + AFTERMATH_S


def bad_messages_are_refused(evidence: Evidence) -> Verdict:
    """Check that what is no number, of another unit or out of range is refused, counted, and for that reason."""
    reasons = {REASONS[fault.kind] for fault in evidence.plan.messages if fault.kind in REASONS}
    if not reasons:
        return Verdict("bad messages are refused", None)
    counts = {
        node: sum(evidence.rejected.get(node, {}).get(reason, 0) for reason in reasons)
        for node in (FDI, CONTROLLER, PLANT)
    }
    seen = ", ".join(f"{node} {count}" for node, count in counts.items())
    return Verdict("bad messages are refused", any(counts.values()), seen)


def plant_stays_where_it_is_safe(evidence: Evidence) -> Verdict:
    """Check that evaporator pressure and superheat stay within what the plant stands."""
    pressure, superheat = evidence.pressure_kpa, evidence.superheat_k
    if not np.isfinite(pressure).any():
        return Verdict("the plant stays safe", None)
    low, high, dry = float(np.nanmin(pressure)), float(np.nanmax(pressure)), float(np.nanmin(superheat))
    kept = PRESSURE_KPA[0] <= low and high <= PRESSURE_KPA[1] and dry >= LOWEST_SUPERHEAT_K
    return Verdict("the plant stays safe", kept, f"{low:.0f}-{high:.0f} kPa, superheat at least {dry:.1f} K")


def bag_is_complete(evidence: Evidence) -> Verdict:
    """Check that every tick is in the bag or told as missed, but for what a killed recorder had not flushed."""
    wanted = evidence.plan.scenario.ticks
    silent = np.flatnonzero(~np.isfinite(evidence.pressure_kpa))
    unexplained = np.setdiff1d(silent, np.array(sorted(evidence.told), dtype=np.int64))
    missing = unexplained * evidence.plan.scenario.sample_time_s
    for fault in evidence.plan.processes:
        if fault.node == RECORDER and fault.kind == "kill":
            start_s, end_s = disturbed(fault, evidence.restarts)
            missing = missing[(missing < start_s - UNFLUSHED_S) | (missing > end_s)]
    kept = evidence.ticks == wanted and len(missing) == 0
    return Verdict("the bag is complete", kept, f"{evidence.ticks} of {wanted} ticks, {len(missing)} without a reason")


def in_step_again(evidence: Evidence) -> Verdict:
    """Check that compensator and controller have their inputs in time once all is over: no lag stays behind."""
    promise = "in step again at the end"
    ends = [disturbed(fault, evidence.restarts)[1] - AFTERMATH_S for fault in evidence.plan.processes]
    calm_s = max([*ends, *(fault.end_s for fault in evidence.plan.messages)], default=0.0) + SETTLING_S
    end_s = evidence.ticks * evidence.plan.scenario.sample_time_s
    shares = {}
    for node in (COMPENSATOR, CONTROLLER):
        seen = [row[2:] for row in evidence.stand_ins if row[1] == node and calm_s <= row[0] <= end_s]
        if len(seen) > 1 and seen[-1][0] - seen[0][0] >= FEWEST_TICKS:
            shares[node] = (seen[-1][1] - seen[0][1]) / (seen[-1][0] - seen[0][0])
    if not shares:
        return Verdict(promise, None)
    said = ", ".join(f"{node} without an input in {share:.0%} of the ticks" for node, share in shares.items())
    return Verdict(promise, max(shares.values()) <= MOST_STAND_INS, said)


def nothing_is_left_running(evidence: Evidence) -> Verdict:
    """Check that no process of the run is there after it."""
    return Verdict("nothing is left running", not evidence.left, ", ".join(evidence.left)[:200])


CHECKS: tuple[Callable[[Evidence], Verdict], ...] = (
    run_goes_on,
    killed_nodes_come_back,
    back_in_time,
    only_killed_nodes_were_restarted,
    commands_are_numbers,
    commands_keep_their_limits,
    commands_do_not_jump,
    no_command_is_missed,
    bad_messages_are_refused,
    plant_stays_where_it_is_safe,
    bag_is_complete,
    in_step_again,
    nothing_is_left_running,
)


def judge(evidence: Evidence) -> list[Verdict]:
    """Return all verdicts over one run."""
    return [check(evidence) for check in CHECKS]
