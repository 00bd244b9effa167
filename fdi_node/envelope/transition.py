"""Transition over one tick of the linearised plant with its unknowns held, exactly."""

import numpy as np

from ac_plant_node.dynamics.balances import N_STATES
from ac_plant_node.dynamics.linear_algebra import times
from fdi_node.envelope.compiled import Array, jit

_RADIUS, _TERMS = 0.5, 9


@jit
def transition(A: Array, h: float, F: Array) -> None:
    """Work out `F` (12, n) of ``x+ = F [x, u]`` from `A` (12, n) of ``dx/dt = A [x, u]``, u constant, over h.

    ``F = [phi_0(hA_x), h phi_1(hA_x) A_u]`` by the series of phi_1 at a matrix that is halved until it is small, and
    ``phi_1(2A) = (phi_0(A) + 1) phi_1(A) / 2``.
    """
    n = N_STATES
    a, p, q, room = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    largest = 0.0
    for i in range(n):
        total = 0.0
        for j in range(n):
            a[i, j] = h * A[i, j]
            total += abs(a[i, j])
        largest = max(largest, total)
    halvings = 0
    while largest > _RADIUS * 2.0**halvings and halvings < 60:
        halvings += 1
    for i in range(n):
        for j in range(n):
            a[i, j] *= 0.5**halvings
        q[i, i] = 1.0
    for k in range(_TERMS, 0, -1):  # 1 + A/2 (1 + A/3 (1 + ...))
        times(a, q, room)
        for i in range(n):
            for j in range(n):
                q[i, j] = room[i, j] / (k + 1.0)
            q[i, i] += 1.0
    times(a, q, p)
    for i in range(n):
        p[i, i] += 1.0
    for _ in range(halvings):
        times(p, q, room)
        for i in range(n):
            for j in range(n):
                q[i, j] = 0.5 * (q[i, j] + room[i, j])
        times(p, p, room)
        for i in range(n):
            for j in range(n):
                p[i, j] = room[i, j]
    for i in range(n):
        for j in range(n):
            F[i, j] = p[i, j]
        for j in range(n, A.shape[1]):
            total = 0.0
            for k in range(n):
                total += q[i, k] * A[k, j]
            F[i, j] = h * total
