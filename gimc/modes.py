"""Modes that an input does not reach or an output does not see, at which a synthesis has no solution."""

import numpy as np

from gimc.interconnect import Matrix

MODE_TOLERANCE = 1e-11  # smallest singular value of [A - lambda I, B], relative to its largest


def unreachable_mode(A: Matrix, B: Matrix) -> complex | None:
    """Return an eigenvalue of A in the closed right half plane that B does not reach (PBH test), or None."""
    n = A.shape[0]
    columns = np.linalg.norm(B, axis=0)
    size = np.linalg.norm(A, 1) if n else 1.0
    Bn = B / np.where(columns > 0, columns, 1.0) * max(size, 1e-300)
    for eigenvalue in np.linalg.eigvals(A) if n else ():
        if eigenvalue.real < -1e-13 * size:
            continue
        s = np.linalg.svd(np.hstack([A - eigenvalue * np.eye(n), Bn]), compute_uv=False)
        if s[-1] <= MODE_TOLERANCE * s[0]:
            return complex(eigenvalue)
    return None


def axis_zero(A: Matrix, C: Matrix) -> float | None:
    """Return the frequency of an imaginary-axis eigenvalue of A that C does not see, or None."""
    n = A.shape[0]
    size = np.linalg.norm(A, 1) if n else 1.0
    for eigenvalue in np.linalg.eigvals(A) if n else ():
        if abs(eigenvalue.real) > 1e-12 * size:
            continue
        s = np.linalg.svd(np.vstack([A - 1j * eigenvalue.imag * np.eye(n), C]), compute_uv=False)
        if s[-1] <= MODE_TOLERANCE * s[0]:
            return abs(float(eigenvalue.imag))
    return None
