"""How far the compensator may go: q within what the designs are for, and none at all where they are not valid.

Every Q is as good as the linear model behind it. With that model `f_e` does not depend on q (Lemma 1 of the paper); far
from the operating point it does, through what the plant is not linear, and that second loop can be unstable. K0 needs
no such model. So q is bounded, its direction kept, by a stated multiple of what faults and disturbances of the design's
size make of it. A q that would go beyond that bound is the sign of a plant that is not the model's (or of a fault far
beyond the design's size): q then fades out, which leaves K0, and comes back when what it would be has been small for a
while, for a start with half its gain and a part of the bound: a loop that runs away with all of q may well be stable
with half of it (`python -m ac_design.analysis.loop_stability` prints the gain margins). Each time that it does not keep
well it stays away four times as long and comes back with half the gain it had.
"""

import numpy as np
from numpy.typing import NDArray

from ac_common.arrays import same_shape
from gimc_controller_node.compiled import Array, jit

DESIGN_RANGE = 5.0
"""Bound of q: this many times its peak after a fault or a step of the air flow of the design's size, each by itself."""

RETURN_RATIO = 0.25
"""Part of the bound below which q has to stay, if it were let through, before it is let through again."""

FIRST_WAIT_S, LONGER, LONGEST_WAIT_S = 60.0, 4.0, 3600.0
"""How long it has to stay there: after the first time, how many times longer after each further one, and at most."""

KEPT_WELL = 60.0
"""After this many times the last wait in service, what was before is forgotten, and the bound is whole again."""

PROBATION = 0.4
"""Part of the bound until then."""

LESS_GAIN, LEAST_GAIN = 0.5, 0.125
"""Of its gain until then: the part that is left after each time that it did not keep well, and at least."""


# Layout of what an `Authority` remembers, and of what it is made of.
_OUTSIDE, _SHARE, GAIN, _BOUND, _WAIT_S, _IN_SERVICE_S, _QUIET_S = range(7)
_SPEED, _VALVE, _SAMPLE_TIME_S, _SHARE_STEP = range(7, 11)
N_AUTHORITY = 11


@jit
def let_through(m: Array, speed: float, valve: float) -> float:
    """As `Authority.step`, on its memory."""
    ratio = max(abs(speed) / m[_SPEED], abs(valve) / m[_VALVE])
    if m[_OUTSIDE] != 0.0:
        m[_QUIET_S] = m[_QUIET_S] + m[_SAMPLE_TIME_S] if ratio < RETURN_RATIO else 0.0
        if m[_QUIET_S] >= m[_WAIT_S]:
            m[_OUTSIDE], m[_BOUND], m[_IN_SERVICE_S] = 0.0, PROBATION, 0.0
    else:
        m[_IN_SERVICE_S] += m[_SAMPLE_TIME_S]
        proven = m[_IN_SERVICE_S] >= KEPT_WELL * m[_WAIT_S]
        if proven:
            m[_BOUND] = m[GAIN] = 1.0
        if ratio > m[_BOUND]:
            m[_WAIT_S] = FIRST_WAIT_S if proven else min(LONGER * m[_WAIT_S], LONGEST_WAIT_S)
            m[GAIN] = max(LESS_GAIN * m[GAIN], LEAST_GAIN)
            m[_OUTSIDE], m[_QUIET_S] = 1.0, 0.0
    target = 0.0 if m[_OUTSIDE] != 0.0 else m[GAIN]
    m[_SHARE] += min(max(target - m[_SHARE], -m[_SHARE_STEP]), m[_SHARE_STEP])
    share: float = m[_SHARE]
    return share * min(m[_BOUND] / ratio, 1.0) if ratio > 0.0 else share


class Authority:
    """The part of q that is let through, tick by tick.

    Parameters
    ----------
    q_range : ndarray, shape (2,)
        Bounds of q [rad/s, 0..1].
    sample_time_s : float
    fade_time_s : float
        How long q takes to go out, or to come back, in a straight line.
    memory : ndarray, shape (N_AUTHORITY,), optional
        Where it is to keep what it knows.

    Raises
    ------
    ValueError
        When a bound is not above zero.
    """

    def __init__(
        self, q_range: NDArray[np.float64], sample_time_s: float, fade_time_s: float, memory: Array | None = None
    ) -> None:
        if q_range.shape != (2,) or not (q_range > 0.0).all():
            raise ValueError(f"bounds of q are {q_range.tolist()}; allowed: two numbers above zero")
        self._memory = np.empty(N_AUTHORITY) if memory is None else memory
        self._memory[:] = (0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, *q_range, sample_time_s, sample_time_s / fade_time_s)
        self._known = self._memory[:_SPEED]

    @property
    def outside(self) -> bool:
        """Whether q is kept out, or on its way out."""
        return bool(self._memory[_OUTSIDE])

    def step(self, speed: float, valve: float) -> float:
        """Return the factor, 0 to 1, on the q [rad/s, 0..1] that the filters ask for."""
        return let_through(self._memory, speed, valve)

    def state(self) -> list[float]:
        """Return what one that takes this one's place has to know."""
        known: list[float] = self._known.tolist()
        return known

    def restore(self, state: list[float]) -> None:
        """Take the place of the one whose `state` this is."""
        self._known[:] = same_shape(state, self._known)
