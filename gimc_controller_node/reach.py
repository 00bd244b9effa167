"""How much of q is let through where the references lead: less where the linear model is less true.

Every Q is as good as the linear model behind it. Elsewhere than at the operating point `f_e` depends on q, which closes
a second loop. The references say where the plant will be, and the gain margin of that loop there is known when the
design is made (`ac_design.reach`): q is scaled so that a margin is left, a gain schedule. What this
does not foresee is left to `gimc_controller_node.authority`.
"""

import numpy as np
from numpy.typing import NDArray

from gimc_controller_node.compiled import Array, jit

Vector = NDArray[np.float64]

SLOWER_UP = 10.0
"""How many times longer than to go out the gain takes to come back: the plant follows its references with a lag."""

# Layout of what a `Reach` remembers, and of what it is made of: whether the gain takes its target at once, too.
REACH_GAIN, _TARGET, _AT_ONCE, _DOWN, _UP = range(5)
N_REACH = 5


@jit
def approach(m: Array) -> None:
    """Take the gain of a memory a tick nearer to its target."""
    if m[_AT_ONCE] != 0.0:
        m[REACH_GAIN], m[_AT_ONCE] = m[_TARGET], 0.0
    m[REACH_GAIN] += min(max(m[_TARGET] - m[REACH_GAIN], -m[_DOWN]), m[_UP])


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
    memory : ndarray, shape (N_REACH,), optional
        Where it is to keep the gain.

    Raises
    ------
    ValueError
        When the shapes do not belong together.
    """

    def __init__(
        self,
        rest: Vector,
        offsets: Vector,
        excess: Vector,
        sample_time_s: float,
        fade_time_s: float,
        memory: Array | None = None,
    ) -> None:
        shapes = rest.shape, offsets.shape, excess.shape
        if rest.size and not (shapes[0] == (2,) and shapes[1] == shapes[2] and offsets.ndim == 2 and len(offsets) == 2):
            raise ValueError(f"reach of shapes {shapes}; needed (2,), (2, m), (2, m)")
        self._rest: list[float] = rest.tolist()
        self._offsets, self._excess = offsets, excess
        self._memory = np.empty(N_REACH) if memory is None else memory
        down = sample_time_s / fade_time_s
        self._memory[:] = 1.0, 1.0, 0.0, down, down / SLOWER_UP
        self._known: tuple[float, float] | None = None

    @property
    def gain(self) -> float:
        """The gain at present."""
        return float(self._memory[REACH_GAIN])

    def restore(self, gain: float) -> None:
        """Go on from this gain, whatever the first reference is."""
        self._memory[REACH_GAIN], self._known = gain, (np.nan, np.nan)

    def aim(self, pressure: float, superheat: float) -> None:
        """Let `approach` go to the gain of these references [Pa, K]; to that of the first ones it goes at once."""
        if not self._rest or (pressure, superheat) == self._known:
            return
        excess = (
            float(np.interp(value - rest, offsets, known))
            for value, rest, offsets, known in zip(
                (pressure, superheat), self._rest, self._offsets, self._excess, strict=True
            )
        )
        self._memory[_TARGET], self._memory[_AT_ONCE] = 1.0 / max(1.0, *excess), self._known is None
        self._known = (pressure, superheat)

    def step(self, pressure: float, superheat: float) -> float:
        """Return the gain of this tick, with these references [Pa, K]."""
        self.aim(pressure, superheat)
        approach(self._memory)
        return self.gain
