"""Which explanation of what has been seen is ahead, and whether it is one at once or a jump of an air flow."""

from typing import NamedTuple

import numpy as np

from ac_common.faults import UNKNOWN
from fdi_node.envelope import jumps
from fdi_node.envelope.limits import Limits
from fdi_node.envelope.memory import Memory, Rules
from fdi_node.envelope.quiet import NAMED
from fdi_node.envelope.unknowns import NATURAL, Unknown

COMPRESSOR, PRESSURE = range(NAMED)


class Leader(NamedTuple):
    """The likeliest explanation.

    `top`: which; `unknown`: the position of its unknown; `reported`: what it is isolated as; `ratio`, and `lead` over
    those of other unknowns; `age_s`: how long ago it has begun; `grows`: whether it does; `has_jumped`: whether it is a
    named fault that has jumped just now, and clearly.
    """

    top: int
    unknown: int
    reported: str
    ratio: float
    lead: float
    age_s: float
    grows: bool
    has_jumped: bool


class Explanations(NamedTuple):
    """Those that may jump, in the order of their ratios.

    `positions`: of their unknowns; `reported`: what a jump of each is isolated as; `valve`: that of a stuck valve.
    """

    positions: list[int]
    reported: list[str]
    valve: int

    @classmethod
    def of(cls, rules: Rules, unknowns: tuple[Unknown, ...]) -> "Explanations":
        """Return those of some rules."""
        positions = [int(i) for i in rules.jumping]
        valve = int(np.flatnonzero(rules.prior < 0.0)[0])
        return cls(positions, [unknowns[i].reported for i in positions], valve)

    def leader(self, m: Memory, rules: Rules, ratios: list[float], limits: Limits) -> Leader:
        """Return the likeliest explanation.

        What has no name counts less by `Limits.rarer`, a stuck valve `Limits.stuck` times what it does.
        """
        rarer = [limits.rarer if name == UNKNOWN else 0.0 for name in self.reported]
        counted = [ratio - less for ratio, less in zip(ratios, rarer, strict=True)]
        counted[self.valve] = limits.stuck * ratios[self.valve]
        top = counted.index(max(counted))
        others = (ratio for ratio, at in zip(counted, self.positions, strict=True) if at != self.positions[top])
        lead, grows = counted[top] - max(others), bool(rules.growing[top])
        age_s = float(m.age[int(m.best[top])] * rules.constants[0])
        is_named = self.reported[top] not in (UNKNOWN, NATURAL)
        stands_out = lead > max(limits.at_once, limits.at_once_share * ratios[top])
        has_jumped = is_named and not grows and age_s <= limits.at_once_s and stands_out
        return Leader(top, self.positions[top], self.reported[top], ratios[top], lead, age_s, grows, has_jumped)

    def age_s(self, m: Memory, h: float) -> float:
        """Return how long ago what explains most has begun; `h`: s a tick."""
        return float(m.age[int(m.best[int(np.argmax(m.ratios))])]) * h

    def best_of(self, unknown: int, ratios: list[float]) -> int:
        """Return the explanation by an unknown that has the largest ratio."""
        return max((h for h, at in enumerate(self.positions) if at == unknown), key=ratios.__getitem__)

    def air_flow_that_jumped(
        self, m: Memory, rules: Rules, ratios: list[float], limits: Limits, is_first: bool
    ) -> int | None:
        """Return which air flow has jumped, if that explains more than any other jump, with what was likely before."""
        top = max((h for h, name in enumerate(self.reported) if name == NATURAL), key=ratios.__getitem__)
        if ratios[top] < limits.natural:
            return None
        before = float(jumps.told_before(m, rules, top)) if is_first else 0.0
        explained = ratios[top] + (before if before > limits.natural else 0.0)
        others = max(ratio for h, ratio in enumerate(ratios) if h != top)
        return top if explained - others > limits.ahead_natural else None

    def weigh(self, ratios: list[float], known: list[int], second: float) -> None:
        """Let what would be a second fault count less by a factor; jumps of air flows are none."""
        for i, (at, name) in enumerate(zip(self.positions, self.reported, strict=True)):
            ratios[i] /= 1.0 if at in known or name == NATURAL else second
