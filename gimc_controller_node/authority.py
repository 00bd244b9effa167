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


class Authority:
    """The part of q that is let through, tick by tick.

    Parameters
    ----------
    q_range : ndarray, shape (2,)
        Bounds of q [rad/s, 0..1].
    sample_time_s : float
    fade_time_s : float
        How long q takes to go out, or to come back, in a straight line.

    Raises
    ------
    ValueError
        When a bound is not above zero.

    Attributes
    ----------
    outside : bool
        Whether q is kept out, or on its way out.
    """

    def __init__(self, q_range: NDArray[np.float64], sample_time_s: float, fade_time_s: float) -> None:
        if q_range.shape != (2,) or not (q_range > 0.0).all():
            raise ValueError(f"bounds of q are {q_range.tolist()}; allowed: two numbers above zero")
        self._speed, self._valve = q_range.tolist()
        self._sample_time_s, self._share_step = sample_time_s, sample_time_s / fade_time_s
        self.outside = False
        self._share, self._gain, self._bound = 1.0, 1.0, 1.0
        self._wait_s, self._in_service_s, self._quiet_s = 0.0, 0.0, 0.0

    @property
    def on_probation(self) -> bool:
        """Whether q went beyond its bounds and has not kept well for long enough since."""
        return self._gain < 1.0

    def step(self, speed: float, valve: float) -> float:
        """Return the factor, 0 to 1, on the q [rad/s, 0..1] that the filters ask for."""
        ratio = max(abs(speed) / self._speed, abs(valve) / self._valve)
        if self.outside:
            self._quiet_s = self._quiet_s + self._sample_time_s if ratio < RETURN_RATIO else 0.0
            if self._quiet_s >= self._wait_s:
                self.outside, self._bound, self._in_service_s = False, PROBATION, 0.0
        else:
            self._in_service_s += self._sample_time_s
            proven = self._in_service_s >= KEPT_WELL * self._wait_s
            if proven:
                self._bound = self._gain = 1.0
            if ratio > self._bound:
                self._wait_s = FIRST_WAIT_S if proven else min(LONGER * self._wait_s, LONGEST_WAIT_S)
                self._gain = max(LESS_GAIN * self._gain, LEAST_GAIN)
                self.outside, self._quiet_s = True, 0.0
        target = 0.0 if self.outside else self._gain
        self._share += min(max(target - self._share, -self._share_step), self._share_step)
        return self._share * min(self._bound / ratio, 1.0) if ratio > 0.0 else self._share

    def state(self) -> list[float]:
        """Return what one that takes this one's place has to know."""
        own = (self._share, self._gain, self._bound, self._wait_s, self._in_service_s, self._quiet_s)
        return [float(self.outside), *own]

    def restore(self, state: list[float]) -> None:
        """Take the place of the one whose `state` this is."""
        outside, self._share, self._gain, self._bound, self._wait_s, self._in_service_s, self._quiet_s = state
        self.outside = bool(outside)
