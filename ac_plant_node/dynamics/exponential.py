"""The first step after a change of inputs, an exponential Rosenbrock step.

What a command that jumps from tick to tick sets off is a layer of some 20 ms which
is next to linear, so the linear part is solved exactly, by an exponential Rosenbrock step as long as the inputs before
were held (Hochbruck, Ostermann & Schweitzer, SIAM J. Numer. Anal. 47 (2009) 786). With ``N(y) = f(y) - f(y0) - J (y -
y0)`` taken along two stages and as a parabola in time, ``N = a t/h + b (t/h)^2``, it is

``y(h) = y0 + h [phi_1(hJ) f(y0) + phi_2(hJ) a + 2 phi_3(hJ) b]``,

four right-hand sides, and matrices that serve for many steps: the linear part of N makes up for an old Jacobian. Its
error estimate is what the parabola changes; where that is too much the Rosenbrock W-method takes over.
"""

import numpy as np

from ac_plant_node.dynamics.balances import N_STATES
from ac_plant_node.dynamics.linear_algebra import copy_into, times
from ac_plant_node.dynamics.workspace import (
    AGE,
    ERROR_SCALE,
    EXPONENTIAL,
    H_LAST,
    N_REJECTED,
    N_STEPS,
    PHI_0,
    PHI_1,
    PHI_2,
    PHI_3,
    PHI_HALF,
    PHI_S,
    ROOM,
    T_LAST,
    TOLERANCE,
    Work,
    make_jacobian,
    rates_of,
)
from ac_plant_node.properties.compiled import Array, jit
from ac_plant_node.properties.tables import Tables

MAX_PHI_AGE = 20.0
"""Accepted steps for which one Jacobian serves exponential steps: their error hardly depends on its age."""
MAX_PHI_ERROR = 30.0
"""Largest error estimate of an exponential step, in units of the tolerance. It is that of a method one order lower."""
HOPELESS = 10.0
"""An estimate this many times `MAX_PHI_ERROR` is the plant's, not an old Jacobian's: a new one is not even tried."""

_SERIES_RADIUS, _SERIES_TERMS = 0.5, 8  # the series of phi_3 is cut off where it has come to 1e-11
_FACTORIAL = np.cumprod(np.array([1.0, *range(1, 12)]))


@jit
def make_phi(k: Work, h: float) -> None:
    """Functions phi_0 .. phi_3 of h times the Jacobian, phi_1 of half of that.

    By the series of phi_3 at a matrix halved until it is small, the recursion ``phi_k = 1/k! + A phi_{k+1}``, and
    ``phi_k(2A) = [phi_0(A) phi_k(A) + sum_{j=1..k} phi_j(A)/(k-j)!] / 2^k``. In the units of `ERROR_SCALE`, in which
    the Jacobian is no larger than its eigenvalues ask for.
    """
    n, phi, a, room = N_STATES, k.phi, k.lu, k.phi[ROOM]
    largest = 0.0
    for i in range(n):
        total = 0.0
        for j in range(n):
            a[i, j] = h * k.jac[i, j] * ERROR_SCALE[j] / ERROR_SCALE[i]
            total += abs(a[i, j])
        largest = max(largest, total)
    halvings = 1
    while largest > _SERIES_RADIUS * 2.0**halvings and halvings < 60:
        halvings += 1
    # 1/3! + A/4! + A^2/5! + ..., from its far end
    for i in range(n):
        for j in range(n):
            a[i, j] *= 0.5**halvings
            room[i, j] = a[i, j] / _FACTORIAL[_SERIES_TERMS + 3]
        room[i, i] += 1.0 / _FACTORIAL[_SERIES_TERMS + 2]
    for m in range(_SERIES_TERMS - 2, -1, -1):
        times(a, room, phi[PHI_3])
        for i in range(n):
            phi[PHI_3, i, i] += 1.0 / _FACTORIAL[m + 3]
            copy_into(phi[PHI_3, i], room[i])
    for p in range(PHI_2, PHI_0 - 1, -1):
        times(a, phi[p + 1], phi[p])
        for i in range(n):
            phi[p, i, i] += 1.0 / _FACTORIAL[p - PHI_0]
    for doubling in range(halvings):
        if doubling == halvings - 1:
            for i in range(n):
                copy_into(phi[PHI_1, i], phi[PHI_HALF, i])
        times(phi[PHI_0], phi[PHI_3], room)
        for i in range(n):
            for j in range(n):
                room[i, j] += 0.5 * phi[PHI_1, i, j] + phi[PHI_2, i, j] + phi[PHI_3, i, j]
                phi[PHI_3, i, j] = 0.125 * room[i, j]
        times(phi[PHI_0], phi[PHI_2], room)
        for i in range(n):
            for j in range(n):
                room[i, j] += phi[PHI_1, i, j] + phi[PHI_2, i, j]
                phi[PHI_2, i, j] = 0.25 * room[i, j]
        times(phi[PHI_0], phi[PHI_1], room)
        for i in range(n):
            for j in range(n):
                phi[PHI_1, i, j] = 0.5 * (room[i, j] + phi[PHI_1, i, j])
        times(phi[PHI_0], phi[PHI_0], room)
        for i in range(n):
            copy_into(room[i], phi[PHI_0, i])
    for i in range(n):
        for j in range(n):
            unit = ERROR_SCALE[i] / ERROR_SCALE[j]
            for p in range(ROOM):
                phi[p, i, j] *= unit
    k.memory[PHI_S] = h


