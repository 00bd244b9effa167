"""The compensator at run time: `q = Q f_e`, with the Q that the isolation calls for.

A Q for both faults at once, the guard, acts all the time: plant outputs move within tenths of a second of a fault,
sooner than anything can be isolated, and a second fault may come any time. Q_act or Q_sen, each for its own fault
alone, has the say at rest as soon as that fault is isolated:

    q = Q_both f_e + LP (Q_i f_e - Q_both f_e)     LP: a low-pass, at rest while nothing or both are isolated

Let in at once, Q_act would take a second fault, of the pressure reading, for one of its own, and move the pressure by
more than that fault's size before it can be isolated.

After a manoeuvre the linear observer is off by what the plant is not linear, and all filters take that for small
faults. So what each gives at rest is forgotten slowly while no fault is isolated; what was forgotten is held while one
is.

Both low-passes are of second order: what a fault brings in before it is isolated, some seconds, is next to nothing.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bringup.topics import FAULTS
from fdi_node.cache import Arrays

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
    handover_time_s : float
        Time constants with which Q_act or Q_sen takes over from the guard.
    fade_time_s : float
        Time constant with which it goes out again.
    washout_time_s : float
        Time constants with which what is there at rest is forgotten.
    sample_time_s : float
    """

    a: Vector
    b: Vector
    c: Vector
    d: Vector
    handover_time_s: float
    fade_time_s: float
    washout_time_s: float
    sample_time_s: float

    @classmethod
    def from_arrays(cls, arrays: Arrays) -> "CompensatorDesign":
        """Design from the arrays that the cache stores."""
        matrices = {name: np.ascontiguousarray(arrays[name]) for name in ("a", "b", "c", "d")}
        names = ("handover_time_s", "fade_time_s", "washout_time_s", "sample_time_s")
        return cls(**matrices, **{name: float(arrays[name]) for name in names})  # type: ignore[arg-type]


class Compensator:
    """The filters' state, the fade, and the step.

    Parameters
    ----------
    design : CompensatorDesign
    accommodate : bool
        False leaves K0 alone (`q = 0`), for the passive runs. May be changed between two steps: the filters run on
        either way, and `q` goes to nothing, or comes back, in a straight line over the design's `fade_time_s`.
    """

    def __init__(self, design: CompensatorDesign, accommodate: bool = True) -> None:
        self.design = design
        self.accommodate = accommodate
        self._state = np.zeros(len(design.a))
        self._forgotten = np.zeros((2, 6))
        self._correction = np.zeros((2, 2))
        self._share = float(accommodate)  # of q that is let through
        self._share_step = design.sample_time_s / design.fade_time_s
        times = (design.handover_time_s, design.fade_time_s, design.washout_time_s)
        self._hands_over, self._fades, self._forgets = (-math.expm1(-design.sample_time_s / time) for time in times)

    def step(self, innovation: Vector, isolated: str | None, also_isolated: str | None = None) -> Vector:
        """Signal q of this tick.

        Parameters
        ----------
        innovation : ndarray, shape (3,)
            f_e [Pa, K, K].
        isolated : str or None
            The isolated fault: "compressor_speed", "evaporator_pressure", or None.
        also_isolated : str or None
            The other one, when both are.

        Returns
        -------
        ndarray, shape (2,)
            q [rad/s, 0..1].
        """
        design = self.design
        signals = design.c @ self._state + design.d @ innovation
        self._state = design.a @ self._state + design.b @ innovation
        kept = signals - self._forgotten[1]
        if isolated is None:
            _low_pass(self._forgotten, signals, self._forgets)
        guard: Vector = kept[:2]
        if isolated is None or also_isolated is not None:
            self._correction *= 1.0 - self._fades
        else:
            row = 2 + 2 * FAULTS.index(isolated)
            _low_pass(self._correction, kept[row : row + 2] - guard, self._hands_over)
        change = self._share_step if self.accommodate else -self._share_step
        self._share = min(max(self._share + change, 0.0), 1.0)
        q: Vector = self._share * (guard + self._correction[1]) if self._share > 0.0 else np.zeros(2)
        return q


def _low_pass(state: Vector, signal: Vector, rate: float) -> None:
    """Two lags in a row, in place: `state[0]` follows `signal`, `state[1]` follows `state[0]`."""
    state[0] += rate * (signal - state[0])
    state[1] += rate * (state[0] - state[1])
