"""Whether a tick leaves nothing to conclude, as most do: the first question of the decision."""

import numpy as np

from ac_plant_node.dynamics.balances import N_STATES
from fdi_node.envelope.compiled import Array, jit
from fdi_node.envelope.jumps import begin_all
from fdi_node.envelope.memory import JUMPED, LARGEST, NIS, TICKS, Memory, Rules, memory_of, rules_in

NAMED = 2
"""The first so many unknowns are the faults of `ac_common.faults.ISOLABLE`."""
SIGMAS, FLOORS, UNITS, LOWEST, HIGHEST, IS_THERE = 0, 1, 3, 5, 7, 9
NATURAL_RATIO, INCONSISTENT, SETTLE_S, NEVER = range(11, 15)
"""Layout of what the question is about: of the named faults' thresholds the standard deviations and what is added to
them, the units of both, what the faults can be, and which of them are isolated; the likelihood ratio and the mean
square from which on there is something; the time after the start until which nothing is concluded; whether what is
isolated has to be looked at in every tick, as what has no name."""
N_ASKED = 15


@jit
def is_quiet(flat: Array, packed: Array, asked: Array, thresholds: Array) -> bool:
    """Return whether neither the estimates of the named faults nor likelihoods nor innovations ask for a conclusion.

    The estimate of a fault that is isolated does not as long as it is beyond its threshold. For a while after the start
    nothing does, unless a fault is isolated: what the start leaves behind is forgotten.

    Parameters
    ----------
    flat, packed : array
        As `fdi_node.envelope.filter.observe`.
    asked : (N_ASKED,) array
    thresholds : (2,) array
        Result: of the named faults' estimates, found in any case.
    """
    rules = rules_in(packed)
    return leaves_nothing(memory_of(flat, rules.rows.shape[0], rules.jumping.shape[0]), rules, asked, thresholds)


@jit
def leaves_nothing(m: Memory, rules: Rules, asked: Array, thresholds: Array) -> bool:
    """Do as `is_quiet`, on the parts of both arrays."""
    is_healthy = asked[NEVER] == 0.0
    calm = is_healthy and m.scalars[JUMPED] == 0.0
    for i in range(NAMED):
        at = N_STATES + i
        deviation = np.sqrt(max(m.P[at, at], 0.0)) * asked[UNITS + i]
        thresholds[i] = asked[SIGMAS] * deviation + asked[FLOORS + i]
        if asked[IS_THERE + i] != 0.0:
            is_healthy = False
            calm = calm and abs(m.x[i]) > thresholds[i] and asked[LOWEST + i] <= m.x[i] <= asked[HIGHEST + i]
        else:
            calm = calm and abs(m.x[i]) <= thresholds[i]
    if not m.scalars[TICKS] * rules.constants[0] > asked[SETTLE_S]:
        begin_all(m, rules)
        return bool(is_healthy)
    explained = m.scalars[LARGEST] < asked[NATURAL_RATIO] and m.scalars[NIS] < asked[INCONSISTENT]
    return bool(calm and explained)