@jit
def remainder(k: Work, after: float, d: Array, out: Array, par: Array, tab: Tables) -> int:
    """``N = f(y0 + d) - f0 - J d`` in `out`, `after` seconds into the step; 0, or 1 when there is no f."""
    for i in range(N_STATES):
        k.trial[i] = k.y0[i] + d[i]
    failed = rates_of(k, k.memory[T_LAST] + after, k.trial, out, par, tab)
    for i in range(N_STATES):
        v = out[i] - k.f0[i]
        for j in range(N_STATES):
            v -= k.jac[i, j] * d[j]
        out[i] = v
    return failed


@jit
def as_parabola(a: Array, b: Array) -> None:
    """Make of N at the end (`a`) and in the middle (`b`) of a step the coefficients of ``a t/h + b (t/h)^2``."""
    for i in range(N_STATES):
        end = a[i]
        b[i] = 2.0 * end - 4.0 * b[i]
        a[i] = end - b[i]


@jit
def exponential_state(k: Work, share: float, h: float, out: Array) -> float:
    """State after a `share` of the exponential step of length h from y0 in `out`; its error estimate.

    The phi functions must be those of share times h; a and b are in rows 1 and 2 of `k.u`.
    """
    error = 0.0
    for i in range(N_STATES):
        v, e = 0.0, 0.0
        for j in range(N_STATES):
            second, third = k.phi[PHI_2, i, j], 2.0 * k.phi[PHI_3, i, j]
            v += k.phi[PHI_1, i, j] * k.f0[j] + share * second * k.u[1, j] + share * share * third * k.u[2, j]
            e += (third - second) * k.u[2, j]
        out[i] = k.y0[i] + share * h * v
        e *= h / (ERROR_SCALE[i] * k.memory[TOLERANCE])
        error += e * e
    return float(np.sqrt(error / N_STATES))


@jit
def exponential_step(k: Work, h: float, par: Array, tab: Tables) -> bool:
    """Step of length h from y0 (rate f0 known) to y1 (rate f1), if its error estimate allows."""
    memory, d, a, b = k.memory, k.u[0], k.u[1], k.u[2]
    if memory[AGE] >= MAX_PHI_AGE:
        make_jacobian(k, par, tab)
    error = np.inf
    for _ in range(2):
        if memory[PHI_S] != h:
            make_phi(k, h)
        for i in range(N_STATES):
            v = 0.0
            for j in range(N_STATES):
                v += k.phi[PHI_HALF, i, j] * k.f0[j]
            d[i] = 0.5 * h * v
        ok = remainder(k, 0.5 * h, d, b, par, tab) == 0
        if ok:
            for i in range(N_STATES):
                v = 0.0
                for j in range(N_STATES):
                    v += k.phi[PHI_1, i, j] * k.f0[j] + 2.0 * k.phi[PHI_2, i, j] * b[j]
                d[i] = h * v
            ok = remainder(k, h, d, a, par, tab) == 0
        if ok:
            as_parabola(a, b)
            error = exponential_state(k, 1.0, h, k.y1)
            if error <= MAX_PHI_ERROR and rates_of(k, memory[T_LAST] + h, k.y1, k.f1, par, tab) == 0:
                memory[H_LAST], memory[EXPONENTIAL] = h, 1.0
                memory[N_STEPS] += 1.0
                memory[AGE] += 1.0
                return True
        memory[N_REJECTED] += 1.0
        if memory[AGE] == 0.0 or error > HOPELESS * MAX_PHI_ERROR:
            break
        make_jacobian(k, par, tab)
    return False
