"""Diagonal state scalings, by powers of two so that they cost no rounding error."""

import numpy as np

from gimc.systems import Abcd, Matrix


def balancing_scales(A: Matrix, B: Matrix, C: Matrix, *, sweeps: int = 20) -> Matrix:
    """Scales d (n,) with `x = d * x_scaled` that reduce the 1-norm of `[[A, B], [C, 0]]`.

    The restriction of Osborne's balancing to the state (as SLICOT's TB01ID): each sweep makes row and column of a state
    equally large.
    """
    n = A.shape[0]
    d = np.ones(n)
    off = np.abs(A - np.diag(np.diag(A)))
    inputs, outputs = np.abs(B).sum(axis=1), np.abs(C).sum(axis=0)
    for _ in range(sweeps):
        changed = False
        for i in range(n):
            row = (off[i] @ d + inputs[i]) / d[i]
            column = (off[:, i] @ (1.0 / d) + outputs[i]) * d[i]
            if row <= 0 or column <= 0:
                continue
            factor = 2.0 ** np.round(0.5 * np.log2(row / column))
            if factor not in (0.5, 1.0, 2.0) or (row / factor + column * factor) < 0.95 * (row + column):
                d[i] *= factor
                changed = changed or factor != 1.0
        if not changed:
            break
    return d


def balance_states(sys: Abcd) -> Abcd:
    """Same transfer function, state scaled by `balancing_scales`."""
    d = balancing_scales(sys.A, sys.B, sys.C)
    return Abcd(sys.A * d[None, :] / d[:, None], sys.B / d[:, None], sys.C * d[None, :], sys.D)


def normalise_signals(sys: Abcd) -> Abcd:
    """Every column of B and row of C divided by its norm (D left out): only for questions about the state alone."""
    columns, rows = np.linalg.norm(sys.B, axis=0), np.linalg.norm(sys.C, axis=1)
    return Abcd(
        sys.A, sys.B / np.where(columns > 0, columns, 1.0), sys.C / np.where(rows > 0, rows, 1.0)[:, None], sys.D
    )
