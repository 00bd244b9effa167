"""What is concluded from the likelihoods of jumps, the estimates, and whether the innovations are consistent.

At every tick there are explanations of what has been seen: a jump of one unknown. Each has a likelihood ratio to
"nothing has jumped" (`fdi_node.envelope.jumps`).

- An explanation is accepted when its ratio is high enough and for long enough ahead of that of every other one. The
  estimate is then moved as it says. A first, small fault needs less of a lead the longer it has been likely: what tells
  a fault of the compressor from one of the pressure's sensor is mostly in the first seconds of it.
- Jumps of the air flows are no fault, and they happen while a small fault is still in doubt: one is accepted when it
  explains more than any other jump does, together with what was likely before it, and what was told of that is kept.
- Of a fault that has a name, the name is isolated; the others are "unknown". So is
  what no explanation is ahead of for `undecided_s`, what leaves the innovations inconsistent for so long, and a fault
  larger than one with that name can be.
- A named fault is isolated without a jump, too, when its estimate has wandered beyond its threshold and no jump waits
  for its explanation.
- A fault is over when its estimate has been next to nothing for `clear_s`, an unknown one when there has been
  nothing to explain for so long.

A second fault that is isolated does not end the first. "Unknown" hides both: which of them is there is then in doubt.
A slow fault's name is less certain than an abrupt one's: whoever takes a sine of the pressure's sensor for a fault of
the compressor has to move that again and again, and then needs a second fault. So a fault that does not rest is
unknown, and so is a second slow one.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ac_common.faults import UNKNOWN
from ac_plant_node.dynamics.balances import N_STATES
from fdi_node.envelope import filter as kalman
from fdi_node.envelope import jumps
from fdi_node.envelope.limits import Limits
from fdi_node.envelope.memory import LARGEST, N_ONSETS, NIS, TICKS, Memory, Rules, memory_of, rules_in
from fdi_node.envelope.quiet import (
    FLOORS,
    HIGHEST,
    INCONSISTENT,
    IS_THERE,
    LOWEST,
    N_ASKED,
    NAMED,
    NATURAL_RATIO,
    NEVER,
    SETTLE_S,
    SIGMAS,
    SMALL,
    SMALL_SIGMAS,
    UNITS,
    UNNAMED,
    is_quiet,
)
from fdi_node.envelope.unknowns import NATURAL, UNKNOWNS, Unknown

NOT = math.inf
"""Time since when something holds that does not hold."""
_BEYOND = ("beyond_n", "beyond_p")
MOST_AT_ONCE = 2
"""More faults than these at once are not told apart: whoever sees more has lost the plant."""


class Conclusion(NamedTuple):
    """The last fields of `fdi_node.detector.Detection`, in their order."""

    thresholds: tuple[float, ...]
    detected: bool
    isolated: str | None
    size: float
    onset_s: float
    isolated_s: float
    also_isolated: str | None


@dataclass
class Isolated:
    """A fault that is isolated.

    Position of its unknown (-1: none), name, times, since when it is small, whether it was isolated at once, how often
    it has moved of late, and when it did last.
    """

    unknown: int
    name: str
    onset_s: float
    isolated_s: float
    small_since: float = NOT
    is_abrupt: bool = False
    moves: float = 0.0
    moved_s: float = 0.0

    def rests(self, time_s: float, limits: Limits) -> bool:
        """Take note of a move of this fault; return whether it has moved no more often than it may."""
        self.moves = 1.0 + self.moves * math.exp((self.moved_s - time_s) / limits.restless_s)
        self.moved_s = time_s
        return self.moves <= limits.most_moves


@dataclass
class Since:
    """Since when conditions hold; `NOT` while they do not.

    Attributes
    ----------
    likely : something has probably jumped.
    certain : something has certainly jumped.
    natural : an air flow has jumped.
    ahead : an explanation by the unknown `leader` is ahead of the others.
    inconsistent : the innovations are.
    unknown : something was last unknown.
    beyond_n, beyond_p : the estimate of the fault is beyond its threshold.
    """

    likely: float = NOT
    certain: float = NOT
    natural: float = -NOT
    ahead: float = NOT
    leader: int = -1
    inconsistent: float = NOT
    unknown: float = -NOT
    beyond_n: float = NOT
    beyond_p: float = NOT

    def unlikely(self) -> None:
        """Nothing has probably jumped."""
        self.likely = self.certain = self.ahead = NOT


class EnvelopeDecision:
    """The decision on the memory of an observer.

    Parameters
    ----------
    limits : Limits
    unknowns : tuple of Unknown
    flat : ndarray
        The observer's memory; accepted jumps move its estimate.
    packed : ndarray
        The observer's rules; the random walk of an isolated fault is made faster in them.
    is_open : bool
        Whether parameters of the plant that are among the unknowns are estimated from the start.

    Attributes
    ----------
    isolated : list of Isolated
    since : Since
    asked, thresholds : ndarray
        What `fdi_node.envelope.quiet.is_quiet` is asked, and the thresholds that it finds.
    doubts : bool
        Whether the plant seems to be another one than the design's, and `open_up` is to be called.
    is_open : bool
        Whether the plant's parameters are estimated.
    is_lost : bool
        Whether more seems to be off than can be told apart, so that the observer has to begin anew.
    """

    def __init__(
        self,
        limits: Limits,
        unknowns: tuple[Unknown, ...],
        flat: NDArray[np.float64],
        packed: NDArray[np.float64],
        is_open: bool = False,
    ) -> None:
        self.limits, self._unknowns, self._flat, self._packed = limits, unknowns, flat, packed
        rules = self._rules = rules_in(packed)
        self._memory = memory_of(flat, len(unknowns), len(rules.jumping))
        self.thresholds, self.asked = np.zeros(NAMED), _asked(limits, unknowns)
        self._h, self._quiet_q = float(rules.constants[0]), rules.Q.copy()
        self._positions = [int(i) for i in rules.jumping]
        self._reported = [unknowns[i].reported for i in self._positions]
        self.isolated: list[Isolated] = []
        self.since = Since()
        self._may_open, self._time_s = len(unknowns) > len(UNKNOWNS), 0.0
        self.doubts, self.is_open, self.is_lost = False, is_open, False
        self._set_drifts()

    def open_up(self) -> None:
        """Begin anew with the plant's parameters estimated."""
        self.isolated.clear()
        self.doubts, self.is_open = False, True
        self._set_drifts()

    def step(self, time_s: float) -> Conclusion:
        """Conclude from what the observer says at this tick."""
        quiet = is_quiet(self._flat, self._packed, self.asked, self.thresholds)
        thresholds: tuple[float, ...] = tuple(self.thresholds.tolist())
        if quiet:  # as in most ticks
            return self.rest(time_s, time_s)
        self._time_s = float(self._memory.scalars[TICKS]) * self._h
        if self._time_s > self.asked[SETTLE_S]:
            self._explain(time_s)
            self._look_at_estimates(time_s, thresholds)
            self._look_at_consistency(time_s)
        if self.isolated:
            self._end(time_s)
        return self._conclude(time_s, thresholds)

    def rest(self, first_s: float, last_s: float) -> Conclusion:
        """Go over ticks that left nothing to conclude, and return what holds in the last of them."""
        since = self.since
        since.unlikely()
        since.inconsistent = NOT
        for i, beyond in enumerate(_BEYOND):
            setattr(since, beyond, min(getattr(since, beyond), first_s) if self.asked[IS_THERE + i] else NOT)
        for one in self.isolated:
            one.small_since = NOT
        return self._conclude(last_s, tuple(self.thresholds.tolist()))

    def _conclude(self, time_s: float, thresholds: tuple[float, ...]) -> Conclusion:
        if not self.isolated:
            onset_s = self.since.likely
            detected = time_s - self.since.certain >= self.limits.hold_unsure_s
            self.doubts = self.doubts or (detected and self._is_early(onset_s, time_s))
            detected = detected and not self.doubts
            return Conclusion(thresholds, detected, None, math.nan, onset_s if detected else math.nan, math.nan, None)
        for one in self.isolated:
            if one.name == UNKNOWN:
                self.since.unknown = time_s
                return Conclusion(thresholds, True, UNKNOWN, math.nan, one.onset_s, one.isolated_s, None)
        last, also = self.isolated[-1], self.isolated[0].name if len(self.isolated) > 1 else None
        size = float(self._memory.x[last.unknown])
        return Conclusion(thresholds, True, last.name, size, last.onset_s, last.isolated_s, also)

    def _is_early(self, onset_s: float, time_s: float) -> bool:
        """Return whether what has begun then would rather be another plant than a fault."""
        return self._may_open and not self.is_open and self._time_s - (time_s - onset_s) < self.limits.trust_s

    def _explain(self, time_s: float) -> None:
        """Accept the explanation that is ahead of the others."""
        limits, since = self.limits, self.since
        here = float(self._memory.scalars[LARGEST])
        if here < limits.natural:
            since.unlikely()
            return
        known = [one.unknown for one in self.isolated]
        is_unsure = any(one.unknown >= 0 and not one.is_abrupt for one in self.isolated)
        ratios = self._memory.ratios.tolist()
        if is_unsure and not self._stands_out(ratios):
            _weigh(ratios, [at in known for at in self._positions], self._reported, limits.second)
        flow = _air_flow_that_jumped(self._memory, self._rules, self._reported, ratios, limits, not self.isolated)
        if flow is not None:
            self._accept(flow, time_s)
            return
        top, best, lead = _ahead(ratios, self._positions)
        unknown, grows = self._positions[top], bool(self._rules.growing[top])
        reported = self._reported[top]
        likely = limits.likely_open if self.is_open else limits.likely
        if here < likely or (reported == UNKNOWN and here < limits.likely_unknown):
            since.unlikely()
            return
        if since.likely == NOT:
            since.likely = time_s
        waited_s = 0.0 if self.isolated or self.is_open else time_s - since.likely
        if not lead > limits.lead(best, waited_s):
            since.ahead = NOT
        elif unknown != since.leader or since.ahead == NOT:
            since.leader, since.ahead = unknown, time_s
        onset_s = time_s - float(self._memory.age[int(self._memory.best[top])]) * self._h
        since.certain = min(since.certain, time_s) if here > limits.certain else NOT
        is_plain = here > limits.plain and unknown == 0 and not grows and lead > limits.lead(best, 0.0)
        hold_s = limits.hold_growing_s if grows else limits.hold_s if is_plain else limits.hold_unsure_s
        at_once = self._stands_out(ratios)
        waits = not is_plain and onset_s >= since.natural - N_ONSETS * self._h
        ready_s = max(since.ahead + hold_s, since.natural + limits.after_natural_s if waits else -NOT)
        if at_once or time_s >= ready_s - 1.0e-9:
            is_unsure = is_unsure or time_s - since.unknown < limits.after_unknown_s
            if is_unsure and reported not in (UNKNOWN, NATURAL) and unknown not in known and not at_once:
                self._add(-1, UNKNOWN, onset_s, time_s)
                return
            since.unlikely()
            if self._accept(top, time_s) != NATURAL:
                self._add(-1 if self._rules.prior[top] < 0.0 else unknown, reported, onset_s, time_s, at_once)
        elif time_s - since.certain >= limits.undecided_s:
            self._add(-1, UNKNOWN, onset_s, time_s)

    def _stands_out(self, ratios: list[float]) -> bool:
        share = self.limits.at_once_share_open if self.is_open else self.limits.at_once_share
        return _is_abrupt(self._memory, self._rules, self._reported, ratios, self.limits, share)

    def _accept(self, top: int, time_s: float) -> str:
        """Move the estimate as an explanation says, and return what it is reported as."""
        reported = self._reported[top]
        kalman.accept_jump(self._flat, self._rules, top, reported != NATURAL)
        if reported == NATURAL:
            self.since.natural = time_s
        return reported

    def _add(self, unknown: int, name: str, onset_s: float, time_s: float, is_abrupt: bool = False) -> None:
        """Isolate a fault, unless it is already, or the plant is another one."""
        for one in self.isolated:
            if (one.unknown, one.name) == (unknown, name):
                one.small_since = NOT
                if name != UNKNOWN and not one.rests(time_s, self.limits):
                    self._add(-1, UNKNOWN, one.onset_s, time_s)
                return
        if not self.isolated and self._is_early(onset_s, time_s):  # a plant with a fault has been trusted before
            self.doubts = True
            return
        self.isolated.append(Isolated(unknown, name, onset_s, time_s, is_abrupt=is_abrupt))
        if sum(one.unknown >= 0 for one in self.isolated) > MOST_AT_ONCE:
            self.isolated[:] = [Isolated(-1, UNKNOWN, self.isolated[0].onset_s, time_s)]
            self.is_lost = True
        self._set_drifts()

    def _set_drifts(self) -> None:
        """Let the estimates of the isolated faults follow them, and those of the others rest."""
        self._rules.Q[:] = self._quiet_q
        self.asked[SETTLE_S] = self.limits.settle_open_s if self.is_open else self.limits.settle_s
        there = [one.unknown for one in self.isolated]
        self.asked[IS_THERE : IS_THERE + NAMED] = [i in there for i in range(NAMED)]
        self.asked[NEVER], self.asked[UNNAMED] = -1 in there, max(there, default=0) >= NAMED
        self.asked[N_ASKED + NAMED :] = [i in there for i in range(NAMED, len(self._unknowns))]
        if not self.is_open:
            self._rules.Q[N_STATES + len(UNKNOWNS) :] = 0.0
        for one in self.isolated:
            if one.unknown >= 0:
                row = self._unknowns[one.unknown]
                self._rules.Q[N_STATES + one.unknown] = (row.drift_after / row.scale) ** 2

    def _look_at_estimates(self, time_s: float, thresholds: tuple[float, ...]) -> None:
        limits, since = self.limits, self.since
        known = [one.unknown for one in self.isolated]
        for i, name in enumerate(_BEYOND):
            value = float(self._memory.x[i])
            if abs(value) <= thresholds[i] or since.likely < NOT:
                setattr(since, name, NOT)
                continue
            began = min(getattr(since, name), time_s)
            setattr(since, name, began)
            if time_s - began < limits.wander_s:
                continue
            if i not in known and not known and time_s - since.unknown > limits.after_unknown_s:
                self._add(i, self._reported[i], began, time_s)
            if not self.asked[LOWEST + i] <= value <= self.asked[HIGHEST + i]:
                self._add(-1, UNKNOWN, began, time_s)

    def _look_at_consistency(self, time_s: float) -> None:
        since = self.since
        calm = self._memory.scalars[NIS] < self.limits.inconsistent
        since.inconsistent = NOT if calm else min(since.inconsistent, time_s)
        if time_s - since.inconsistent >= self.limits.undecided_s:
            self._add(-1, UNKNOWN, since.inconsistent, time_s)

    def _is_small(self, unknown: int) -> bool:
        if unknown < 0:
            return self.since.likely == NOT and float(self._memory.scalars[NIS]) < self.limits.consistent
        return _is_within(self._memory, self.limits, unknown, self._unknowns[unknown].scale)

    def _end(self, time_s: float) -> None:
        """Forget the faults that are over."""
        for one in list(self.isolated):
            if not self._is_small(one.unknown):
                one.small_since = NOT
                continue
            one.small_since = min(one.small_since, time_s)
            if time_s - one.small_since < self.limits.clear_s:
                continue
            self.isolated.remove(one)
            self._set_drifts()
            if one.unknown >= 0:
                row = self._unknowns[one.unknown]
                kalman.settle(self._flat, self._rules, one.unknown, (row.first / row.scale) ** 2)

    def restart(self) -> None:
        """Go over a gap: what seemed likely before it is looked for anew."""
        self.since, self.is_lost = Since(), False
        jumps.begin_all(self._memory, self._rules)

    def state(self) -> dict[str, Any]:
        """Return what a decision that takes this one's place has to know, fit for JSON (inf included)."""
        isolated, since = [asdict(one) for one in self.isolated], asdict(self.since)
        return {"isolated": isolated, "since": since, "is_open": self.is_open}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take the place of the decision whose `state` this is; `KeyError`, `TypeError`, `ValueError`: it is none."""
        self.isolated, self.since, self.is_open = _restored(state, len(self._unknowns))
        self._set_drifts()


def _ahead(ratios: list[float], positions: list[int]) -> tuple[int, float, float]:
    """Return which explanation has the largest ratio, that, and its lead over those of other unknowns."""
    best = max(ratios)
    top = ratios.index(best)
    others = (ratio for ratio, other in zip(ratios, positions, strict=True) if other != positions[top])
    return top, best, best - max(others)


def _is_abrupt(m: Memory, rules: Rules, reported: list[str], ratios: list[float], limits: Limits, share: float) -> bool:
    """Return whether what is ahead is a named fault that has jumped just now, and clearly: it is isolated at once."""
    top, best, lead = _ahead(ratios, [int(i) for i in rules.jumping])
    age_s = float(m.age[int(m.best[top])] * rules.constants[0])
    has_jumped = reported[top] not in (UNKNOWN, NATURAL) and not rules.growing[top] and age_s <= limits.at_once_s
    return bool(has_jumped and lead > max(limits.at_once, share * best))


def _is_within(m: Memory, limits: Limits, unknown: int, scale: float) -> bool:
    """Return whether the estimate of an unknown with this scale may as well be none."""
    named = (0.5 * limits.floor_rad_s, 0.5 * limits.floor_pa)
    small = named[unknown] if unknown < NAMED else SMALL * scale
    deviation = math.sqrt(max(float(m.P[N_STATES + unknown, N_STATES + unknown]), 0.0)) * scale
    return abs(float(m.x[unknown])) < small + SMALL_SIGMAS * deviation


def _air_flow_that_jumped(
    m: Memory, rules: Rules, reported: list[str], ratios: list[float], limits: Limits, is_first: bool
) -> int | None:
    """Return which air flow has jumped, if that explains more than any other jump, with what was likely before it."""
    top = max((h for h, name in enumerate(reported) if name == NATURAL), key=lambda h: ratios[h])
    if ratios[top] < limits.natural:
        return None
    before = float(jumps.told_before(m, rules, top)) if is_first else 0.0
    explained = ratios[top] + (before if before > limits.natural else 0.0)
    others = max(ratio for h, ratio in enumerate(ratios) if h != top)
    return top if explained - others > limits.ahead_natural else None


def _weigh(ratios: list[float], known: list[bool], reported: list[str], second: float) -> None:
    """Let what would be a second fault count less by a factor; jumps of air flows are none."""
    for i, (is_known, name) in enumerate(zip(known, reported, strict=True)):
        ratios[i] /= 1.0 if is_known or name == NATURAL else second


def _restored(state: Mapping[str, Any], unknowns: int) -> tuple[list[Isolated], Since, bool]:
    isolated = [Isolated(**one) for one in state["isolated"]]
    if any(not -1 <= int(one.unknown) < unknowns for one in isolated):
        raise ValueError("an isolated fault that is none of the unknowns")
    return isolated, Since(**state["since"]), bool(state["is_open"])


def _asked(limits: Limits, unknowns: tuple[Unknown, ...]) -> NDArray[np.float64]:
    """Return what `fdi_node.envelope.quiet.is_quiet` is asked, while nothing is isolated."""
    asked = np.zeros(N_ASKED + len(unknowns))
    asked[SIGMAS], asked[NATURAL_RATIO], asked[INCONSISTENT] = limits.sigmas, limits.natural, limits.inconsistent
    asked[FLOORS : FLOORS + NAMED] = limits.floor_rad_s, limits.floor_pa
    asked[UNITS : UNITS + NAMED] = [one.scale for one in unknowns[:NAMED]]
    asked[LOWEST : LOWEST + NAMED] = limits.lowest_rad_s, -limits.largest_pa
    asked[HIGHEST : HIGHEST + NAMED] = limits.highest_rad_s, limits.largest_pa
    return asked
