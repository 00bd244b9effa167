"""Time integration of the plant in compiled code: adaptive, L-stable, conserving, and free of Python loops.

Method: ROS34PW2 of Rang & Angermann, BIT 45 (2005) 761: a Rosenbrock W-method of order 3 in four stages, L-stable and
stiffly accurate. A W-method keeps its order with an approximate Jacobian, here by forward differences of the compiled
right-hand side, once a step. It stays stable where zones vanish and the plant gets arbitrarily stiff.

Conservation: the integration vector ``y`` is the state ``s`` of `ac_plant_node.model` with one exchange. The mass of
the condenser is the total charge minus the evaporator's, so it needs no equation; in its slot the integral of net heat
and work is carried, less the energy that leaks out. Stored energy minus that integral is linear in ``y`` and every
Rosenbrock step keeps it. A leak's rate is held as the inputs are, so the total charge is a known function of time.

Step sizes are chosen by error control and do not end where a caller's duration ends: the state between is read from
the cubic Hermite interpolant of the last step, which keeps linear invariants too. A step with unchanged inputs goes on
where the last one stopped, so the trajectory does not depend on how a duration is cut.

First step after a change of inputs: what a command that jumps from tick to tick sets off is a layer of some 20 ms which
is next to linear, so the linear part is solved exactly, by an exponential Rosenbrock step as long as the inputs before
were held (Hochbruck, Ostermann & Schweitzer, SIAM J. Numer. Anal. 47 (2009) 786). With ``N(y) = f(y) - f(y0) - J (y -
y0)`` taken along two stages and as a parabola in time, ``N = a t/h + b (t/h)^2``, it is

``y(h) = y0 + h [phi_1(hJ) f(y0) + phi_2(hJ) a + 2 phi_3(hJ) b]``,

four right-hand sides, and matrices that serve for many steps: the linear part of N makes up for an old Jacobian. Its
error estimate is what the parabola changes; where that is too much the Rosenbrock W-method takes over.
"""

from typing import NamedTuple

import numpy as np

from ac_plant_node.compiled import Array, jit
from ac_plant_node.dynamics.drive import LEAK, N_DRIVE, set_drive
from ac_plant_node.inputs import HELD_HIGH, HELD_LOW, N_HELD
from ac_plant_node.model import (
    HEAT_IN,
    N_AUX,
    N_STATES,
    P_C,
    P_E,
    POWER,
    Q_AIR_C,
    Q_AIR_E,
    SUPERHEAT,
    WALL_E2,
    balances,
    condenser_zones,
    evaporator_zones,
    flows,
    new_workspace,
    rhs,
)
from ac_plant_node.parameters import INDEX
from ac_plant_node.tables import Tables

DEFAULT_TOLERANCE = 1.0e-5
"""Local error per step allowed, relative to `ERROR_SCALE`."""
MIN_STEP_S = 1.0e-2
"""Steps this short are accepted whatever their error estimate: a kink where a zone vanishes is then passed over."""
LEAST_CHARGE = 0.2
"""A leak ends when this share of the nominal charge is left, about what fills the heat exchangers with vapour."""
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
"""Longest first step after a change of inputs: one control interval. An exponential one takes as long as the inputs
before were held, if that is less."""
MAX_PHI_AGE = 20.0
"""Accepted steps for which one Jacobian serves exponential steps: their error hardly depends on its age."""
MAX_PHI_ERROR = 30.0
"""Largest error estimate of an exponential step, in units of the tolerance. It is that of a method one order lower."""
HOPELESS = 10.0
"""An estimate this many times `MAX_PHI_ERROR` is the plant's, not an old Jacobian's: a new one is not even tried."""
OUTSIDE, NOT_FINITE = 1, 2
"""What `run` may return instead of 0."""
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
_SHARE = _ALPHA.sum(axis=1)  # when in a step a stage is; a W-method needs no slope of the rates in time

_DIFFERENCE = np.array([1e-8, 1e-3, 1e-1, 1e-5, 1e-5, 1.0, 1e-3, 1e-7, 1e-1, 1e-5, 1e-5, 1e-5])

_SERIES_RADIUS, _SERIES_TERMS = 0.5, 8  # the series of phi_3 is cut off where it has come to 1e-11
_FACTORIAL = np.cumprod(np.array([1.0, *range(1, 12)]))

