"""The observer's step over one tick: with two right-hand sides where that is enough, else the plant's own."""

import numpy as np

from ac_plant_node.dynamics import integrator
from ac_plant_node.dynamics.balances import N_STATES, P_C, P_E, SUPERHEAT, WALL_E2
from ac_plant_node.dynamics.drive import set_drive
from ac_plant_node.dynamics.exponential import MAX_PHI_AGE, MAX_PHI_ERROR
from ac_plant_node.dynamics.linear_algebra import copy_into
from ac_plant_node.dynamics.workspace import (
    AGE,
    ERROR_SCALE,
    PHI_1,
    PHI_2,
    PHI_S,
    T_HELD,
    TOLERANCE,
    Work,
    rates_of,
)
from ac_plant_node.properties.tables import Tables
from fdi_node.envelope.compiled import Array, jit
from fdi_node.envelope.model import N_READINGS, READING_SCALE


@jit
def _short_step(k: Work, par: Array, tab: Tables, h: float, C: Array, out: Array) -> bool:
    """Step of length h by ``y + h [phi_1(hJ) f(y) + phi_2(hJ) N]``; False if that will not do.

    N is what the rates at the end of the step that is linear are beside those of the linear plant, and taken to grow in
    proportion to time (an exponential Rosenbrock method with two stages: Hochbruck, Ostermann & Schweitzer, SIAM J.
    Numer. Anal. 47 (2009) 786). It is enough where N moves the state by no more than the error that the plant's own
    step may have. By so little outputs move as their Jacobian `C` (4, n) says.
    """
    memory, d, N = k.memory, k.u[0], k.u[1]
    if memory[AGE] >= MAX_PHI_AGE or memory[PHI_S] != h or rates_of(k, 0.0, k.y, k.f0, par, tab) != 0:
        return False
    for i in range(N_STATES):
        v = 0.0
        for j in range(N_STATES):
            v += k.phi[PHI_1, i, j] * k.f0[j]
        d[i] = h * v
        k.y1[i] = k.y[i] + d[i]
    if rates_of(k, 0.0, k.y1, k.f1, par, tab) != 0:
        return False
    for i in range(N_STATES):
        v = k.f1[i] - k.f0[i]
        for j in range(N_STATES):
            v -= k.jac[i, j] * d[j]
        N[i] = v
    total = 0.0
    for i in range(N_STATES):
        v = 0.0
        for j in range(N_STATES):
            v += k.phi[PHI_2, i, j] * N[j]
        d[i] = h * v / ERROR_SCALE[i]
        total += d[i] * d[i]
    if not np.sqrt(total / N_STATES) <= MAX_PHI_ERROR * memory[TOLERANCE]:
        return False
    out[0], out[1], out[2], out[3] = k.aux[P_E], k.aux[SUPERHEAT], k.aux[WALL_E2] - 273.15, k.aux[P_C]
    for i in range(N_STATES):
        k.y[i] = k.y1[i] + d[i] * ERROR_SCALE[i]
        for r in range(N_READINGS):
            out[r] += C[r, i] * d[i] * READING_SCALE[r]
    memory[AGE] += 1.0
    return True


@jit
def go_on(k: Work, work: Array, par: Array, tab: Tables, held: Array, h: float, C: Array, out: Array) -> int:
    """Go on to the next tick from a corrected state, driven by `held`; result as that of `integrator.run`."""
    k.memory[T_HELD] = h
    set_drive(held, par, k.drive)
    if _short_step(k, par, tab, h, C, out):
        copy_into(held, k.held)
        return 0
    k.held[0] = np.nan  # the integration has to begin anew
    status: int = integrator.run(work, par, tab, held, h, out)
    return status
