"""How much of q is let through where the references lead: less where the linear model is less true.

Every Q is as good as the linear model behind it. Elsewhere than at the operating point `f_e` depends on q, which closes
a second loop. The references say where the plant will be, and the gain margin of that loop there is known when the
design is made (`ac_design.reach`): q is scaled so that a margin is left, a gain schedule. What this
does not foresee is left to `gimc_controller_node.authority`.
"""

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

SLOWER_UP = 10.0
"""How many times longer than to go out the gain takes to come back: the plant follows its references with a lag."""


class Reach:
    """The gain of q, tick by tick; one until a first reference is known.

    Parameters
    ----------
    rest : ndarray, shape (2,) or (0,)
        References of p_e [Pa] and SH [K] at the operating point; empty: the gain is one everywhere.
    offsets : ndarray, shape (2, m)
        Where it is known, ascending: p_e [Pa] and SH [K] off the operating point, each by itself.
    excess : ndarray, shape (2, m)
        How many times larger all of q is there than it may be; up to one it may stay as it is. The larger of the two
        counts, straight lines between, level beyond. (What f_e sees of q grows with the distance, about in proportion.)
    sample_time_s : float
    fade_time_s : float
        How long the gain takes from one to nothing, in a straight line; the other way `SLOWER_UP` times that.

    Raises
    ------
    ValueError
        When the shapes do not belong together.

    Attributes
    ----------
    gain : float
        At present.
    """

    def __init__(self, rest: Vector, offsets: Vector, excess: Vector, sample_time_s: float, fade_time_s: float) -> None:
        shapes = rest.shape, offsets.shape, excess.shape
        if rest.size and not (shapes[0] == (2,) and shapes[1] == shapes[2] and offsets.ndim == 2 and len(offsets) == 2):
            raise ValueError(f"reach of shapes {shapes}; needed (2,), (2, m), (2, m)")
        self._rest: list[float] = rest.tolist()
        self._offsets, self._excess = offsets, excess
        self._down = sample_time_s / fade_time_s
        self._up = self._down / SLOWER_UP
        self._known: tuple[float, float] | None = None
        self._target = 1.0
        self.gain = 1.0

    @property
    def is_whole(self) -> bool:
        """Whether all of q is let through."""
        return self.gain > 1.0 - 1e-9

    def restore(self, gain: float) -> None:
        """Go on from this gain, whatever the first reference is."""
        self.gain, self._known = gain, (np.nan, np.nan)

    def step(self, pressure: float, superheat: float) -> float:
        """Return the gain of this tick, with these references [Pa, K]."""
        if not self._rest:
            return 1.0
        if (pressure, superheat) != self._known:
            excess = (
                float(np.interp(value - rest, offsets, known))
                for value, rest, offsets, known in zip(
                    (pressure, superheat), self._rest, self._offsets, self._excess, strict=True
                )
            )
            self._target = 1.0 / max(1.0, *excess)
            if self._known is None:
                self.gain = self._target
            self._known = (pressure, superheat)
        self.gain += min(max(self._target - self.gain, -self._down), self._up)
        return self.gain