# Layout of the scalar memory of an integration.
H_NEXT, H_LAST, T_LAST, MOVED, N_STEPS, N_REJECTED, POWERS, TOLERANCE, AGE, CHARGE, CLOCK_NS = range(11)
T_HELD, FIRST, PHI_S, EXPONENTIAL = range(11, 15)
"""How long the inputs have been held; whether the next step is the first with them; the step length that the phi
functions were made for (0: none); whether the last step was an exponential one."""
LEAK_RATE, LEAKED_J, LEAKED_NOW_J = range(15, 18)
"""Refrigerant lost, kg/s (`CHARGE` is what there was when the inputs changed last); energy that had left with it at the
start of the last step, and at the time read last."""
N_MEMORY = 18

# Layout of the matrices of the exponential step.
PHI_HALF, PHI_0, PHI_1, PHI_2, PHI_3, ROOM = range(6)
"""phi_1(hJ/2), then phi_0 .. phi_3 of hJ."""


class Work(NamedTuple):
    """The memory of one integration: views into one array, because each array handed to compiled code costs time.

    `y`: state at the time read last; `held`, `drive`: inputs and faults, and what follows from them; `aux`, `guess`,
    `z`: as `ac_plant_node.model.rhs`; `y0`, `f0`, `y1`, `f1`, `aux_1`: ends of the last step, rates and results there;
    `u`: stages; `jac`, `lu`, `pivots`, `phi`: matrices; `trial`, `s`, `rate`: work space.
    """

    memory: Array
    held: Array
    drive: Array
    y: Array
    aux: Array
    guess: Array
    z: Array
    y0: Array
    f0: Array
    y1: Array
    f1: Array
    aux_1: Array
    u: Array
    jac: Array
    lu: Array
    pivots: Array
    phi: Array
    trial: Array
    s: Array
    rate: Array


_NOMINAL_CHARGE = INDEX["charge_kg"]
_N, _NN = N_STATES, N_STATES**2
_ENDS = np.cumsum(
    [N_MEMORY, N_HELD, N_DRIVE, _N, N_AUX, 2, 56, _N, _N, _N, _N, N_AUX, 4 * _N, _NN, _NN, _N, 6 * _NN, _N, _N, _N]
)  # fmt: skip
N_WORK = int(_ENDS[-1])


@jit
def views(work: Array) -> Work:
    """The parts of the array of an integration."""
    n, e = N_STATES, _ENDS
    return Work(
        work[: e[0]], work[e[0] : e[1]], work[e[1] : e[2]], work[e[2] : e[3]], work[e[3] : e[4]], work[e[4] : e[5]],
        work[e[5] : e[6]].reshape(7, 8), work[e[6] : e[7]], work[e[7] : e[8]], work[e[8] : e[9]], work[e[9] : e[10]],
        work[e[10] : e[11]], work[e[11] : e[12]].reshape(4, n), work[e[12] : e[13]].reshape(n, n),
        work[e[13] : e[14]].reshape(n, n), work[e[14] : e[15]], work[e[15] : e[16]].reshape(6, n, n),
        work[e[16] : e[17]], work[e[17] : e[18]], work[e[18] : e[19]],
    )  # fmt: skip


@jit
def _rate(k: Work, t: float, y: Array, dy: Array, par: Array, tab: Tables) -> int:
    """Right-hand side in terms of the integration vector y, `t` seconds after the last change of inputs."""
    for i in range(N_STATES):
        k.s[i] = y[i]
    k.s[5] = k.memory[CHARGE] - k.memory[LEAK_RATE] * t - y[0]
    status = rhs(k.s, k.drive, par, tab, k.guess, k.z, dy, k.aux)
    dy[5] = k.aux[HEAT_IN] - k.memory[LEAK_RATE] * y[8]
    return status


