"""Time integration of the plant in compiled code: adaptive, L-stable, conserving, and free of Python loops.

Method: ROS34PW2 of Rang & Angermann, BIT 45 (2005) 761: a Rosenbrock W-method of order 3 in four stages, L-stable and
stiffly accurate. A W-method keeps its order with an approximate Jacobian, here by forward differences of the compiled
right-hand side, once a step. It stays stable where zones vanish and the plant gets arbitrarily stiff.

Conservation: the integration vector ``y`` is the state ``s`` of `ac_plant_node.model` with one exchange. The mass of
the condenser is the total charge minus the evaporator's, so it needs no equation; in its slot the integral of net heat
and work is carried. Stored energy minus that integral is linear in ``y`` and every Rosenbrock step keeps it.

Step sizes are chosen by error control and do not end where a caller's duration ends: the state between is read from
the cubic Hermite interpolant of the last step, which keeps linear invariants too. A step with unchanged inputs goes on
where the last one stopped, so the trajectory does not depend on how a duration is cut.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ac_plant_node.compiled import Array, jit
from ac_plant_node.model import (
    HEAT_IN,
    N_STATES,
    POWER,
    Q_AIR_C,
    Q_AIR_E,
    balances,
    condenser_zones,
    evaporator_zones,
    rhs,
)
from ac_plant_node.tables import Tables

DEFAULT_TOLERANCE = 1.0e-5
"""Local error per step allowed, relative to `ERROR_SCALE`."""
MIN_STEP_S = 1.0e-2
"""Steps this short are accepted whatever their error estimate: a kink where a zone vanishes is then passed over."""
CUT = 0.3
"""A step of `MIN_STEP_S` or less that is refused all the same is tried again this much shorter,"""
REGAIN = 2.0
"""and the ones after it lengthen by this factor until they are back."""
MAX_STEP_S = 20.0
MAX_AGE = 4.0
"""Accepted steps for which one Jacobian serves; after a rejected step it is made anew. Order and conservation do not
depend on it."""
MAX_ERROR = 3000.0
"""No step is accepted above this error estimate (in units of the tolerance) of mass, energy, mean wall temperatures and
zone length."""
MAX_JUMP_J_KG = 2.0e4
"""Largest change of an outlet's enthalpy in such a step."""
MAX_SHAPE_ERROR = 3.0e4
"""The same for outlet enthalpies and differences of wall temperatures. They carry nothing that is conserved, and jump
where their zone appears or vanishes."""
FIRST_STEP_S = 0.1
"""Longest first step after a change of inputs: one control interval."""
ERROR_SCALE = np.array([1e-2, 1e3, 1e5, 5.0, 5.0, 1e5, 1e4, 0.1, 1e5, 5.0, 5.0, 5.0])
"""Sizes of the components of y for error control."""

