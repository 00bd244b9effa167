"""What is concluded from the residuals: whether there is a fault, which one, and when it is over.

A state machine on the ratios `|r_i| / threshold_i`, with one watch for each residual, and on jumps of readings:

    QUIET     --a residual is above its threshold for confirm_s-->               DETECTED
    DETECTED  --a residual leads for isolate_s, or undecided_s are over-->       ISOLATED
    DETECTED, ISOLATED --the residuals in question are small for clear_s-->      QUIET, or DETECTED anew
    any       --a reading has jumped as no fault of a filter makes it, and stays there for confirm_s-->  UNKNOWN
    UNKNOWN   --all residuals are small for clear_s, or it is back for aftermath_s-->  QUIET, or DETECTED anew

A fault is isolated when its residual leads, and a second one, too, when its residual is then more than the first fault
could make it. Pure bookkeeping: nothing here knows what the residuals are of.
"""

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from enum import Enum
from typing import Any, NamedTuple

import numpy as np

from ac_common.faults import ISOLABLE_KINDS, UNKNOWN

NOT = math.inf
"""Time since when something holds that does not hold: later than every time."""

DEVIATION = 1.4826
"""Standard deviation of a normal variable over the median of its magnitude: one jump does not change a median."""


@dataclass(frozen=True)
class Supervision:
    """When a residual becomes a detection, and a detection an isolation.

    Attributes
    ----------
    confirm_s : float
        A residual must stay above its threshold this long before the fault counts as detected.
    isolate_s : float
        The leading residual must then lead this long before its fault counts as isolated.
    isolation_ratio : float
        A residual leads when its ratio to its threshold is this many times the other's.
    undecided_s : float
        When none has led this long after the detection, both faults count as there, if
    cross_talk : tuple of float
        each residual's ratio is above this part of the other's: [f_p in r_N, f_N in r_p], more than one fault by itself
        can bring into the other's residual. So it is for the second fault once the first is isolated, and
    also_isolate_s : float
        this long.
    clear_ratio : float
        A fault is over when its residual has been below this part of its threshold
    clear_s : float
        for this long.
    """

    confirm_s: float = 0.5
    isolate_s: float = 0.5
    isolation_ratio: float = 1.5
    undecided_s: float = 5.0
    cross_talk: tuple[float, float] = (0.4, 0.1)
    also_isolate_s: float = 0.5
    clear_ratio: float = 0.5
    clear_s: float = 20.0


@dataclass(frozen=True)
class JumpRule:
    """When a reading has jumped by itself, as only its sensor can make it.

    No fault that a filter is for, nor anything physical, moves the superheat by much within one tick while the other
    readings stand: a fault of the compressor and a disturbance move all of them, within seconds; a fault of the
    pressure's sensor moves the reading of the pressure, and a derived superheat only along with it.

    Attributes
    ----------
    smallest : tuple of float
        Smallest jump from one tick to the next of p_e [Pa], SH [K], T_w [K] that counts. inf: none does. The pressure's
        sensor has a filter, which tells more; and T_w really jumps when the superheated zone, whose wall it is, ends.
    deviations : float
        And it is at least so many times what the reading did lately from tick to tick, as a standard deviation.
    still, still_deviations : tuple of float, float
        The other readings move by less than this; for noise, by less than so many times what they did lately, but at
        most twice as much.
    memory_s : float
        How long "lately" is; nothing is a jump before half of it is over.
    aftermath_s : float
        For how long after the reading is back the residuals may remember that it was not.
    """

    smallest: tuple[float, float, float] = (math.inf, 2.0, math.inf)
    deviations: float = 10.0
    still: tuple[float, float, float] = (300.0, 0.3, 0.3)
    still_deviations: float = 4.0
    memory_s: float = 10.0
    aftermath_s: float = 120.0


class State(Enum):
    """What the decision is at."""

    QUIET = "quiet"
    DETECTED = "detected"
    ISOLATED = "isolated"
    UNKNOWN = "unknown"