@jit
def _factor(a: Array, pivots: Array) -> bool:
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
def _substitute(a: Array, pivots: Array, b: Array) -> None:
    n = a.shape[0]
    for k in range(n):
        p = int(pivots[k])
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
def _jacobian(k: Work, par: Array, tab: Tables) -> None:
    """Jacobian of the rates at y0, where they are f0, by forward differences, backward where those leave the tables.

    Only what depends on a component is evaluated again: wall temperatures (3, 4, 9, 10, 11) move no pressure,
    zone or mass flow, the condenser's energy and first zone (6, 7) not the evaporator.
    """
    n, s, dy, trial, now, leak = N_STATES, k.s, k.rate, k.trial, k.memory[T_LAST], k.memory[LEAK_RATE]
    charge = k.memory[CHARGE] - leak * now
    for i in range(n):
        s[i] = k.y0[i]
    s[5] = charge - k.y0[0]
    ev, suction, _ = evaporator_zones(s, par, tab, k.guess[0])
    co, _ = condenser_zones(s, k.drive, suction, par, tab, k.guess[1])
    flow = flows(ev, co, suction, s[8], k.drive, par, tab)
    for j in range(n):
        if j == 5:
            for i in range(n):
                k.jac[i, j] = 0.0
            continue
        for i in range(n):
            trial[i] = k.y0[i]
        trial[j] += _DIFFERENCE[j]
        failed = 0
        if j == 3 or j == 4 or j >= 9:
            s[j] = trial[j]
            balances(s, k.drive, par, ev, suction, co, flow, k.z, dy, k.aux)
            dy[5] = k.aux[HEAT_IN] - leak * s[8]
            s[j] = k.y0[j]
        elif j == 6 or j == 7:
            s[j] = trial[j]
            other, failed = condenser_zones(s, k.drive, suction, par, tab, co.p)
            flow_2 = flows(ev, other, suction, s[8], k.drive, par, tab)
            balances(s, k.drive, par, ev, suction, other, flow_2, k.z, dy, k.aux)
            dy[5] = k.aux[HEAT_IN] - leak * s[8]
            s[j] = k.y0[j]
        else:
            failed = _rate(k, now, trial, dy, par, tab)
            for i in range(n):
                s[i] = k.y0[i]
            s[5] = charge - k.y0[0]
        if failed != 0:
            trial[j] = k.y0[j] - _DIFFERENCE[j]
            _rate(k, now, trial, dy, par, tab)
            for i in range(n):
                s[i] = k.y0[i]
            s[5] = charge - k.y0[0]
        inv = 1.0 / (trial[j] - k.y0[j])
        for i in range(n):
            k.jac[i, j] = (dy[i] - k.f0[i]) * inv
    k.memory[AGE] = k.memory[PHI_S] = 0.0


@jit
def _copy(a: Array, b: Array) -> None:
    """Copy vector a into b, by a loop: whole-array statements take the compiler seconds."""
    for i in range(a.shape[0]):
        b[i] = a[i]


@jit
def _times(a: Array, b: Array, c: Array) -> None:
    """Matrix product a b in c."""
    for i in range(a.shape[0]):
        for j in range(a.shape[0]):
            c[i, j] = 0.0
        for m in range(a.shape[0]):
            f = a[i, m]
            for j in range(a.shape[0]):
                c[i, j] += f * b[m, j]


@jit
def _make_phi(k: Work, h: float) -> None:
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
        _times(a, room, phi[PHI_3])
        for i in range(n):
            phi[PHI_3, i, i] += 1.0 / _FACTORIAL[m + 3]
            _copy(phi[PHI_3, i], room[i])
    for p in range(PHI_2, PHI_0 - 1, -1):
        _times(a, phi[p + 1], phi[p])
        for i in range(n):
            phi[p, i, i] += 1.0 / _FACTORIAL[p - PHI_0]
    for doubling in range(halvings):
        if doubling == halvings - 1:
            for i in range(n):
                _copy(phi[PHI_1, i], phi[PHI_HALF, i])
        _times(phi[PHI_0], phi[PHI_3], room)
        for i in range(n):
            for j in range(n):
                room[i, j] += 0.5 * phi[PHI_1, i, j] + phi[PHI_2, i, j] + phi[PHI_3, i, j]
                phi[PHI_3, i, j] = 0.125 * room[i, j]
        _times(phi[PHI_0], phi[PHI_2], room)
        for i in range(n):
            for j in range(n):
                room[i, j] += phi[PHI_1, i, j] + phi[PHI_2, i, j]
                phi[PHI_2, i, j] = 0.25 * room[i, j]
        _times(phi[PHI_0], phi[PHI_1], room)
        for i in range(n):
            for j in range(n):
                phi[PHI_1, i, j] = 0.5 * (room[i, j] + phi[PHI_1, i, j])
        _times(phi[PHI_0], phi[PHI_0], room)
        for i in range(n):
            _copy(room[i], phi[PHI_0, i])
    for i in range(n):
        for j in range(n):
            unit = ERROR_SCALE[i] / ERROR_SCALE[j]
            for p in range(ROOM):
                phi[p, i, j] *= unit
    k.memory[PHI_S] = h


