"""Whether what is isolated may be over: an observer beside that has begun anew and for which nothing is off.

An observer that goes over a gap with faults that it keeps, or cannot say what is wrong, has learned from readings that
it does not understand. It may need minutes to forget that, although all faults are over. One that has begun since
needs no more than its start. So the faults are over when that one understands the readings and the other does not
explain them better (hypotheses with a filter each, as `fdi_node.envelope.rival`).
"""

import numpy as np
from numpy.typing import NDArray

from ac_plant_node.dynamics.balances import N_STATES
from ac_plant_node.properties.tables import Tables
from fdi_node.envelope import filter as kalman
from fdi_node.envelope.decision import EnvelopeDecision
from fdi_node.envelope.isolation import NOT
from fdi_node.envelope.jumps import begin_all
from fdi_node.envelope.memory import AGE, NIS, TICKS, Memory, memory_of, rules_in
from fdi_node.envelope.model import ENERGY
from fdi_node.envelope.quiet import SETTLE_S
from fdi_node.envelope.rival import evidence
from fdi_node.envelope.unknowns import NATURAL, Unknown

Vector = NDArray[np.float64]
BEGINNING = 0.5
"""Standard deviations of the states where it begins, in units of their scales."""


class Afresh:
    """An observer with a decision of its own.

    Parameters
    ----------
    flat : ndarray
        Memory of the other observer, copied: this one begins where that one is.
    packed : ndarray
        The rules.
    unknowns : tuple of Unknown
    other : EnvelopeDecision
        The other observer's decision.

    Attributes
    ----------
    flat : ndarray
    memory : Memory
    decision : EnvelopeDecision
    evidence : float
        Twice the logarithm by which the other observer's explanation is the likelier.
    """

    def __init__(self, flat: Vector, packed: Vector, unknowns: tuple[Unknown, ...], other: EnvelopeDecision) -> None:
        self.flat, self._packed, self._limits = flat.copy(), packed, other.limits
        rules = rules_in(packed)
        m = self.memory = memory_of(self.flat, len(rules.rows), len(rules.jumping))
        deviations = np.sqrt(np.maximum(np.diag(m.P), 0.0))
        deviations[:N_STATES] = BEGINNING
        deviations[ENERGY] = 0.0
        for i, one in enumerate(unknowns):
            if one.reported == NATURAL:
                deviations[N_STATES + i] = one.first / one.scale
            elif one.reported:
                m.x[i] = deviations[N_STATES + i] = 0.0
        m.P[:] = 0.0
        np.fill_diagonal(m.P, deviations**2)
        m.scalars[[TICKS, NIS, AGE]] = 0.0, 1.0, rules.constants[1]
        begin_all(m, rules)
        self.decision = EnvelopeDecision(other.limits, unknowns, self.flat, packed, other.isolation.is_open)
        self.evidence, self._is_lost, self._h = 0.0, False, float(rules.constants[0])

    def observe(self, reading: Vector, told: Vector, tables: Tables) -> None:
        """Do as `fdi_node.envelope.filter.observe`."""
        kalman.observe(self.flat, self._packed, reading, told, tables)

    def predict(self, told: Vector, tables: Tables) -> None:
        """Do as `fdi_node.envelope.filter.predict`."""
        self._is_lost = self._is_lost or kalman.predict(self.flat, self._packed, told, tables) != 0

    def compare(self, other: Memory, time_s: float) -> bool | None:
        """Weigh the readings of a tick; return whether nothing is off, None while that cannot be said."""
        said, decision, limits = self.decision.step(time_s), self.decision, self._limits
        age_s = self.memory.scalars[TICKS] * self._h - decision.asked[SETTLE_S]
        if self._is_lost or said.detected or decision.doubts:
            return False
        if age_s <= 0.0:
            return None
        self.evidence += evidence(self.memory, other)
        is_calm = decision.since.likely == NOT and self.memory.scalars[NIS] < limits.consistent
        if not is_calm or self.evidence > limits.settled:
            return False
        if age_s < limits.afresh_s:
            return None
        return self.evidence < limits.better
