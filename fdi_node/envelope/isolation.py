"""Which faults are isolated, and what follows from that for the observer.

What is not isolated at once keeps its name as long as it explains the readings better than the other named fault would
(`fdi_node.envelope.rival`).
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ac_common.faults import UNKNOWN
from ac_plant_node.dynamics.balances import N_STATES
from fdi_node.envelope import filter as kalman
from fdi_node.envelope.explanations import Explanations
from fdi_node.envelope.limits import Limits
from fdi_node.envelope.memory import Rules, memory_of, rules_in
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
    UNITS,
)
from fdi_node.envelope.rival import Rival
from fdi_node.envelope.unknowns import UNKNOWNS, Unknown

NOT = math.inf
"""Time since when something holds that does not hold."""
SMALL_SIGMAS = 2.0
"""An estimate within so many standard deviations, and half of what its threshold is more, is next to nothing."""
MOST_AT_ONCE = 2
"""More faults than these at once are not told apart: whoever sees more has lost the plant."""


@dataclass
class Isolated:
    """A fault that is isolated.

    Position of its unknown (-1: none), name, times, since when it is small, whether it was isolated at once, how often
    it has moved of late, and when it did last; whether its name has been ahead of the other one by `Limits.better`, and
    by `Limits.kept` since, or there is no doubt about it: accommodation waits for that.
    """

    unknown: int
    name: str
    onset_s: float
    isolated_s: float
    small_since: float = NOT
    is_abrupt: bool = False
    moves: float = 0.0
    moved_s: float = 0.0
    is_sure: bool = True

    def rests(self, time_s: float, limits: Limits) -> bool:
        """Take note of a move of this fault; return whether it has moved no more often than it may."""
        self.moves = 1.0 + self.moves * math.exp((self.moved_s - time_s) / limits.restless_s)
        self.moved_s = time_s
        return self.moves <= limits.most_moves


class Isolation:
    """The faults that are isolated.

    Parameters
    ----------
    limits, unknowns, flat, packed, is_open
        As `fdi_node.envelope.decision.EnvelopeDecision`.

    Attributes
    ----------
    faults : list of Isolated
    rival : Rival or None
        The other explanation of the fault that is isolated, while it may be right.
    asked : ndarray
        What `fdi_node.envelope.quiet.is_quiet` is asked.
    is_open : bool
        Whether the plant's parameters are estimated.
    is_kept : bool
        Whether what is isolated has been kept over a gap.
    is_lost : bool
        Whether more seems to be off than can be told apart, so that the observer has to begin anew.
    """

    def __init__(
        self,
        limits: Limits,
        unknowns: tuple[Unknown, ...],
        flat: NDArray[np.float64],
        packed: NDArray[np.float64],
        is_open: bool,
    ) -> None:
        self._limits, self._unknowns, self._flat, self._packed = limits, unknowns, flat, packed
        self._rules = rules_in(packed)
        self._memory = memory_of(flat, len(unknowns), len(self._rules.jumping))
        self._quiet_q = self._rules.Q.copy()
        self.asked = _asked(limits, unknowns)
        self.faults: list[Isolated] = []
        self.rival: Rival | None = None
        self.is_open, self.is_kept, self.is_lost = is_open, False, False
        self._set_drifts()

    @property
    def is_doubtful(self) -> bool:
        """Return whether what is isolated may be over for long before its estimate says so."""
        return bool(self.faults) and (self.is_kept or any(one.name == UNKNOWN for one in self.faults))

    def withdraw(self) -> None:
        """Forget all faults."""
        self.faults.clear()
        self.rival = None
        self._set_drifts()
        for unknown, row in enumerate(self._unknowns[:NAMED]):
            kalman.settle(self._flat, self._rules, unknown, (row.first / row.scale) ** 2)

    def open_up(self) -> None:
        """Begin anew with the plant's parameters estimated."""
        self.faults.clear()
        self.is_open = True
        self.begin_anew()

    def begin_anew(self) -> None:
        """Go over a gap: what is isolated stays so."""
        self.rival, self.is_kept, self.is_lost = None, bool(self.faults), False
        self._set_drifts()

    def add(self, new: Isolated) -> None:
        """Isolate a fault, unless it is already."""
        for one in self.faults:
            if (one.unknown, one.name) == (new.unknown, new.name):
                one.small_since = NOT
                if one.name != UNKNOWN and not one.rests(new.isolated_s, self._limits):
                    self.add(Isolated(-1, UNKNOWN, one.onset_s, new.isolated_s))
                return
        self.is_kept = self.is_kept and bool(self.faults)
        new.is_sure = bool(self.faults) or self._is_ahead
        self.faults.append(new)
        if sum(one.unknown >= 0 for one in self.faults) > MOST_AT_ONCE:
            self.faults[:] = [Isolated(-1, UNKNOWN, self.faults[0].onset_s, new.isolated_s)]
            self.is_lost = True
        self._set_drifts()

    def end(self, time_s: float) -> None:
        """Forget the faults whose estimates say that they are over; others end by `withdraw`."""
        for one in list(self.faults):
            if one.name == UNKNOWN or not self._is_within(one.unknown):
                one.small_since = NOT
                continue
            one.small_since = min(one.small_since, time_s)
            if time_s - one.small_since < self._limits.clear_s:
                continue
            self.faults.remove(one)
            self._set_drifts()
            row = self._unknowns[one.unknown]
            kalman.settle(self._flat, self._rules, one.unknown, (row.first / row.scale) ** 2)

    def doubt(self, explanations: Explanations, top: int) -> None:
        """Before `top` is accepted, let an observer accept the other named fault in its place."""
        unknown = explanations.positions[top]
        if not self.faults and unknown < NAMED:
            self.rival = Rival(self._flat, self._packed, 1 - unknown)
            self.rival.begin(explanations, top)

    def compare(self, time_s: float) -> bool:
        """Let the other explanation have the name if that is the better one, and return whether it is.

        When it is no good one either, or names change too often, the fault is unknown.
        """
        rival = self.rival
        if rival is None:
            return False
        rival.compare(self._memory)
        is_alone = [one.unknown for one in self.faults] == [1 - rival.unknown]
        is_better = is_alone and rival.evidence < -self._limits.better
        if is_alone and not rival.is_lost:
            one = self.faults[0]
            one.is_sure = rival.evidence >= (self._limits.kept if one.is_sure else self._limits.better)
        if rival.is_lost or not is_alone or rival.evidence > self._limits.settled:
            self.rival = None
        elif is_better:
            was, unknown = self.faults[0], rival.unknown
            if not (rival.leaves_nothing(self._limits) and was.rests(time_s, self._limits)):
                self.rival = None
                self.add(Isolated(-1, UNKNOWN, was.onset_s, time_s))
                return True
            rival.change_places(self._flat, was.unknown)
            name = self._unknowns[unknown].reported
            self.faults[0] = Isolated(unknown, name, was.onset_s, time_s, moves=was.moves, moved_s=time_s)
        else:
            return False
        self._set_drifts()
        return is_better

    @property
    def _is_ahead(self) -> bool:
        """Whether no other explanation of the named fault is near."""
        return self.rival is None or self.rival.evidence >= self._limits.better

    def state(self) -> dict[str, Any]:
        """Return what one that takes this one's place has to know, fit for JSON (inf included)."""
        rival = None if self.rival is None else self.rival.state()
        faults = [asdict(one) for one in self.faults]
        return {"faults": faults, "is_open": self.is_open, "is_kept": self.is_kept, "rival": rival}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take the place of the one whose `state` this is; `KeyError`, `TypeError`, `ValueError`: it is none."""
        faults, rival = [Isolated(**one) for one in state["faults"]], None
        if any(not -1 <= int(one.unknown) < len(self._unknowns) for one in faults):
            raise ValueError("an isolated fault that is none of the unknowns")
        if state["rival"] is not None:
            unknown = int(state["rival"]["unknown"])
            if unknown not in range(NAMED):
                raise ValueError("a rival whose fault has no name")
            rival = Rival(self._flat, self._packed, unknown)
            rival.restore(state["rival"])
        self.faults[:], self.is_open, self.is_kept = faults, bool(state["is_open"]), bool(state["is_kept"])
        self.rival = rival
        self._set_drifts()

    def _set_drifts(self) -> None:
        """Let the estimates of the isolated faults follow them, and those of the others rest."""
        there, asked, limits = [one.unknown for one in self.faults], self.asked, self._limits
        asked[SETTLE_S] = limits.settle_open_s if self.is_open else limits.settle_s
        asked[IS_THERE : IS_THERE + NAMED] = [i in there for i in range(NAMED)]
        # Other observers have to take every tick, and a fault that is not acted on is none that the loop's code knows.
        is_sure = all(one.is_sure for one in self.faults)
        asked[NEVER] = self.rival is not None or self.is_doubtful or not is_sure
        self._let_drift(self._rules, there)
        if self.rival is not None:
            self._let_drift(self.rival.rules, [self.rival.unknown])

    def _let_drift(self, rules: Rules, there: list[int]) -> None:
        rules.Q[:] = self._quiet_q
        if not self.is_open:
            rules.Q[N_STATES + len(UNKNOWNS) :] = 0.0
        for unknown in there:
            if unknown >= 0:
                row = self._unknowns[unknown]
                rules.Q[N_STATES + unknown] = (row.drift_after / row.scale) ** 2

    def _is_within(self, unknown: int) -> bool:
        """Return whether the estimate of a named fault may as well be none."""
        m, scale = self._memory, self._unknowns[unknown].scale
        small = (0.5 * self._limits.floor_rad_s, 0.5 * self._limits.floor_pa)[unknown]
        deviation = math.sqrt(max(float(m.P[N_STATES + unknown, N_STATES + unknown]), 0.0)) * scale
        return abs(float(m.x[unknown])) < small + SMALL_SIGMAS * deviation


def _asked(limits: Limits, unknowns: tuple[Unknown, ...]) -> NDArray[np.float64]:
    """Return what `fdi_node.envelope.quiet.is_quiet` is asked, while nothing is isolated."""
    asked = np.zeros(N_ASKED)
    asked[SIGMAS], asked[NATURAL_RATIO], asked[INCONSISTENT] = limits.sigmas, limits.natural, limits.inconsistent
    asked[FLOORS : FLOORS + NAMED] = limits.floor_rad_s, limits.floor_pa
    asked[UNITS : UNITS + NAMED] = [one.scale for one in unknowns[:NAMED]]
    asked[LOWEST : LOWEST + NAMED] = limits.lowest_rad_s, -limits.largest_pa
    asked[HIGHEST : HIGHEST + NAMED] = limits.highest_rad_s, limits.largest_pa
    return asked
