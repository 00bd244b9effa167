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

The first step after a change of inputs is an exponential one (`ac_plant_node.dynamics.exponential`).
"""

import numpy as np

from ac_plant_node.compiled import Array, jit
from ac_plant_node.dynamics.drive import LEAK, set_drive
from ac_plant_node.dynamics.exponential import MAX_PHI_AGE, exponential_state, exponential_step, make_phi
from ac_plant_node.dynamics.linear_algebra import copy_into, factor, substitute
from ac_plant_node.dynamics.workspace import (
    AGE,
    CHARGE,
    CLOCK_NS,
    ERROR_SCALE,
    EXPONENTIAL,
    FIRST,
    H_LAST,
    H_NEXT,
    LEAK_RATE,
    LEAKED_J,
    LEAKED_NOW_J,
    MOVED,
    N_REJECTED,
    N_STEPS,
    N_WORK,
    PHI_S,
    POWERS,
    T_HELD,
    T_LAST,
    TOLERANCE,
    Work,
    make_jacobian,
    rates_of,
    views,
)
from ac_plant_node.inputs import HELD_HIGH, HELD_LOW, N_HELD
from ac_plant_node.model import (
    N_STATES,
    P_C,
    P_E,
    POWER,
    Q_AIR_C,
    Q_AIR_E,
    SUPERHEAT,
    WALL_E2,
    new_workspace,
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
OUTSIDE, NOT_FINITE = 1, 2
"""What `run` may return instead of 0."""

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
_NOMINAL_CHARGE = INDEX["charge_kg"]


@jit
def _rosenbrock_step(k: Work, par: Array, tab: Tables) -> int:
    """One accepted step from y0 (rate f0 known) to y1 (rate f1); sizes in `memory`. 0, or 1 when none worked."""
    n, memory, y0, y1, u, lu = N_STATES, k.memory, k.y0, k.y1, k.u, k.lu
    if memory[AGE] >= MAX_AGE:
        make_jacobian(k, par, tab)
    h = memory[H_NEXT]
    rejected = False
    for _ in range(40):
        diagonal = 1.0 / (_GAMMA * h)
        for i in range(n):
            for j in range(n):
                lu[i, j] = -k.jac[i, j]
            lu[i, i] += diagonal
        ok = factor(lu, k.pivots)
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
                    if rates_of(k, memory[T_LAST] + h * _SHARE[stage], k.trial, u[stage], par, tab) != 0:
                        ok = False
                        break
                    for i in range(n):
                        v = 0.0
                        for m in range(stage):
                            v += _C[stage, m] * u[m, i]
                        u[stage, i] += v / h
                substitute(lu, k.pivots, u[stage])
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
            ok = error == error and rates_of(k, memory[T_LAST] + h, y1, k.f1, par, tab) == 0
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
            make_jacobian(k, par, tab)
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
    return rates_of(k, memory[T_LAST], k.y0, k.f0, par, tab)


@jit
def _read(k: Work, par: Array, tab: Tables, after: float) -> int:
    """State `after` seconds from the start of the last step in `y`, results there in `aux`; 0 or 1 as `rhs`."""
    h = k.memory[H_LAST]
    k.memory[LEAKED_NOW_J] = k.memory[LEAKED_J] + _leaked(k, after)
    if after == h:
        copy_into(k.y1, k.y)
        copy_into(k.aux_1, k.aux)
        return 0
    if k.memory[EXPONENTIAL] != 0.0:
        if k.memory[PHI_S] != after:
            make_phi(k, after)
        exponential_state(k, after / h, h, k.y)
    else:
        t = after / h
        a = t * t * (3.0 - 2.0 * t)
        b = t * (1.0 - t) * (1.0 - t) * h
        c = t * t * (t - 1.0) * h
        for i in range(N_STATES):
            k.y[i] = k.y0[i] + a * (k.y1[i] - k.y0[i]) + b * k.f0[i] + c * k.f1[i]
    # Reading results must not disturb the steps to come: the solver's warm start stays theirs.
    guess_e, guess_c = k.guess[0], k.guess[1]
    status = rates_of(k, k.memory[T_LAST] + after, k.y, k.rate, par, tab)
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
    status = rates_of(k, 0.0, k.y1, k.f1, par, tab)
    copy_into(k.aux, k.aux_1)
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
        if not (first > 0.0 and exponential_step(k, first, par, tab)) and _rosenbrock_step(k, par, tab) != 0:
            return OUTSIDE
        copy_into(k.aux, k.aux_1)
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