@jit
def _remainder(k: Work, after: float, d: Array, out: Array, par: Array, tab: Tables) -> int:
    """``N = f(y0 + d) - f0 - J d`` in `out`, `after` seconds into the step; 0, or 1 when there is no f."""
    for i in range(N_STATES):
        k.trial[i] = k.y0[i] + d[i]
    failed = _rate(k, k.memory[T_LAST] + after, k.trial, out, par, tab)
    for i in range(N_STATES):
        v = out[i] - k.f0[i]
        for j in range(N_STATES):
            v -= k.jac[i, j] * d[j]
        out[i] = v
    return failed


@jit
def _exponential_state(k: Work, share: float, h: float, out: Array) -> float:
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
def _exponential_step(k: Work, h: float, par: Array, tab: Tables) -> bool:
    """Step of length h from y0 (rate f0 known) to y1 (rate f1), if its error estimate allows."""
    memory, d, a, b = k.memory, k.u[0], k.u[1], k.u[2]
    if memory[AGE] >= MAX_PHI_AGE:
        _jacobian(k, par, tab)
    error = np.inf
    for _ in range(2):
        if memory[PHI_S] != h:
            _make_phi(k, h)
        for i in range(N_STATES):
            v = 0.0
            for j in range(N_STATES):
                v += k.phi[PHI_HALF, i, j] * k.f0[j]
            d[i] = 0.5 * h * v
        ok = _remainder(k, 0.5 * h, d, b, par, tab) == 0
        if ok:
            for i in range(N_STATES):
                v = 0.0
                for j in range(N_STATES):
                    v += k.phi[PHI_1, i, j] * k.f0[j] + 2.0 * k.phi[PHI_2, i, j] * b[j]
                d[i] = h * v
            ok = _remainder(k, h, d, a, par, tab) == 0
        if ok:
            for i in range(N_STATES):
                end = a[i]
                b[i] = 2.0 * end - 4.0 * b[i]
                a[i] = end - b[i]
            error = _exponential_state(k, 1.0, h, k.y1)
            if error <= MAX_PHI_ERROR and _rate(k, memory[T_LAST] + h, k.y1, k.f1, par, tab) == 0:
                memory[H_LAST], memory[EXPONENTIAL] = h, 1.0
                memory[N_STEPS] += 1.0
                memory[AGE] += 1.0
                return True
        memory[N_REJECTED] += 1.0
        if memory[AGE] == 0.0 or error > HOPELESS * MAX_PHI_ERROR:
            break
        _jacobian(k, par, tab)
    return False


