"""Modes that signals do not reach, and zeros on the imaginary axis, judged in a way that no units disturb."""

import numpy as np
from numpy.typing import NDArray

from gimc.interconnect import Matrix, equilibrated

MODE_TOLERANCE = 1e-11  # smallest singular value of an equilibrated pencil, relative to its largest
AXIS_TOLERANCE = 1e-12  # real part of an eigenvalue on the axis, relative to the matrix
DEFECTIVE_TOLERANCE = 1e-7  # of one that belongs to a chain: rounding spreads those by a root
ROUNDING = 1e-14  # singular value asked of the latter


def unreachable_mode(A: Matrix, B: Matrix) -> complex | None:
    """Return an eigenvalue of A in the closed right half plane that B does not reach, or None.

    Popov-Belevitch-Hautus test on `[A - lambda I, B]` with rows and columns equilibrated: units of states and inputs
    are scalings of these, so they do not matter.

    Parameters
    ----------
    A, B : ndarray, shapes (n, n) and (n, m)
    """
    n = A.shape[0]
    size = float(np.linalg.norm(A, 1)) if n else 1.0
    for eigenvalue in np.linalg.eigvals(A) if n else ():
        if eigenvalue.real < -1e-13 * size:
            continue
        if _smallest(equilibrated(np.hstack([_shifted(A, eigenvalue), B]))) <= MODE_TOLERANCE:
            return complex(eigenvalue)
    return None


def axis_zero(A: Matrix, B: Matrix, C: Matrix, D: Matrix) -> float | None:
    """Return the frequency (rad/s) of a zero of (A, B, C, D) on the imaginary axis, or None.

    Zero of a system whose D has full column rank: there the columns of `[A - s I, B; C, D]` are dependent. Candidates
    are eigenvalues of `A - B D^+ C`; whether they are on the axis is asked of the pencil, in which nothing cancels.
    Units of states and inputs do not matter, nor does a common one of all outputs.

    Parameters
    ----------
    A, B, C, D : ndarray, shapes (n, n), (n, m), (p, n) and (p, m)
    """
    n = A.shape[0]
    if n == 0:
        return None
    feedback = np.linalg.pinv(D) @ C
    size = float(np.linalg.norm(A, 1) + np.linalg.norm(np.abs(B) @ np.abs(feedback), 1))
    for eigenvalue in np.linalg.eigvals(A - B @ feedback):
        distance = abs(eigenvalue.real)
        if distance > DEFECTIVE_TOLERANCE * size:
            continue
        frequency = abs(float(eigenvalue.imag))
        if frequency <= AXIS_TOLERANCE * size:
            frequency = 0.0
        pencil = np.vstack([np.hstack([_shifted(A, 1j * frequency), B]), np.hstack([C, D])])
        tolerance = MODE_TOLERANCE if distance <= AXIS_TOLERANCE * size else ROUNDING
        if _smallest(equilibrated(pencil, block=C.shape[0])) <= tolerance:
            return frequency
    return None


def _shifted(A: Matrix, eigenvalue: complex) -> NDArray[np.complex128]:
    """`A - lambda I` with a diagonal of which rounding alone is left set to zero: equilibration would blow it up."""
    shifted = A - eigenvalue * np.eye(A.shape[0])
    diagonal = np.diag(shifted)
    negligible = np.abs(diagonal) <= 1e-14 * (np.abs(np.diag(A)) + abs(eigenvalue))
    np.fill_diagonal(shifted, np.where(negligible, 0.0, diagonal))
    return np.asarray(shifted, dtype=complex)


def _smallest(matrix: NDArray[np.complex128]) -> float:
    """Smallest singular value, relative to the largest."""
    values = np.linalg.svd(matrix, compute_uv=False)
    return float(values[-1] / values[0]) if values[0] > 0 else 0.0
