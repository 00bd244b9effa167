"""Reference governor: a reference runs ahead of the plant no further than the plant's gains stay what they are.

K0 is linear; what it wants at once for a large step takes the plant through conditions in which it is another one (at
the low point the valve shuts). So of a step only `lead` is passed on at once, and the rest as the plant follows: here
by a lag that stands for the loop. Nothing measured enters, so no loop is closed, faults pass K0 and Q as ever, and a
step of at most `lead` is passed on to the last bit. A reference governor in its simplest form (Garone, Di Cairano and
Kolmanovsky 2017, "Reference and command governors for systems with constraints", Automatica 75).
"""

import math
from collections.abc import Sequence


class ReferenceGovernor:
    """The references that K0 is given, tick by tick.

    Parameters
    ----------
    lead : sequence of float
        How far each reference may be ahead of where the loop is expected to be.
    lag_s : sequence of float
        Time constants with which the loop is expected to follow.
    sample_time_s : float
    """

    def __init__(self, lead: Sequence[float], lag_s: Sequence[float], sample_time_s: float) -> None:
        self._lead = list(lead)
        self._share = [-math.expm1(-sample_time_s / lag) for lag in lag_s]
        self._expected: list[float] | None = None

    @property
    def is_started(self) -> bool:
        """Whether it knows where the loop is."""
        return self._expected is not None

    def start(self, outputs: Sequence[float]) -> None:
        """Begin anew with the loop at these outputs."""
        self._expected = list(outputs)

    def governed(self, references: Sequence[float]) -> list[float]:
        """What K0 is to be given for these references now; nothing moves on.

        Raises
        ------
        ValueError
            Before `start`.
        """
        if self._expected is None:
            raise ValueError("the governor does not know where the loop is: start it first")
        return [
            expected + math.copysign(lead, reference - expected) if abs(reference - expected) > lead else reference
            for reference, expected, lead in zip(references, self._expected, self._lead, strict=True)
        ]

    def step(self, references: Sequence[float]) -> list[float]:
        """As `governed`, and on to the next tick."""
        passed = self.governed(references)
        self._expected = [
            expected + share * (reference - expected)
            for reference, expected, share in zip(passed, self._expected or passed, self._share, strict=True)
        ]
        return passed
