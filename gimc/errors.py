"""Errors of the synthesis, one class for each thing that can be wrong with a problem.

All derive from `SynthesisError`, itself a `ValueError`: the message is one line that says what was wrong, where, and
what helps.
"""


class SynthesisError(ValueError):
    """A design problem that cannot be solved as posed."""


class UnstableError(SynthesisError):
    """A system that has to be stable has a pole in the closed right half plane."""


class NotStabilisableError(SynthesisError):
    """An unstable mode that the control input does not reach."""


class NotDetectableError(SynthesisError):
    """An unstable mode that the measurement does not see."""


class RankDeficientD12Error(SynthesisError):
    """Some combination of control inputs is not penalised at infinite frequency."""


class RankDeficientD21Error(SynthesisError):
    """Some combination of measurements is free of noise at infinite frequency."""


class ImaginaryAxisZeroError(SynthesisError):
    """P12 or P21 loses rank at a finite frequency."""


class IllPosedError(SynthesisError):
    """An algebraic loop without solution."""


class RiccatiError(SynthesisError):
    """A Riccati equation without stabilising solution."""


class InfeasibleError(SynthesisError):
    """No stabilising controller reaches any norm that was tried."""


class NormMismatchError(SynthesisError):
    """The norm recomputed from the closed loop disagrees with the one the synthesis claims."""
