"""What is concluded from the likelihoods of jumps, the estimates, and whether the innovations are consistent.

At every tick there are explanations of what has been seen: a jump of one unknown. Each has a likelihood ratio to
"nothing has jumped" (`fdi_node.envelope.jumps`).

- An explanation is accepted when its ratio is high enough and for long enough ahead of that of every other one. The
  estimate is then moved as it says. A first fault needs less of a lead the longer it has been likely: what tells
  a fault of the compressor from one of the pressure's sensor is mostly in the first seconds of it.
- Jumps of the air flows are no fault, and they happen while a small fault is still in doubt: one is accepted when it
  explains more than any other jump does, together with what was likely before it, and what was told of that is kept.
- Of a fault that has a name, the name is isolated; the others are "unknown". So is
  what no explanation is ahead of for `undecided_s`, what leaves the innovations inconsistent for so long, and a fault
  larger than one with that name can be.
- A named fault is isolated without a jump, too, when its estimate has wandered beyond its threshold and no jump waits
  for its explanation.
- A fault is over when its estimate has been next to nothing for `clear_s`, one without a name when an observer that has
  begun anew says so (`fdi_node.envelope.afresh`).

A second fault that is isolated does not end the first. "Unknown" hides both: which of them is there is then in doubt.
A slow fault's name is less certain than an abrupt one's: whoever takes a sine of the pressure's sensor for a fault of
the compressor has to move that again and again, and then needs a second fault. So a fault that does not rest is
unknown, and so is a second slow one.

What is not isolated at once keeps its name as long as it explains the readings better than the other named fault would
(`fdi_node.envelope.rival`).
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ac_common.faults import UNKNOWN
from fdi_node.envelope import filter as kalman
from fdi_node.envelope import jumps
from fdi_node.envelope.explanations import COMPRESSOR, PRESSURE, Explanations, Leader
from fdi_node.envelope.isolation import NOT, Isolated, Isolation
from fdi_node.envelope.limits import Limits
from fdi_node.envelope.memory import JUMPED, LARGEST, LEFT, N_ONSETS, NIS, TICKS, memory_of, rules_in
from fdi_node.envelope.quiet import HIGHEST, IS_THERE, LOWEST, NAMED, SETTLE_S, is_quiet
from fdi_node.envelope.unknowns import NATURAL, UNKNOWNS, Unknown

_BEYOND = ("beyond_n", "beyond_p")


class Conclusion(NamedTuple):
    """The last fields of `fdi_node.detector.Detection`, in their order."""

    thresholds: tuple[float, ...]
    detected: bool
    isolated: str | None
    size: float
    onset_s: float
    isolated_s: float
    also_isolated: str | None
    unsure: str | None = None


@dataclass
class Since:
    """Since when conditions hold; `NOT` while they do not.

    Attributes
    ----------
    likely : something has probably jumped; `most`: the largest ratio of all explanations since then.
    certain : something has certainly jumped.
    natural : an air flow has jumped.
    ahead : an explanation by the unknown `leader` is ahead of the others.
    inconsistent : the innovations are.
    unknown : something was last unknown.
    beyond_n, beyond_p : the estimate of the fault is beyond its threshold.
    """

    likely: float = NOT
    most: float = 0.0
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
        self.most = 0.0


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
    isolation : Isolation
    isolated : list of Isolated
        The faults that it holds.
    since : Since
    asked, thresholds : ndarray
        What `fdi_node.envelope.quiet.is_quiet` is asked, and the thresholds that it finds.
    doubts : bool
        Whether the plant seems to be another one than the design's, and `open_up` is to be called.
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
        self.isolation = Isolation(limits, unknowns, flat, packed, is_open)
        self.isolated, self.asked, self.thresholds = self.isolation.faults, self.isolation.asked, np.zeros(NAMED)
        self._h = float(rules.constants[0])
        self._explanations = Explanations.of(rules, unknowns)
        self.since = Since()
        self._may_open, self._time_s = len(unknowns) > len(UNKNOWNS), 0.0
        self.doubts = False

    def open_up(self) -> None:
        """Begin anew with the plant's parameters estimated."""
        self.doubts = False
        self.isolation.open_up()

    def step(self, time_s: float) -> Conclusion:
        """Conclude from what the observer says at this tick."""
        quiet = is_quiet(self._flat, self._packed, self.asked, self.thresholds)
        thresholds: tuple[float, ...] = tuple(self.thresholds.tolist())
        if quiet:  # as in most ticks
            return self.rest(time_s, time_s)
        self._time_s = float(self._memory.scalars[TICKS]) * self._h
        if self.isolation.compare(time_s):
            self.since.unlikely()
        if self._time_s > self.asked[SETTLE_S]:
            self._explain(time_s)
            self._look_at_estimates(time_s, thresholds)
            self._look_at_consistency(time_s)
        if self.isolated:
            self.isolation.end(time_s)
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
            detected = detected and not self.doubts and not self.isolation.is_open
            return Conclusion(thresholds, detected, None, math.nan, onset_s if detected else math.nan, math.nan, None)
        for one in self.isolated:
            if one.name == UNKNOWN:
                self.since.unknown = time_s
                return Conclusion(thresholds, True, UNKNOWN, math.nan, one.onset_s, one.isolated_s, None)
        last, also = self.isolated[-1], self.isolated[0].name if len(self.isolated) > 1 else None
        size = float(self._memory.x[last.unknown])
        unsure = next((one.name for one in self.isolated if not one.is_sure), None)
        return Conclusion(thresholds, True, last.name, size, last.onset_s, last.isolated_s, also, unsure)

    def _is_early(self, onset_s: float, time_s: float) -> bool:
        """Return whether what has begun then, or made the innovations inconsistent, is rather another plant."""
        began_s = self._time_s - (time_s - min(onset_s, self.since.inconsistent))
        return self._may_open and not self.isolation.is_open and began_s < self.limits.trust_s

    def _explain(self, time_s: float) -> None:
        """Accept the explanation that is ahead of the others."""
        limits, since = self.limits, self.since
        if self._memory.scalars[JUMPED] != 0.0:  # in one tick: nothing physical can do it
            kalman.accept_reading_jump(self._flat, self._rules, PRESSURE)
            since.unlikely()
            self._add(PRESSURE, self._unknowns[PRESSURE].reported, time_s - self._h, time_s, True)
            return
        if float(self._memory.scalars[LARGEST]) < limits.natural:
            since.unlikely()
            return
        known = [one.unknown for one in self.isolated]
        is_slow = any(one.unknown >= 0 and not one.is_abrupt for one in self.isolated)
        ratios = self._memory.ratios.tolist()
        leader = self._leader(ratios)
        if is_slow and not leader.has_jumped:
            self._explanations.weigh(ratios, known, limits.second)
            leader = self._leader(ratios)
        flow = self._explanations.air_flow_that_jumped(self._memory, self._rules, ratios, limits, not self.isolated)
        if flow is not None:
            self._accept(flow, time_s)
        elif not self._is_forgotten(leader, time_s):
            onset_s, ready_s = time_s - leader.age_s, self._ready_s(leader, time_s)
            if leader.has_jumped or time_s >= ready_s - 1.0e-9:
                is_new = leader.unknown not in known and leader.reported not in (UNKNOWN, NATURAL)
                is_slow = is_slow or time_s - since.unknown < limits.after_unknown_s
                self._conclude_that(leader, is_new and is_slow and not leader.has_jumped, onset_s, time_s)
            elif time_s - since.certain >= limits.undecided_s:
                self._add(-1, UNKNOWN, onset_s, time_s)

    def _leader(self, ratios: list[float]) -> Leader:
        leader = self._explanations.leader(self._memory, self._rules, ratios, self.limits)
        return leader._replace(has_jumped=False) if self.isolation.is_open else leader

    def _is_forgotten(self, leader: Leader, time_s: float) -> bool:
        """Return whether nothing has probably jumped, or what seemed to have is refuted; take note of it if not."""
        limits, since, is_open = self.limits, self.since, self.isolation.is_open
        here = float(self._memory.scalars[LARGEST])
        likely = limits.likely_open if is_open else limits.likely
        is_likely = here >= likely and (leader.reported != UNKNOWN or here >= limits.likely_unknown)
        if not (leader.has_jumped or is_likely):
            since.unlikely()
            return True
        since.most = max(since.most, here)
        fallen = here < since.most - max(limits.likely, limits.refuted * since.most)
        if time_s - since.likely > limits.forget_open_s if is_open else fallen:
            jumps.begin_all(self._memory, self._rules)
            since.unlikely()
            return True
        since.likely = min(since.likely, time_s)
        return False

    def _ready_s(self, leader: Leader, time_s: float) -> float:
        """Return when an explanation may be accepted, if it stays ahead; inf if it is not."""
        limits, since, is_open = self.limits, self.since, self.isolation.is_open
        here = float(self._memory.scalars[LARGEST])
        waited_s = 0.0 if self.isolated or is_open else time_s - since.likely
        is_doubtful = is_open and leader.unknown == PRESSURE  # wrong parameters look like a slow one of the sensor
        if is_doubtful or not leader.lead > limits.lead(leader.ratio, waited_s, leader.unknown < NAMED):
            since.ahead = NOT
        elif leader.unknown != since.leader or since.ahead == NOT:
            since.leader, since.ahead = leader.unknown, time_s
        is_plain = here > limits.plain and leader.unknown == COMPRESSOR and not leader.grows
        share = limits.at_once_share if is_open else 0.0  # that filter is too sure of itself where a zone vanishes
        is_plain = is_plain and leader.lead > max(limits.lead(leader.ratio, 0.0, True), share * leader.ratio)
        hold_s = limits.hold_growing_s if leader.grows else limits.hold_s if is_plain else limits.hold_unsure_s
        may_be_natural = not is_plain and time_s - leader.age_s >= since.natural - N_ONSETS * self._h
        waits_s = since.natural + limits.after_natural_s if may_be_natural else -NOT
        since.certain = min(since.certain, time_s) if here > limits.certain and time_s >= waits_s else NOT
        return max(since.ahead + hold_s, waits_s)

    def _conclude_that(self, leader: Leader, has_no_name: bool, onset_s: float, time_s: float) -> None:
        """Isolate what an explanation says, and move the estimate; without a name, leave it where it is."""
        if has_no_name:
            self._add(-1, UNKNOWN, onset_s, time_s)
            return
        self.since.unlikely()
        if not leader.has_jumped:
            self.isolation.doubt(self._explanations, leader.top)
        if self._accept(leader.top, time_s) != NATURAL:
            unknown = -1 if self._rules.prior[leader.top] < 0.0 else leader.unknown
            self._add(unknown, leader.reported, onset_s, time_s, leader.has_jumped)

    def _accept(self, top: int, time_s: float) -> str:
        """Move the estimate as an explanation says, and return what it is reported as."""
        reported = self._explanations.reported[top]
        self.since.most = 0.0
        kalman.accept_jump(self._flat, self._rules, top, reported != NATURAL)
        if reported == NATURAL:
            self.since.natural = time_s
            if self.isolation.rival is not None:
                self.isolation.rival.accept_air_flow(top)
        return reported

    def _add(self, unknown: int, name: str, onset_s: float, time_s: float, is_abrupt: bool = False) -> None:
        """Isolate a fault, unless the plant is another one."""
        if not self.isolated and self._is_early(onset_s, time_s):  # a plant with a fault has been trusted before
            self.doubts = True
        else:
            self.isolation.add(Isolated(unknown, name, onset_s, time_s, is_abrupt=is_abrupt))

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
                is_explained = self._memory.scalars[LARGEST] > limits.natural and self._time_s < limits.explained_s
                explained_s = time_s - self._explanations.age_s(self._memory, self._h) if is_explained else NOT
                self.doubts |= self._is_early(explained_s, time_s)
                if not self.doubts:
                    self._add(i, self._unknowns[i].reported, began, time_s)
            if not self.asked[LOWEST + i] <= value <= self.asked[HIGHEST + i]:
                self._add(-1, UNKNOWN, began, time_s)

    def _look_at_consistency(self, time_s: float) -> None:
        since = self.since
        calm = self._memory.scalars[NIS] < self.limits.inconsistent
        since.inconsistent = NOT if calm else min(since.inconsistent, time_s)
        if time_s - since.inconsistent >= self.limits.undecided_s:
            self._add(-1, UNKNOWN, since.inconsistent, time_s)

    def withdraw(self, other: "EnvelopeDecision") -> None:
        """Take it that nothing is off, and go on as another decision that says so."""
        other.since.unknown = self.since.unknown
        self.since = other.since
        self.isolation.withdraw()

    def restart(self) -> None:
        """Go over a gap: what seemed likely before it is looked for anew."""
        self.since = Since()
        self.isolation.begin_anew()
        self._memory.scalars[LEFT] = math.nan
        jumps.begin_all(self._memory, self._rules)

    def state(self) -> dict[str, Any]:
        """Return what a decision that takes this one's place has to know, fit for JSON (inf included)."""
        return {"since": asdict(self.since), "isolation": self.isolation.state()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take the place of the decision whose `state` this is; `KeyError`, `TypeError`, `ValueError`: it is none."""
        since = Since(**state["since"])
        self.isolation.restore(state["isolation"])
        self.since = since
