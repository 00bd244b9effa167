"""Reference governor: a reference runs ahead of the plant no further than the plant's gains stay what they are.

K0 is linear; what it wants at once for a large step takes the plant through conditions in which it is another one (at
the low point the valve shuts). So of a step only `lead` is passed on at once, and the rest as the plant follows: here
by a lag that stands for the loop. Nothing measured enters, so no loop is closed, faults pass K0 and Q as ever, and a
step of at most `lead` is passed on to the last bit. A reference governor in its simplest form (Garone, Di Cairano and
Kolmanovsky 2017, "Reference and command governors for systems with constraints", Automatica 75).
"""

import math


class ReferenceGovernor:
    """One reference as K0 is given it, tick by tick; the first tick's is given as it is, unless `start` came before.

    Parameters
    ----------
    lead : float
        How far the reference may be ahead of where the loop is expected to be; in the reference's unit [Pa or K].
    lag_s : float
        Time constant with which the loop is expected to follow [s].
    sample_time_s : float
    """

    def __init__(self, lead: float, lag_s: float, sample_time_s: float) -> None:
        self._lead = lead
        self._share = -math.expm1(-sample_time_s / lag_s)
        self._expected: float | None = None

    def start(self, output: float) -> None:
        """Begin anew with the loop at this output [Pa or K]."""
        self._expected = output

    def governed(self, reference: float) -> float:
        """Return what K0 is to be given for this reference now; nothing moves on."""
        expected = self._expected
        if expected is None or not abs(reference - expected) > self._lead:
            return reference
        return expected + math.copysign(self._lead, reference - expected)

    def step(self, reference: float) -> float:
        """Return what K0 is to be given, and go on to the next tick."""
        passed = self.governed(reference)
        expected = passed if self._expected is None else self._expected
        self._expected = expected + self._share * (passed - expected)
        return passed