class Conclusion(NamedTuple):
    """What is concluded at one tick.

    Attributes
    ----------
    detected : bool
    isolated : str or None
        A kind of fault, of two the one that was isolated last, or "unknown".
    residual : int
        Index of the residual that estimates it; -1 when there is none.
    onset_s, isolated_s : float
        When it began, and when it was isolated; nan for "not".
    also_isolated : str or None
        The fault that was isolated before, when it is still there.
    """

    detected: bool
    isolated: str | None
    residual: int
    onset_s: float
    isolated_s: float
    also_isolated: str | None


NOTHING = Conclusion(False, None, -1, math.nan, math.nan, None)


@dataclass(slots=True)
class Watch:
    """Since when conditions on one residual hold; `NOT` while they do not.

    Attributes
    ----------
    above : it is above its threshold.
    leads : and so far above the others that its fault is the one.
    exceeds : and more than the other faults' cross-talk.
    below : it is so small that its fault is over.
    under_way : whether the present detection is about it.
    """

    above: float = NOT
    leads: float = NOT
    exceeds: float = NOT
    below: float = NOT
    under_way: bool = False

    def update(self, time_s: float, ratio: float, others: float, cross_talk: float, rules: Supervision) -> None:
        """Look at the ratio of this tick, and at the largest one of the other residuals."""
        if ratio > 1.0:
            if self.above == NOT:
                self.above = time_s
            if not ratio > rules.isolation_ratio * others:
                self.leads = NOT
            elif self.leads == NOT:
                self.leads = time_s
            if not ratio > cross_talk * others:
                self.exceeds = NOT
            elif self.exceeds == NOT:
                self.exceeds = time_s
        elif self.above != NOT:
            self.above = self.leads = self.exceeds = NOT
        if ratio >= rules.clear_ratio:
            self.below = NOT
        elif self.below == NOT:
            self.below = time_s
        if time_s - self.above >= rules.confirm_s:
            self.under_way = True


@dataclass
class Isolated:
    """A fault that is isolated: index of its residual, since when it is there, when it was isolated."""

    residual: int
    onset_s: float
    isolated_s: float


class Jumps:
    """How far readings have jumped away from where they were, tick by tick.

    Parameters
    ----------
    rule : JumpRule
    sample_time_s : float

    Attributes
    ----------
    away : list of float
        By how much each reading has jumped so far, in its unit; 0: it has not, or has jumped back.
    """

    def __init__(self, rule: JumpRule, sample_time_s: float) -> None:
        self._rule = rule
        self._watched = tuple((i, least) for i, least in enumerate(rule.smallest) if least < math.inf)
        self._recent: deque[tuple[float, float, float]] = deque(maxlen=max(4, round(rule.memory_s / sample_time_s)))
        self.away = [0.0, 0.0, 0.0]

    def forget(self) -> None:
        """Begin anew, as after a gap: what the readings did before tells nothing of the next move."""
        self._recent.clear()

    def step(self, p_e: float, superheat: float, wall: float) -> bool:
        """Look at the readings of one tick, Pa, K and degC; return whether one of them has jumped."""
        recent, now = self._recent, (p_e, superheat, wall)
        recent.append(now)
        last = recent[-2] if len(recent) > 1 else now
        for i, least in self._watched:
            if abs(now[i] - last[i]) > least and self._is_alone(i):
                self.away[i] += now[i] - last[i]
                if abs(self.away[i]) < 0.5 * least:
                    self.away[i] = 0.0
                return True
        return False

    def _is_alone(self, i: int) -> bool:
        """Return whether reading i has moved by far more than it used to while the others stood still."""
        if 2 * len(self._recent) < (self._recent.maxlen or 0):
            return False
        rule, moves = self._rule, np.abs(np.diff(np.array(self._recent), axis=0))
        usual = DEVIATION * np.median(moves[:-1], axis=0)
        still = rule.still * np.clip(rule.still_deviations * usual / rule.still, 1.0, 2.0)
        others_stand = np.delete(moves[-1] < still, i).all()
        return bool(others_stand and moves[-1, i] > rule.deviations * usual[i])


