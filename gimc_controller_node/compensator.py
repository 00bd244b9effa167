"""The compensator at run time: `q = Q f_e`, with Q_act or Q_sen as the isolation says.

Both filters run all the time, so that the one that is let in has seen the fault from its first moment; which of them
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
    """Sampled Q_act and Q_sen side by side: one block-diagonal filter from f_e to both q's.

    Attributes
    ----------
    a : ndarray, shape (n, n)
    b : ndarray, shape (n, 3)
        Input f_e [Pa, K, K].
    c : ndarray, shape (4, n)
        Rows 0-1: q of Q_act, rows 2-3: q of Q_sen [rad/s, 0..1].
    d : ndarray, shape (4, 3)
    fade_time_s : float
        Time over which a filter is faded in or out.
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
        self._share = np.zeros(2)
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
            q [rad/s, 0..1]; zero as long as no fault has been isolated.
        """
        design = self.design
        both = design.c @ self._state + design.d @ innovation
        self._state = design.a @ self._state + design.b @ innovation
        for i, fault in enumerate(FAULTS):
            wanted = 1.0 if self.accommodate and isolated == fault else 0.0
            self._share[i] += min(max(wanted - self._share[i], -self._rate), self._rate)
        q: Vector = self._share[0] * both[:2] + self._share[1] * both[2:]
        return q
