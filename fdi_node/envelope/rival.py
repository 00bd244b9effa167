"""The other explanation of a fault that has a name: an observer beside, for which the other fault has begun.

When a fault is isolated, f_N and f_p may explain it nearly alike. So both are followed from then on, each by an
observer of its own that corrects its estimate on, and the innovations of both say which is right (hypotheses with a
filter each: Magill, IEEE TAC 10(4), 1965, 434). Both are judged by the same variances, the larger of theirs: variances
that are too large in one of them, as where the superheated zone is short, tell nothing of the fault. When an air flow
has jumped, that is accepted by both at once, each with the size that it sees: otherwise the later one would pay for it.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ac_common.arrays import same_shape
from ac_plant_node.properties.tables import Tables
from fdi_node.envelope import filter as kalman
from fdi_node.envelope.explanations import Explanations
from fdi_node.envelope.limits import Limits
from fdi_node.envelope.memory import LARGEST, Memory, memory_of, rules_in

Vector = NDArray[np.float64]


def evidence(memory: Memory, other: Memory) -> float:
    """Return twice the logarithm by which the readings of a tick are likelier for the `other` observer."""
    sizes = np.maximum(memory.sizes, other.sizes)
    own, its = (np.minimum((m.white * m.sizes / sizes) ** 2, kalman.MOST).sum() for m in (memory, other))
    return float(own - its)


class Rival:
    """An observer whose fault is another one than that which has the name.

    Parameters
    ----------
    flat, packed : ndarray
        Memory and rules, copied: of the other observer before it has accepted its fault.
    unknown : int
        The fault of this one.

    Attributes
    ----------
    memory : Memory
    rules : Rules
    evidence : float
        Twice the logarithm by which the other's explanation is the likelier.
    is_lost : bool
        Whether the state cannot be continued.
    """

    def __init__(self, flat: Vector, packed: Vector, unknown: int) -> None:
        self._flat, self._packed, self.unknown = flat.copy(), packed.copy(), unknown
        self.rules = rules_in(self._packed)
        self.memory = memory_of(self._flat, len(self.rules.rows), len(self.rules.jumping))
        self.evidence, self.is_lost = 0.0, False

    def begin(self, explanations: Explanations, top: int) -> None:
        """Accept this one's fault in place of another, `top`."""
        ratios = self.memory.ratios.tolist()
        own = explanations.best_of(self.unknown, ratios)
        self.evidence = ratios[top] - ratios[own]
        kalman.accept_jump(self._flat, self.rules, own, True)

    def observe(self, reading: Vector, told: Vector, tables: Tables) -> None:
        """Do as `fdi_node.envelope.filter.observe`."""
        kalman.observe(self._flat, self._packed, reading, told, tables)

    def predict(self, told: Vector, tables: Tables) -> None:
        """Do as `fdi_node.envelope.filter.predict`."""
        self.is_lost = self.is_lost or kalman.predict(self._flat, self._packed, told, tables) != 0

    def compare(self, other: Memory) -> None:
        """Weigh the readings of a tick."""
        self.evidence += evidence(self.memory, other)

    def leaves_nothing(self, limits: Limits) -> bool:
        """Return whether nothing else has to have jumped for this observer."""
        return bool(self.memory.scalars[LARGEST] < limits.likely)

    def accept_air_flow(self, top: int) -> None:
        """Take it that an air flow has jumped."""
        kalman.accept_jump(self._flat, self.rules, top, False)

    def change_places(self, flat: Vector, unknown: int) -> None:
        """Give this estimate to the other observer, whose fault is `unknown`, and take its one."""
        flat[:], self._flat[:] = self._flat.copy(), flat.copy()
        self.unknown, self.evidence = unknown, -self.evidence

    def state(self) -> dict[str, Any]:
        """Return what a rival that takes this one's place has to know, fit for JSON."""
        return {"memory": self._flat.tolist(), "unknown": self.unknown, "evidence": self.evidence}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take the place of the rival whose `state` this is; `KeyError`, `TypeError`, `ValueError`: it is none."""
        self._flat[:] = same_shape(state["memory"], self._flat)
        self.evidence = float(state["evidence"])
