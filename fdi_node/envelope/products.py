"""Products with the transition and with gains, as the filter and its windows need them: loops that vectorise.

The inner loop runs along the rows of an array and takes four terms for three rows at a time, so that little is fetched
and stored. Numbers are of the precision of that array: double for the covariance, single for what jumps do, of which
twice as many are taken at a time.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ac_plant_node.dynamics.balances import N_STATES
from fdi_node.envelope.compiled import Array, jit
from fdi_node.envelope.model import ENERGY, PARAMETER, PLACE, READING

Reals = NDArray[np.floating[Any]]
_TERMS = 4


@jit
def terms(rows: Array, P: Array, all_of_them: bool, found: Array) -> int:
    """Find the columns of the transition that count, as many as is a multiple of four; return how many.

    Those of readings' errors are zero, and those of what is known exactly (`P`) meet zeros, unless it may jump and
    `all_of_them` are wanted. They are filled up with `ENERGY`, whose column and row are zero.
    """
    n, count = P.shape[0], 0
    for i in range(n):
        counts = i != ENERGY and (i < N_STATES or rows[i - N_STATES, PLACE] != READING)
        may_jump = i < N_STATES or rows[i - N_STATES, PLACE] != PARAMETER
        if counts and ((all_of_them and may_jump) or P[i, i] != 0.0):
            found[count] = i
            count += 1
    while count % _TERMS != 0:
        found[count] = ENERGY
        count += 1
    return count


@jit
def multiply(F: Array, V: Reals, columns: Array, count: int, w: int, D: Reals) -> None:
    """Work out the first `w` columns of `D` (12, .) = F V; `columns` of F and rows of V, `count` of them: `terms`."""
    real = V.dtype.type
    for i in range(0, N_STATES, 3):
        for j in range(w):
            D[i, j] = D[i + 1, j] = D[i + 2, j] = real(0.0)
        for at in range(0, count, _TERMS):
            a, b, c, d = int(columns[at]), int(columns[at + 1]), int(columns[at + 2]), int(columns[at + 3])
            f, g, h, k = real(F[i, a]), real(F[i, b]), real(F[i, c]), real(F[i, d])
            p, q, r, s = real(F[i + 1, a]), real(F[i + 1, b]), real(F[i + 1, c]), real(F[i + 1, d])
            t, x, y, z = real(F[i + 2, a]), real(F[i + 2, b]), real(F[i + 2, c]), real(F[i + 2, d])
            for j in range(w):
                v_a, v_b, v_c, v_d = V[a, j], V[b, j], V[c, j], V[d, j]
                D[i, j] = D[i, j] + f * v_a + g * v_b + h * v_c + k * v_d
                D[i + 1, j] = D[i + 1, j] + p * v_a + q * v_b + r * v_c + s * v_d
                D[i + 2, j] = D[i + 2, j] + t * v_a + x * v_b + y * v_c + z * v_d


@jit
def subtract(K: Array, gains: Array, G: Reals, n: int, V: Reals) -> None:
    """V <- V - K' diag(gains) G in the first `n` rows of V (n, w); K (4, n), gains (4,), G (4, w)."""
    real = V.dtype.type
    for i in range(n):
        a, b = real(K[0, i] * gains[0]), real(K[1, i] * gains[1])
        c, d = real(K[2, i] * gains[2]), real(K[3, i] * gains[3])
        if a != 0.0 or b != 0.0 or c != 0.0 or d != 0.0:
            for j in range(G.shape[1]):
                V[i, j] = V[i, j] - a * G[0, j] - b * G[1, j] - c * G[2, j] - d * G[3, j]


@jit
def combine(C: Array, V: Reals, G: Reals) -> None:
    """Work out `G` (4, w) = C V; C (4, n), V (n, w)."""
    real = V.dtype.type
    for j in range(G.shape[1]):
        G[0, j] = G[1, j] = G[2, j] = G[3, j] = real(0.0)
    n = C.shape[1]
    for i in range(0, n - n % 2, 2):
        a, b, c, d = real(C[0, i]), real(C[1, i]), real(C[2, i]), real(C[3, i])
        e, f, g, h = real(C[0, i + 1]), real(C[1, i + 1]), real(C[2, i + 1]), real(C[3, i + 1])
        for j in range(G.shape[1]):
            v, u = V[i, j], V[i + 1, j]
            G[0, j] = G[0, j] + a * v + e * u
            G[1, j] = G[1, j] + b * v + f * u
            G[2, j] = G[2, j] + c * v + g * u
            G[3, j] = G[3, j] + d * v + h * u
    for i in range(n - n % 2, n):
        for r in range(4):
            a = real(C[r, i])
            for j in range(G.shape[1]):
                G[r, j] = G[r, j] + a * V[i, j]
