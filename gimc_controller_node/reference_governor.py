"""Reference governor: a reference runs ahead of the plant no further than the plant's gains stay what they are.

K0 is linear; what it wants at once for a large step takes the plant through conditions in which it is another one (at
the low point the valve shuts). So of a step only `lead` is passed on at once, and the rest as the plant follows: here
by a lag that stands for the loop. Nothing measured enters, so no loop is closed, faults pass K0 and Q as ever, and a
step of at most `lead` is passed on to the last bit. A reference governor in its simplest form (Garone, Di Cairano and
Kolmanovsky 2017, "Reference and command governors for systems with constraints", Automatica 75).
"""

import math

import numpy as np

from gimc_controller_node.compiled import Array, jit

# Layout of what a `ReferenceGovernor` remembers, nan when it is not known yet, and of what it is made of.
_EXPECTED, _LEAD, _PART = range(3)
N_GOVERNOR = 3


@jit
def governed(m: Array, reference: float) -> float:
    """As `ReferenceGovernor.governed`, on its memory."""
    ahead = reference - m[_EXPECTED]
    if not abs(ahead) > m[_LEAD]:
        return reference
    passed: float = m[_EXPECTED] + math.copysign(m[_LEAD], ahead)
    return passed


@jit
def pass_on(m: Array, reference: float) -> float:
    """As `ReferenceGovernor.step`, on its memory."""
    passed = governed(m, reference)
    expected = passed if math.isnan(m[_EXPECTED]) else m[_EXPECTED]
    m[_EXPECTED] = expected + m[_PART] * (passed - expected)
    return passed


class ReferenceGovernor:
    """One reference as K0 is given it, tick by tick; the first tick's is given as it is, unless `start` came before.

    Parameters
    ----------
    lead : float
        How far the reference may be ahead of where the loop is expected to be; in the reference's unit [Pa or K].
    lag_s : float
        Time constant with which the loop is expected to follow [s].
    sample_time_s : float
    memory : ndarray, shape (N_GOVERNOR,), optional
        Where it is to keep what it knows.
    """

    def __init__(self, lead: float, lag_s: float, sample_time_s: float, memory: Array | None = None) -> None:
        self._memory = np.empty(N_GOVERNOR) if memory is None else memory
        self._memory[:] = math.nan, lead, -math.expm1(-sample_time_s / lag_s)

    def start(self, output: float) -> None:
        """Begin anew with the loop at this output [Pa or K]."""
        self._memory[_EXPECTED] = output

    def governed(self, reference: float) -> float:
        """Return what K0 is to be given for this reference now; nothing moves on."""
        return governed(self._memory, reference)

    def step(self, reference: float) -> float:
        """Return what K0 is to be given, and go on to the next tick."""
        return pass_on(self._memory, reference)
