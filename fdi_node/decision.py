"""What is concluded from the residuals: whether there is a fault, which one, and when it is over.

A state machine on the ratios `|r_i| / threshold_i`, with one watch for each residual, and on jumps of readings:

    QUIET     --a residual is above its threshold for confirm_s-->               DETECTED
    DETECTED  --a residual leads for isolate_s, or undecided_s are over-->       ISOLATED
    DETECTED, ISOLATED --the residuals in question are small for clear_s-->      QUIET, or DETECTED anew
    any       --a reading has jumped as no fault of a filter makes it, and stays there for confirm_s-->  UNKNOWN
    UNKNOWN   --all residuals are small for clear_s, or it is back for aftermath_s-->  QUIET, or DETECTED anew

A fault is isolated when its residual leads, and a second one, too, when its residual is then more than the first fault
could make it. Pure bookkeeping: nothing here knows what the residuals are of. The steps themselves are compiled
(`fdi_node.state_machine`).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

import numpy as np

from ac_common.arrays import same_shape
from ac_common.faults import ISOLABLE_KINDS, UNKNOWN
from fdi_node import reading_jumps
from fdi_node import state_machine as machine


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


_STATES = (State.QUIET, State.DETECTED, State.ISOLATED, State.UNKNOWN)  # in the order of the numbers
_WATCH = ("above", "leads", "exceeds", "below", "under_way")
_FAULT = ("residual", "onset_s", "isolated_s")
_TIMES = slice(machine.ONSET_S, machine.KNOWN)
_AWAY = slice(machine.JUMPS + reading_jumps.AWAY, machine.JUMPS + reading_jumps.AWAY + reading_jumps.N_READINGS)
_FIRST_FAULT = machine.FAULTS + machine.FAULT


class Decision:
    """The state machine.

    Parameters
    ----------
    rules : Supervision
    jump_rule : JumpRule
    sample_time_s : float

    Attributes
    ----------
    memory : ndarray
        What it remembers and is made of, for compiled code: see `fdi_node.state_machine`.
    """

    def __init__(self, rules: Supervision, jump_rule: JumpRule, sample_time_s: float) -> None:
        length = max(4, round(jump_rule.memory_s / sample_time_s))
        limits = jump_rule.deviations, jump_rule.still_deviations
        jumps = reading_jumps.new_jumps(jump_rule.smallest, jump_rule.still, *limits, length)
        m = self.memory = np.concatenate([np.zeros(machine.JUMPS), jumps])
        m[machine.CONFIRM_S], m[machine.ISOLATE_S], m[machine.RATIO] = (
            rules.confirm_s,
            rules.isolate_s,
            rules.isolation_ratio,
        )
        m[machine.UNDECIDED_S], m[machine.ALSO_ISOLATE_S] = rules.undecided_s, rules.also_isolate_s
        m[machine.CLEAR_RATIO], m[machine.CLEAR_S] = rules.clear_ratio, rules.clear_s
        m[machine.AFTERMATH_S], m[machine.CROSS_TALK : machine.RATIOS] = jump_rule.aftermath_s, rules.cross_talk
        m[_TIMES] = machine.NOT
        self._watches = m[machine.WATCHES : machine.RULES].reshape(machine.N_RESIDUALS, machine.N_WATCH)
        self._watches[:, : machine.UNDER_WAY] = machine.NOT
        self._faults = m[machine.FAULTS : machine.WATCHES].reshape(machine.N_RESIDUALS, len(_FAULT))
        self._changes, self._concluded = 0, NOTHING

    @property
    def phase(self) -> State:
        """What it is at."""
        return _STATES[int(self.memory[machine.PHASE])]

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
        self.memory[machine.RATIOS : machine.JUMPS] = ratios
        return self.concluded(machine.conclude(self.memory, time_s, p_e, superheat, wall))

    def concluded(self, changes: int) -> Conclusion:
        """Return what it concludes after so many changes of it."""
        if changes != self._changes:
            self._changes, self._concluded = changes, self._in_words()
        return self._concluded

    def forget_jumps(self) -> None:
        """Go over a gap in the readings: the next ones are no jump."""
        self.memory[machine.JUMPS + reading_jumps.SEEN] = 0.0

    def state(self) -> dict[str, Any]:
        """Return what a decision that takes this one's place has to know, fit for JSON (inf included)."""
        m = self.memory
        known: list[list[float]] = self._faults[: int(m[machine.KNOWN])].tolist()
        return {
            "state": self.phase.value,
            "watches": [dict(zip(_WATCH, (*times, bool(on)), strict=True)) for *times, on in self._watches.tolist()],
            "isolated": [dict(zip(_FAULT, (int(one), *times), strict=True)) for one, *times in known],
            "times": m[_TIMES].tolist(),
            "away": m[_AWAY].tolist(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take the place of the decision whose `state` this is.

        Raises
        ------
        KeyError, TypeError, ValueError
            When it is none.
        """
        phase = _STATES.index(State(state["state"]))
        watches = [[float(watch[name]) for name in _WATCH] for watch in state["watches"]]
        isolated = [[float(fault[name]) for name in _FAULT] for fault in state["isolated"]]
        times, away = same_shape(state["times"], self.memory[_TIMES]), same_shape(state["away"], self.memory[_AWAY])
        residuals = range(-1, machine.N_RESIDUALS)
        if len(watches) != machine.N_RESIDUALS or len(isolated) > machine.N_RESIDUALS:
            msg = f"{len(watches)} residuals, expected {machine.N_RESIDUALS}, and {len(isolated)} isolated faults"
            raise ValueError(msg)
        if not all(fault[0] in residuals for fault in isolated):
            raise ValueError(f"isolated faults {isolated}; their residuals must be {residuals}")
        m = self.memory
        m[machine.PHASE], m[machine.KNOWN], m[_TIMES], m[_AWAY] = phase, len(isolated), times, away
        self._watches[:], self._faults[: len(isolated)] = watches, np.reshape(isolated, (-1, len(_FAULT)))
        self.forget_jumps()
        self._concluded = self._in_words()

    def _in_words(self) -> Conclusion:
        """Put into words what holds until the phase, or what is isolated, is another."""
        m = self.memory
        if known := int(m[machine.KNOWN]):
            (residual, onset_s, isolated_s), first = self._faults[known - 1].tolist(), int(m[_FIRST_FAULT])
            also = ISOLABLE_KINDS[first] if known > 1 else None
            kind = UNKNOWN if residual < 0 else ISOLABLE_KINDS[int(residual)]
            return Conclusion(True, kind, int(residual), onset_s, isolated_s, also)
        if m[machine.ONSET_S] != machine.NOT:
            return Conclusion(True, None, -1, float(m[machine.ONSET_S]), math.nan, None)
        return NOTHING
