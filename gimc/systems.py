"""Types that everything in the folder shares."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]
Response = NDArray[np.complex128]


class Abcd(NamedTuple):
    """Matrices of `x' = A x + B u, y = C x + D u`: shapes (n, n), (n, m), (p, n), (p, m)."""

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix


def in_series(*systems: Abcd) -> Abcd:
    """Return `G1 G2 ... Gk`, the last one acting first; the shapes have to fit."""
    result = systems[-1]
    for left in reversed(systems[:-1]):
        n, k = left.A.shape[0], result.A.shape[0]
        A = np.block([[left.A, left.B @ result.C], [np.zeros((k, n)), result.A]])
        B = np.vstack([left.B @ result.D, result.B])
        result = Abcd(A, B, np.hstack([left.C, left.D @ result.C]), left.D @ result.D)
    return result