class Decision:
    """The state machine.

    Parameters
    ----------
    rules : Supervision
    jump_rule : JumpRule
    sample_time_s : float

    Attributes
    ----------
    phase : State
    """

    def __init__(self, rules: Supervision, jump_rule: JumpRule, sample_time_s: float) -> None:
        self._rules = rules
        self._jumps = Jumps(jump_rule, sample_time_s)
        self._aftermath_s = jump_rule.aftermath_s
        self._watches = [Watch() for _ in ISOLABLE_KINDS]
        self._isolated: list[Isolated] = []
        self._onset_s = NOT
        self._detected_s = NOT
        self._away_since = NOT  # since when a reading is where it has jumped to
        self._back_since = NOT  # since when it is back
        self._go_to(State.QUIET)

    def step(self, time_s: float, ratios: list[float], p_e: float, superheat: float, wall: float) -> Conclusion:
        """Conclude from this tick.

        Parameters
        ----------
        time_s : float
        ratios : list of float
            `|r_i| / threshold_i` of each residual.
        p_e, superheat, wall : float
            Readings [Pa, K, degC].
        """
        if self._jumps.step(p_e, superheat, wall):
            self._follow_jump(time_s)
        rules = self._rules
        for i, watch in enumerate(self._watches):
            ratio = ratios[i]
            if ratio >= rules.clear_ratio or watch.below == NOT or watch.above != NOT:  # or nothing changes
                watch.update(time_s, ratio, max(ratios[:i] + ratios[i + 1 :]), rules.cross_talk[i], rules)
        if self._away_since != NOT and self._stays_away(time_s):
            self._enter_unknown(time_s)
        else:
            for action in self._actions:
                action(self, time_s)
        return self._concluded

    def forget_jumps(self) -> None:
        """Go over a gap in the readings: the next ones are no jump."""
        self._jumps.forget()

    def state(self) -> dict[str, Any]:
        """Return what a decision that takes this one's place has to know, fit for JSON (inf included)."""
        return {
            "state": self.phase.value,
            "watches": [asdict(watch) for watch in self._watches],
            "isolated": [asdict(one) for one in self._isolated],
            "times": [self._onset_s, self._detected_s, self._away_since, self._back_since],
            "away": list(self._jumps.away),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take the place of the decision whose `state` this is.

        Raises
        ------
        KeyError, TypeError, ValueError
            When it is none.
        """
        phase = State(state["state"])
        watches = [Watch(**watch) for watch in state["watches"]]
        isolated = [Isolated(**one) for one in state["isolated"]]
        onset_s, detected_s, away_since, back_since = [float(value) for value in state["times"]]
        first, second, third = [float(value) for value in state["away"]]
        if len(watches) != len(self._watches):
            msg = f"{len(watches)} residuals, expected {len(self._watches)}"
            raise ValueError(msg)
        self._watches, self._isolated = watches, isolated
        self._onset_s, self._detected_s, self._away_since, self._back_since = (
            onset_s,
            detected_s,
            away_since,
            back_since,
        )
        self._jumps.forget()
        self._jumps.away = [first, second, third]
        self._go_to(phase)

    # -- actions ------------------------------------------------------------------------------------------------

    def _begin(self, time_s: float) -> None:
        """Begin a detection when a residual calls for it, with the first of those that it is about."""
        since = [watch.above for watch in self._watches if watch.under_way]
        if not since:
            return
        self._onset_s = min(since)
        self._detected_s = time_s
        self._go_to(State.DETECTED)

    def _isolate(self, time_s: float) -> None:
        """Add to the isolated faults those whose residuals now say so; not while a reading's jump is looked at."""
        if len(self._isolated) == len(self._watches) or self._away_since != NOT:
            return
        rules, known = self._rules, self._known
        leads = not known and time_s - self._detected_s < rules.undecided_s
        hold_s = rules.isolate_s if leads else rules.also_isolate_s
        for i, watch in enumerate(self._watches):
            if i not in known and time_s - (watch.leads if leads else watch.exceeds) >= hold_s:
                onset_s = watch.above if self._isolated else self._onset_s
                self._isolated.append(Isolated(i, onset_s, time_s))
                watch.under_way = True
                self._go_to(State.ISOLATED)

    def _end(self, time_s: float) -> None:
        """Forget what is over; what then is left without an isolated fault is a detection of its own."""
        clear_s = self._rules.clear_s
        over = [time_s - watch.below >= clear_s for watch in self._watches]
        if True not in over:
            return
        left = [known for known in self._isolated if not over[known.residual]]
        is_last = bool(self._isolated) and not left
        self._isolated = left
        for watch, ends in zip(self._watches, over, strict=True):
            watch.under_way = watch.under_way and not ends
        if is_last:
            self._look_anew(time_s)
        elif not any(watch.under_way for watch in self._watches):
            self._rest()
        else:
            self._conclude()

    def _look_anew(self, time_s: float) -> None:
        """Begin with what the residuals say now, whatever they said before."""
        for watch in self._watches:
            watch.under_way = time_s - watch.above >= self._rules.confirm_s
        self._rest()
        self._begin(time_s)

    def _rest(self) -> None:
        """Go back to where nothing is detected."""
        self._onset_s = NOT
        self._go_to(State.QUIET)

    def _follow_jump(self, time_s: float) -> None:
        """Note since when a reading is where it has jumped to, or back."""
        if any(self._jumps.away):
            self._away_since, self._back_since = min(self._away_since, time_s), NOT
        else:
            self._away_since, self._back_since = NOT, time_s

    def _stays_away(self, time_s: float) -> bool:
        """Return whether a reading has been away for so long that there must be a fault."""
        return self.phase is not State.UNKNOWN and time_s - self._away_since >= self._rules.confirm_s

    def _enter_unknown(self, time_s: float) -> None:
        """Isolate a fault that no filter is for; the residuals of the others say nothing while it is there."""
        self._isolated = [Isolated(-1, self._away_since, time_s)]
        self._onset_s = self._away_since
        self._go_to(State.UNKNOWN)

    def _leave_unknown(self, time_s: float) -> None:
        """Let the unknown fault be over when no residual, or not its reading, has told of it for long enough."""
        small_since = max(self._isolated[0].isolated_s, *(watch.below for watch in self._watches))
        is_small = time_s - small_since >= self._rules.clear_s
        if not is_small and time_s - self._back_since < self._aftermath_s:
            return
        self._isolated = []
        self._away_since = self._back_since = NOT
        self._jumps.away = [0.0, 0.0, 0.0]
        self._look_anew(time_s)

    def _go_to(self, phase: State) -> None:
        self.phase = phase
        self._conclude()
        self._actions = _ACTIONS[phase]  # not looked up at every tick: the hash of an enum takes its time

    def _conclude(self) -> None:
        """Put into words what holds until the phase, or what is isolated, is another."""
        self._known = {one.residual for one in self._isolated}
        if self._isolated:
            last = self._isolated[-1]
            also = ISOLABLE_KINDS[self._isolated[0].residual] if len(self._isolated) > 1 else None
            kind = UNKNOWN if last.residual < 0 else ISOLABLE_KINDS[last.residual]
            self._concluded = Conclusion(True, kind, last.residual, last.onset_s, last.isolated_s, also)
        elif self._onset_s != NOT:
            self._concluded = Conclusion(True, None, -1, self._onset_s, math.nan, None)
        else:
            self._concluded = NOTHING


#: What is done in each state, in this order, unless a jump ends it.
_ACTIONS: dict[State, tuple[Callable[[Decision, float], None], ...]] = {
    State.QUIET: (Decision._begin,),
    State.DETECTED: (Decision._isolate, Decision._end),
    State.ISOLATED: (Decision._isolate, Decision._end),
    State.UNKNOWN: (Decision._leave_unknown,),
}
