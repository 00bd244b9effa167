"""What `acftc design` prints of one block: the norm that the synthesis claims, and what the check of it found."""

import json
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class BlockReport:
    """Report of one synthesis.

    Attributes
    ----------
    block : str
        "K0", "H_N" and "H_p" (the rows of H), "Q_both", "Q_act" or "Q_sen".
    claimed : float
        Norm that the Riccati solutions promise.
    achieved : float
        Norm of the closed loop with the full-order result, from a sweep over frequency.
    achieved_reduced : float
        The same with the result after order reduction.
    plain : float
        For H, the norm of the paper's problem with the reduced row: without the weight on the error. For the
        compensators, of the problem without rho and eps, with the full-order result; noise and model uncertainty, which
        `MatchingWeights` has beyond the paper, are included. For K0, without the regularisation.
    lower_bound : float
        Lower bound of the norm (nan: none known).
    order, order_reduced : int
    regularisation : str
        What was added to make the problem regular, in design units.
    slowest_pole_rad_s : float
        Largest real part of the poles of the reduced block; negative: stable.
    seconds : float
        Time that the synthesis took when it was computed.
    """

    block: str
    claimed: float
    achieved: float
    achieved_reduced: float
    plain: float
    lower_bound: float
    order: int
    order_reduced: int
    regularisation: str
    slowest_pole_rad_s: float
    seconds: float

    def to_array(self) -> NDArray[Any]:
        """Return the report as a 0-d array of text, which the cache stores beside the matrices."""
        return np.array(json.dumps(asdict(self)))

    @classmethod
    def from_array(cls, text: NDArray[Any]) -> "BlockReport":
        """Return the report that `to_array` wrote."""
        return cls(**json.loads(str(text)))
