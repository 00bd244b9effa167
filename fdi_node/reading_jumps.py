"""How far readings have jumped away from where they were, tick by tick.

`away`, in the memory, is by how much each reading has jumped so far, in its unit; 0: it has not, or has jumped back.
The readings of the last ticks stand in a ring, and behind that is room to find medians in.
"""

import numpy as np

from fdi_node.compiled import Array, jit

N_READINGS = 3
DEVIATION = 1.4826
"""Standard deviation of a normal variable over the median of its magnitude: one jump does not change a median."""

# Layout: away, and of the `JumpRule` smallest, still, `deviations` and `still_deviations`; the ring's length, how many
# ticks are in it, and the place of the next one.
AWAY, SMALLEST, STILL = range(0, 9, N_READINGS)
DEVIATIONS, STILL_DEVIATIONS, _LENGTH, SEEN, _NEXT, _RING = range(9, 15)


def new_jumps(
    smallest: tuple[float, ...],
    still: tuple[float, ...],
    deviations: float,
    still_deviations: float,
    length: int,
) -> Array:
    """Return the memory of jumps with a ring for so many ticks; the rest is as in `fdi_node.decision.JumpRule`."""
    m = np.zeros(_RING + length * (N_READINGS + 1))
    m[SMALLEST:STILL], m[STILL:DEVIATIONS], m[_LENGTH] = smallest, still, length
    m[DEVIATIONS], m[STILL_DEVIATIONS] = deviations, still_deviations
    return m


@jit
def _before(m: Array, i: int, ticks: int) -> float:
    """Return reading i so many ticks before the last one."""
    length = int(m[_LENGTH])
    value: float = m[_RING + N_READINGS * ((int(m[_NEXT]) - 1 - ticks) % length) + i]
    return value


@jit
def _usual(m: Array, i: int) -> float:
    """Return the standard deviation of the moves of reading i before the last one."""
    n, first = int(m[SEEN]) - 2, _RING + N_READINGS * int(m[_LENGTH])
    for k in range(n):
        move = abs(_before(m, i, k + 1) - _before(m, i, k + 2))
        if np.isnan(move):
            return float(np.nan)
        at = k
        while at > 0 and m[first + at - 1] > move:
            m[first + at] = m[first + at - 1]
            at -= 1
        m[first + at] = move
    if n == 0:
        return float(np.nan)
    return float(DEVIATION * ((m[first + (n - 1) // 2] + m[first + n // 2]) / 2.0))


@jit
def _is_alone(m: Array, i: int) -> bool:
    """Return whether reading i has moved by far more than it used to while the others stood still."""
    if 2.0 * m[SEEN] < m[_LENGTH]:
        return False
    for j in range(N_READINGS):
        move, usual, still = abs(_before(m, j, 0) - _before(m, j, 1)), _usual(m, j), m[STILL + j]
        if j == i:
            stands_out = move > m[DEVIATIONS] * usual
        else:
            stands_out = move < still * min(max(m[STILL_DEVIATIONS] * usual / still, 1.0), 2.0)
        if not stands_out:
            return False
    return True


@jit
def look_for_jump(m: Array, p_e: float, superheat: float, wall: float) -> bool:
    """Look at the readings of one tick, Pa, K and degC; return whether one of them has jumped."""
    at = _RING + N_READINGS * int(m[_NEXT])
    m[at], m[at + 1], m[at + 2] = p_e, superheat, wall
    m[_NEXT] = (m[_NEXT] + 1.0) % m[_LENGTH]
    m[SEEN] = min(m[SEEN] + 1.0, m[_LENGTH])
    if m[SEEN] < 2.0:
        return False
    for i in range(N_READINGS):
        least, move = m[SMALLEST + i], _before(m, i, 0) - _before(m, i, 1)
        if abs(move) > least and _is_alone(m, i):
            m[AWAY + i] += move
            if abs(m[AWAY + i]) < 0.5 * least:
                m[AWAY + i] = 0.0
            return True
    return False
