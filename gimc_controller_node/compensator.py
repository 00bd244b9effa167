"""The compensator at run time: `q = Q f_e`, with the Q that the isolation calls for.

As long as no fault is isolated a Q for both faults at once stands guard: plant outputs move within tenths of a second
of a fault, sooner than anything can be isolated. Q_act or Q_sen, each for its own fault alone, then takes over.

All filters run all the time, so that the one that is let in has seen the fault from its first moment; which of them
reaches the controller is faded over, never switched.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdi_node.cache import Arrays
from fdi_node.detector import FAULTS

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class CompensatorDesign:
    """Sampled guard, Q_act and Q_sen side by side: one block-diagonal filter from f_e to the three q's.

    Attributes
    ----------
    a : ndarray, shape (n, n)
    b : ndarray, shape (n, 3)
        Input f_e [Pa, K, K].
    c : ndarray, shape (6, n)
        Rows 0-1: q of the guard, rows 2-3: of Q_act, rows 4-5: of Q_sen [rad/s, 0..1].
    d : ndarray, shape (6, 3)
    fade_time_s : float
        Time over which one filter takes over from another.
    sample_time_s : float
    """

    a: Vector
    b: Vector
    c: Vector
    d: Vector
    fade_time_s: float
    sample_time_s: float

    @classmethod
    def from_arrays(cls, arrays: Arrays) -> "CompensatorDesign":
        """Design from the arrays that the cache stores."""
        matrices = {name: np.ascontiguousarray(arrays[name]) for name in ("a", "b", "c", "d")}
        return cls(**matrices, fade_time_s=float(arrays["fade_time_s"]), sample_time_s=float(arrays["sample_time_s"]))


class Compensator:
    """The filters' state, the fade, and the step.

    Parameters
    ----------
    design : CompensatorDesign
    accommodate : bool
        False leaves K0 alone (`q = 0`), for the passive runs.
    """

    def __init__(self, design: CompensatorDesign, accommodate: bool = True) -> None:
        self.design = design
        self.accommodate = accommodate
        self._state = np.zeros(len(design.a))
        self._share = np.array([1.0, 0.0, 0.0])
        self._rate = min(1.0, design.sample_time_s / design.fade_time_s)

    def step(self, innovation: Vector, isolated: str | None) -> Vector:
        """Signal q of this tick.

        Parameters
        ----------
        innovation : ndarray, shape (3,)
            f_e [Pa, K, K].
        isolated : str or None
            The isolated fault: "compressor_speed", "evaporator_pressure", or None.

        Returns
        -------
        ndarray, shape (2,)
            q [rad/s, 0..1].
        """
        design = self.design
        signals = design.c @ self._state + design.d @ innovation
        self._state = design.a @ self._state + design.b @ innovation
        if not self.accommodate:
            return np.zeros(2)
        chosen = 0 if isolated is None else 1 + FAULTS.index(isolated)
        self._share -= self._rate
        self._share[chosen] += 2.0 * self._rate
        np.clip(self._share, 0.0, 1.0, out=self._share)
        self._share /= self._share.sum()
        q: Vector = self._share @ signals.reshape(3, 2)
        return q