@jit
def _rosenbrock_step(k: Work, par: Array, tab: Tables) -> int:
    """One accepted step from y0 (rate f0 known) to y1 (rate f1); sizes in `memory`. 0, or 1 when none worked."""
    n, memory, y0, y1, u, lu = N_STATES, k.memory, k.y0, k.y1, k.u, k.lu
    if memory[AGE] >= MAX_AGE:
        _jacobian(k, par, tab)
    h = memory[H_NEXT]
    rejected = False
    for _ in range(40):
        diagonal = 1.0 / (_GAMMA * h)
        for i in range(n):
            for j in range(n):
                lu[i, j] = -k.jac[i, j]
            lu[i, i] += diagonal
        ok = _factor(lu, k.pivots)
        if ok:
            for stage in range(4):
                if stage == 0:
                    for i in range(n):
                        u[0, i] = k.f0[i]
                else:
                    for i in range(n):
                        v = y0[i]
                        for m in range(stage):
                            v += _A[stage, m] * u[m, i]
                        k.trial[i] = v
                    if _rate(k, memory[T_LAST] + h * _SHARE[stage], k.trial, u[stage], par, tab) != 0:
                        ok = False
                        break
                    for i in range(n):
                        v = 0.0
                        for m in range(stage):
                            v += _C[stage, m] * u[m, i]
                        u[stage, i] += v / h
                _substitute(lu, k.pivots, u[stage])
        error = 0.0
        kept = 0.0
        if ok:
            for i in range(n):
                v = y0[i]
                e = 0.0
                for m in range(4):
                    v += _M[m] * u[m, i]
                    e += _E[m] * u[m, i]
                y1[i] = v
                e /= ERROR_SCALE[i] * memory[TOLERANCE]
                error += e * e
                if i == 2 or i == 4 or i == 8 or i >= 10:
                    e *= MAX_ERROR / MAX_SHAPE_ERROR
                kept += e * e
            error, kept = np.sqrt(error / n), np.sqrt(kept / n)
            ok = error == error and _rate(k, memory[T_LAST] + h, y1, k.f1, par, tab) == 0
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
            _jacobian(k, par, tab)
    return 1


@jit
def _powers(aux: Array) -> float:
    """Magnitudes of the three powers, summed."""
    total: float = abs(aux[Q_AIR_E]) + abs(aux[Q_AIR_C]) + abs(aux[POWER])
    return total


@jit
def _leaked(k: Work, after: float) -> float:
    """Energy (J) that leaks in the first `after` seconds of the last step: the integral of its interpolant's h_c3."""
    rate, h = k.memory[LEAK_RATE], k.memory[H_LAST]
    if rate == 0.0 or h == 0.0:
        return 0.0
    t = after / h
    ends = t * t * t * (1.0 - 0.5 * t) * (k.y1[8] - k.y0[8])
    slopes = t * t * (0.5 - t * (2.0 / 3.0 - 0.25 * t)) * k.f0[8] + t * t * t * (0.25 * t - 1.0 / 3.0) * k.f1[8]
    energy: float = rate * h * (t * k.y0[8] + ends + h * slopes)
    return energy


@jit
def _stop_leak(k: Work, par: Array, tab: Tables) -> int:
    """End a leak at the start of a step when too little is left to leak; 0 or 1 as `rhs`."""
    memory = k.memory
    left = memory[CHARGE] - memory[LEAK_RATE] * memory[T_LAST]
    if memory[LEAK_RATE] == 0.0 or left > LEAST_CHARGE * par[_NOMINAL_CHARGE]:
        return 0
    memory[CHARGE], memory[LEAK_RATE], k.drive[LEAK] = left, 0.0, 0.0
    return _rate(k, memory[T_LAST], k.y0, k.f0, par, tab)


@jit
def _read(k: Work, par: Array, tab: Tables, after: float) -> int:
    """State `after` seconds from the start of the last step in `y`, results there in `aux`; 0 or 1 as `rhs`."""
    h = k.memory[H_LAST]
    k.memory[LEAKED_NOW_J] = k.memory[LEAKED_J] + _leaked(k, after)
    if after == h:
        _copy(k.y1, k.y)
        _copy(k.aux_1, k.aux)
        return 0
    if k.memory[EXPONENTIAL] != 0.0:
        if k.memory[PHI_S] != after:
            _make_phi(k, after)
        _exponential_state(k, after / h, h, k.y)
    else:
        t = after / h
        a = t * t * (3.0 - 2.0 * t)
        b = t * (1.0 - t) * (1.0 - t) * h
        c = t * t * (t - 1.0) * h
        for i in range(N_STATES):
            k.y[i] = k.y0[i] + a * (k.y1[i] - k.y0[i]) + b * k.f0[i] + c * k.f1[i]
    # Reading results must not disturb the steps to come: the solver's warm start stays theirs.
    guess_e, guess_c = k.guess[0], k.guess[1]
    status = _rate(k, k.memory[T_LAST] + after, k.y, k.rate, par, tab)
    k.guess[0], k.guess[1] = guess_e, guess_c
    return status