_GAMMA = 4.3586652150845900e-01
_ALPHA = np.array(
    [
        [0.0, 0.0, 0.0, 0.0],
        [8.7173304301691801e-01, 0.0, 0.0, 0.0],
        [8.4457060015369423e-01, -1.1299064236484185e-01, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
    ]
)
_GAMMAS = np.array(
    [
        [_GAMMA, 0.0, 0.0, 0.0],
        [-8.7173304301691801e-01, _GAMMA, 0.0, 0.0],
        [-9.0338057013044082e-01, 5.4180672388095326e-02, _GAMMA, 0.0],
        [2.4212380706095346e-01, -1.2232505839045147e00, 5.4526025533510214e-01, _GAMMA],
    ]
)
_B = np.array([2.4212380706095346e-01, -1.2232505839045147e00, 1.5452602553351020e00, 4.3586652150845900e-01])
_B_HAT = np.array([3.7810903145819369e-01, -9.6042292212423178e-02, 5.0e-01, 2.1793326075422950e-01])
# Transformed coefficients, which save the products with the Jacobian (Hairer & Wanner II, IV.7).
_INV = np.linalg.inv(_GAMMAS)
_A = _ALPHA @ _INV
_C = np.diag(np.diag(_INV)) - _INV
_M = _B @ _INV
_E = _M - _B_HAT @ _INV

_DIFFERENCE = np.array([1e-8, 1e-3, 1e-1, 1e-5, 1e-5, 1.0, 1e-3, 1e-7, 1e-1, 1e-5, 1e-5, 1e-5])

# Layout of the scalar memory of an integration.
H_NEXT, H_LAST, T_LAST, MOVED, N_STEPS, N_REJECTED, FRESH, POWERS, TOLERANCE, AGE = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9
N_MEMORY = 10


@jit
def _rate(
    y: Array, charge: float, w: Array, par: Array, tab: Tables, guess: Array, z: Array, s: Array, dy: Array, aux: Array
) -> int:
    """Right-hand side in terms of the integration vector y."""
    for i in range(N_STATES):
        s[i] = y[i]
    s[5] = charge - y[0]
    status = rhs(s, w, par, tab, guess, z, dy, aux)
    dy[5] = aux[HEAT_IN]
    return status


@jit
def _factor(a: Array, pivots: NDArray[np.int64]) -> bool:
    """LU factors of `a` in place, rows exchanged; False when singular."""
    n = a.shape[0]
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        pivots[k] = pivot
        if a[pivot, k] == 0.0:
            return False
        if pivot != k:
            for j in range(n):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
        inv = 1.0 / a[k, k]
        for i in range(k + 1, n):
            if a[i, k] != 0.0:
                a[i, k] *= inv
                f = a[i, k]
                for j in range(k + 1, n):
                    a[i, j] -= f * a[k, j]
    return True


@jit
def _substitute(a: Array, pivots: NDArray[np.int64], b: Array) -> None:
    n = a.shape[0]
    for k in range(n):
        p = pivots[k]
        if p != k:
            b[k], b[p] = b[p], b[k]
    for k in range(n):
        for i in range(k + 1, n):
            b[i] -= a[i, k] * b[k]
    for k in range(n - 1, -1, -1):
        v = b[k]
        for j in range(k + 1, n):
            v -= a[k, j] * b[j]
        b[k] = v / a[k, k]


@jit
def _jacobian(
    y0: Array,
    f0: Array,
    jac: Array,
    dy: Array,
    trial: Array,
    s: Array,
    charge: float,
    w: Array,
    par: Array,
    tab: Tables,
    guess: Array,
    z: Array,
    aux: Array,
) -> None:
    """Jacobian of the rates at y0 by forward differences, backward where forward leads out of the tables.

    Only what depends on a component is evaluated again: wall temperatures (3, 4, 9, 10, 11) move neither pressures nor
    zones, the condenser's energy and first zone (6, 7) not the evaporator.
    """
    n = N_STATES
    for i in range(n):
        s[i] = y0[i]
    s[5] = charge - y0[0]
    ev, suction, _ = evaporator_zones(s, par, tab, guess[0])
    co, _ = condenser_zones(s, suction, par, tab, guess[1])
    for j in range(n):
        if j == 5:
            for i in range(n):
                jac[i, j] = 0.0
            continue
        for i in range(n):
            trial[i] = y0[i]
        trial[j] += _DIFFERENCE[j]
        failed = 0
        if j == 3 or j == 4 or j >= 9:
            s[j] = trial[j]
            balances(s, w, par, tab, ev, suction, co, z, dy, aux)
            dy[5] = aux[HEAT_IN]
            s[j] = y0[j]
        elif j == 6 or j == 7:
            s[j] = trial[j]
            other, failed = condenser_zones(s, suction, par, tab, co.p)
            balances(s, w, par, tab, ev, suction, other, z, dy, aux)
            dy[5] = aux[HEAT_IN]
            s[j] = y0[j]
        else:
            failed = _rate(trial, charge, w, par, tab, guess, z, s, dy, aux)
            for i in range(n):
                s[i] = y0[i]
            s[5] = charge - y0[0]
        if failed != 0:
            trial[j] = y0[j] - _DIFFERENCE[j]
            _rate(trial, charge, w, par, tab, guess, z, s, dy, aux)
            for i in range(n):
                s[i] = y0[i]
            s[5] = charge - y0[0]
        inv = 1.0 / (trial[j] - y0[j])
        for i in range(n):
            jac[i, j] = (dy[i] - f0[i]) * inv


@jit
def _advance_once(
    y0: Array,
    y1: Array,
    f0: Array,
    f1: Array,
    jac: Array,
    lu: Array,
    u: Array,
    trial: Array,
    s: Array,
    pivots: NDArray[np.int64],
    memory: Array,
    charge: float,
    w: Array,
    par: Array,
    tab: Tables,
    guess: Array,
    z: Array,
    aux: Array,
) -> int:
    """One accepted step from y0 (rate f0 known) to y1 (rate f1); sizes in `memory`. 0, or 1 when none worked."""
    n = N_STATES
    if memory[AGE] >= MAX_AGE:
        _jacobian(y0, f0, jac, u[0], trial, s, charge, w, par, tab, guess, z, aux)
        memory[AGE] = 0.0
    h = memory[H_NEXT]
    rejected = False
    for _ in range(40):
        diagonal = 1.0 / (_GAMMA * h)
        for i in range(n):
            for j in range(n):
                lu[i, j] = -jac[i, j]
            lu[i, i] += diagonal
        ok = _factor(lu, pivots)
        if ok:
            for stage in range(4):
                if stage == 0:
                    for i in range(n):
                        u[0, i] = f0[i]
                else:
                    for i in range(n):
                        v = y0[i]
                        for k in range(stage):
                            v += _A[stage, k] * u[k, i]
                        trial[i] = v
                    if _rate(trial, charge, w, par, tab, guess, z, s, u[stage], aux) != 0:
                        ok = False
                        break
                    for i in range(n):
                        v = 0.0
                        for k in range(stage):
                            v += _C[stage, k] * u[k, i]
                        u[stage, i] += v / h
                _substitute(lu, pivots, u[stage])
        error = 0.0
        kept = 0.0
        if ok:
            for i in range(n):
                v = y0[i]
                e = 0.0
                for k in range(4):
                    v += _M[k] * u[k, i]
                    e += _E[k] * u[k, i]
                y1[i] = v
                e /= ERROR_SCALE[i] * memory[TOLERANCE]
                error += e * e
                if i == 2 or i == 4 or i == 8 or i >= 10:
                    e *= MAX_ERROR / MAX_SHAPE_ERROR
                kept += e * e
            error, kept = np.sqrt(error / n), np.sqrt(kept / n)
            ok = error == error and _rate(y1, charge, w, par, tab, guess, z, s, f1, aux) == 0
        # A step accepted in spite of its error estimate must at least not throw the outlets' enthalpies about.
        calm = abs(y1[2] - y0[2]) < MAX_JUMP_J_KG and abs(y1[8] - y0[8]) < MAX_JUMP_J_KG
        if ok and (error <= 1.0 or (h <= MIN_STEP_S * 1.0001 and kept < MAX_ERROR and calm)):
            grow = 0.9 * max(error, 1.0e-4) ** (-1.0 / 3.0)
            limit = 1.0 if rejected else 5.0
            longer = h * min(max(grow, 0.2), limit)
            # Below the forced step it grows whatever the estimate says, but not all at once.
            longer = max(longer, min(REGAIN * h, MIN_STEP_S))
            memory[H_LAST] = h
            memory[H_NEXT] = min(longer, MAX_STEP_S if h >= MIN_STEP_S else MIN_STEP_S)
            memory[N_STEPS] += 1.0
            # Past a kink the Jacobian is another one.
            memory[AGE] = memory[AGE] + 1.0 if error <= 1.0 else MAX_AGE
            return 0
        memory[N_REJECTED] += 1.0
        rejected = True
        if ok:
            shorter = h * max(0.9 * error ** (-1.0 / 3.0), 0.1)
            h = max(shorter, MIN_STEP_S) if h > MIN_STEP_S * 1.0001 else CUT * h
        else:
            h *= 0.25
            if h < 1.0e-7:
                return 1
        if memory[AGE] > 0.0:
            _jacobian(y0, f0, jac, u[0], trial, s, charge, w, par, tab, guess, z, aux)
            memory[AGE] = 0.0
    return 1


@jit
def run(
    y: Array,
    y0: Array,
    y1: Array,
    f0: Array,
    f1: Array,
    jac: Array,
    lu: Array,
    u: Array,
    trial: Array,
    s: Array,
    pivots: NDArray[np.int64],
    memory: Array,
    charge: float,
    w: Array,
    par: Array,
    tab: Tables,
    guess: Array,
    z: Array,
    aux: Array,
    until: float,
) -> int:
    """Bring `y` to `until` seconds after the last change of inputs; results at that time in `y` and `aux`.

    Returns 0, or 1 when the state cannot be continued inside the property tables.
    """
    if memory[FRESH] != 0.0:
        # Inputs have changed: restart from where we are.
        for i in range(N_STATES):
            y0[i] = y[i]
            y1[i] = y[i]
        if _rate(y1, charge, w, par, tab, guess, z, s, f1, aux) != 0:
            return 1
        memory[POWERS] = abs(aux[Q_AIR_E]) + abs(aux[Q_AIR_C]) + abs(aux[POWER])
        memory[T_LAST], memory[H_LAST] = 0.0, 0.0
        memory[H_NEXT] = min(memory[H_NEXT], FIRST_STEP_S)
        memory[FRESH] = 0.0
    while memory[T_LAST] + memory[H_LAST] < until:
        memory[T_LAST] += memory[H_LAST]
        for i in range(N_STATES):
            y0[i] = y1[i]
            f0[i] = f1[i]
        if _advance_once(y0, y1, f0, f1, jac, lu, u, trial, s, pivots, memory, charge, w, par, tab, guess, z, aux) != 0:
            return 1
        powers = abs(aux[Q_AIR_E]) + abs(aux[Q_AIR_C]) + abs(aux[POWER])
        memory[MOVED] += 0.5 * memory[H_LAST] * (powers + memory[POWERS])
        memory[POWERS] = powers
    h = memory[H_LAST]
    if h > 0.0:
        t = (until - memory[T_LAST]) / h
        a = t * t * (3.0 - 2.0 * t)
        b = t * (1.0 - t) * (1.0 - t) * h
        c = t * t * (t - 1.0) * h
        for i in range(N_STATES):
            y[i] = y0[i] + a * (y1[i] - y0[i]) + b * f0[i] + c * f1[i]
    # Reading results must not disturb the steps to come: the solver's warm start stays theirs.
    guess_e, guess_c = guess[0], guess[1]
    status = _rate(y, charge, w, par, tab, guess, z, s, trial, aux)
    guess[0], guess[1] = guess_e, guess_c
    return status


class Work(NamedTuple):
    """The arrays of one integration, as `run` takes them: last step's ends and rates there, work space, memory."""

    y0: Array
    y1: Array
    f0: Array
    f1: Array
    jac: Array
    lu: Array
    u: Array
    trial: Array
    s: Array
    pivots: NDArray[np.int64]
    memory: Array


def new_work(tolerance: float = DEFAULT_TOLERANCE) -> Work:
    """Arrays for an integration that starts."""
    n = N_STATES
    memory = np.zeros(N_MEMORY)
    memory[H_NEXT] = 0.02
    memory[FRESH] = 1.0
    memory[TOLERANCE] = tolerance
    memory[AGE] = MAX_AGE
    return Work(
        np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros((n, n)), np.zeros((n, n)), np.zeros((4, n)),
        np.zeros(n), np.zeros(n), np.zeros(n, dtype=np.int64), memory,
    )  # fmt: skip
