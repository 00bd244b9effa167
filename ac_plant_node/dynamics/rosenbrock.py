"""A step of the Rosenbrock W-method ROS34PW2, with its error control.

Rang & Angermann, BIT 45 (2005) 761: order 3 in four stages, L-stable and stiffly accurate. A W-method keeps its order
with an approximate Jacobian, here by forward differences of the compiled right-hand side, once in a few steps. It stays
stable where zones vanish and the plant gets arbitrarily stiff.
"""

import numpy as np

from ac_plant_node.dynamics.balances import N_STATES
from ac_plant_node.dynamics.linear_algebra import factor, substitute
from ac_plant_node.dynamics.workspace import (
    AGE,
    ERROR_SCALE,
    H_LAST,
    H_NEXT,
    N_REJECTED,
    N_STEPS,
    T_LAST,
    TOLERANCE,
    Work,
    make_jacobian,
    rates_of,
)
from ac_plant_node.properties.compiled import Array, jit
from ac_plant_node.properties.tables import Tables

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


@jit
def rosenbrock_step(k: Work, par: Array, tab: Tables) -> int:
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
