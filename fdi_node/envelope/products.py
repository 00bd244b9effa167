"""Products with the transition and with gains, as the filter and its windows need them: loops that vectorise.

The inner loop runs along the rows of an array and takes four terms for three rows at a time, so that little is fetched
and stored.
"""

from ac_plant_node.dynamics.balances import N_STATES
from fdi_node.envelope.compiled import Array, jit
from fdi_node.envelope.model import ENERGY, PARAMETER, PLACE, READING

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
def multiply(F: Array, V: Array, columns: Array, count: int, w: int, D: Array) -> None:
    """Work out the first `w` columns of `D` (12, .) = F V; `columns` of F and rows of V, `count` of them: `terms`."""
    for i in range(0, N_STATES, 3):
        for j in range(w):
            D[i, j] = D[i + 1, j] = D[i + 2, j] = 0.0
        for at in range(0, count, _TERMS):
            a, b, c, d = int(columns[at]), int(columns[at + 1]), int(columns[at + 2]), int(columns[at + 3])
            f, g, h, k = F[i, a], F[i, b], F[i, c], F[i, d]
            p, q, r, s = F[i + 1, a], F[i + 1, b], F[i + 1, c], F[i + 1, d]
            t, x, y, z = F[i + 2, a], F[i + 2, b], F[i + 2, c], F[i + 2, d]
            for j in range(w):
                v_a, v_b, v_c, v_d = V[a, j], V[b, j], V[c, j], V[d, j]
                D[i, j] = D[i, j] + f * v_a + g * v_b + h * v_c + k * v_d
                D[i + 1, j] = D[i + 1, j] + p * v_a + q * v_b + r * v_c + s * v_d
                D[i + 2, j] = D[i + 2, j] + t * v_a + x * v_b + y * v_c + z * v_d


@jit
def subtract(K: Array, gains: Array, G: Array, n: int, V: Array) -> None:
    """V <- V - K' diag(gains) G in the first `n` rows of V (n, w); K (4, n), gains (4,), G (4, w)."""
    for i in range(n):
        a, b, c, d = K[0, i] * gains[0], K[1, i] * gains[1], K[2, i] * gains[2], K[3, i] * gains[3]
        if a != 0.0 or b != 0.0 or c != 0.0 or d != 0.0:
            for j in range(G.shape[1]):
                V[i, j] = V[i, j] - a * G[0, j] - b * G[1, j] - c * G[2, j] - d * G[3, j]


@jit
def combine(C: Array, V: Array, G: Array) -> None:
    """Work out `G` (4, w) = C V; C (4, n), V (n, w)."""
    for j in range(G.shape[1]):
        G[0, j] = G[1, j] = G[2, j] = G[3, j] = 0.0
    n = C.shape[1]
    for i in range(0, n - n % 2, 2):
        a, b, c, d = C[0, i], C[1, i], C[2, i], C[3, i]
        e, f, g, h = C[0, i + 1], C[1, i + 1], C[2, i + 1], C[3, i + 1]
        for j in range(G.shape[1]):
            v, u = V[i, j], V[i + 1, j]
            G[0, j] = G[0, j] + a * v + e * u
            G[1, j] = G[1, j] + b * v + f * u
            G[2, j] = G[2, j] + c * v + g * u
            G[3, j] = G[3, j] + d * v + h * u
    for i in range(n - n % 2, n):
        for j in range(G.shape[1]):
            for r in range(4):
                G[r, j] += C[r, i] * V[i, j]