@jit
def _restart(k: Work, par: Array, tab: Tables) -> int:
    """Begin anew at `y` with other inputs; 0 or 1 as `rhs`."""
    memory = k.memory
    memory[CHARGE] -= memory[LEAK_RATE] * memory[T_HELD]
    memory[LEAKED_J] = memory[LEAKED_NOW_J]
    set_drive(k.held, par, k.drive)
    if memory[CHARGE] <= LEAST_CHARGE * par[_NOMINAL_CHARGE]:
        k.drive[LEAK] = 0.0
    memory[LEAK_RATE] = k.drive[LEAK]
    for i in range(N_STATES):
        k.y0[i] = k.y1[i] = k.y[i]
    status = _rate(k, 0.0, k.y1, k.f1, par, tab)
    _copy(k.aux, k.aux_1)
    memory[POWERS] = _powers(k.aux)
    memory[FIRST] = FIRST_STEP_S if memory[T_HELD] <= 0.0 else min(memory[T_HELD], FIRST_STEP_S)
    memory[T_LAST] = memory[H_LAST] = memory[CLOCK_NS] = memory[T_HELD] = 0.0
    memory[H_NEXT] = min(memory[H_NEXT], FIRST_STEP_S)
    return status


@jit
def run(work: Array, par: Array, tab: Tables, inputs: Array, duration_s: float, out: Array) -> int:
    """Run on with `inputs` held, clipped to the permitted box.

    Parameters
    ----------
    work : (N_WORK,) array
        From `new_work`.
    par, tab
        As `ac_plant_node.model.rhs`.
    inputs : (N_HELD,) array
        Inputs and faults as in `ac_plant_node.inputs`.
    duration_s : float
        Resolved to a nanosecond.
    out : (4,) array
        Result: p_e Pa, SH K, T_w degC, p_c Pa.

    Returns
    -------
    int
        0; 1 when the state cannot be continued inside the property tables; 2 for inputs that are not finite.
    """
    k = views(work)
    changed = False
    for i in range(N_HELD):
        if not np.isfinite(inputs[i]):
            return NOT_FINITE
    for i in range(N_HELD):
        w = min(max(inputs[i], HELD_LOW[i]), HELD_HIGH[i])
        changed = changed or w != k.held[i]
        k.held[i] = w
    if changed and _restart(k, par, tab) != 0:
        k.held[0] = np.nan  # the next call has to begin anew, too
        return OUTSIDE
    memory = k.memory
    memory[CLOCK_NS] += round(duration_s * 1.0e9)
    until = memory[CLOCK_NS] * 1.0e-9
    while memory[T_LAST] + memory[H_LAST] < until:
        memory[LEAKED_J] += _leaked(k, memory[H_LAST])
        memory[T_LAST] += memory[H_LAST]
        for i in range(N_STATES):
            k.y0[i] = k.y1[i]
            k.f0[i] = k.f1[i]
        if _stop_leak(k, par, tab) != 0:
            return OUTSIDE
        first, memory[FIRST], memory[EXPONENTIAL] = memory[FIRST], 0.0, 0.0
        if not (first > 0.0 and _exponential_step(k, first, par, tab)) and _rosenbrock_step(k, par, tab) != 0:
            return OUTSIDE
        _copy(k.aux, k.aux_1)
        powers = _powers(k.aux)
        memory[MOVED] += 0.5 * memory[H_LAST] * (powers + memory[POWERS])
        memory[POWERS] = powers
    memory[T_HELD] = until
    status = _read(k, par, tab, until - memory[T_LAST])
    out[0], out[1], out[2], out[3] = k.aux[P_E], k.aux[SUPERHEAT], k.aux[WALL_E2] - 273.15, k.aux[P_C]
    return status


def new_work(state: Array, tolerance: float = DEFAULT_TOLERANCE) -> Array:
    """Array of an integration that starts at `state` (12,), see `ac_plant_node.model`; `run` goes on with it."""
    work = np.zeros(N_WORK)
    k = views(work)
    k.guess[:], k.held[:] = new_workspace()[0], np.nan
    k.y[:] = state
    k.y[5] = 0.0
    k.memory[CHARGE] = state[0] + state[5]
    k.memory[H_NEXT] = 0.02
    k.memory[TOLERANCE] = tolerance
    k.memory[AGE] = max(MAX_AGE, MAX_PHI_AGE)
    return work
