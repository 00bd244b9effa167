"""The observer's step over one tick: with two or three right-hand sides where that will do, else the plant's own."""

import numpy as np

from ac_plant_node.dynamics import integrator
from ac_plant_node.dynamics.balances import N_STATES, P_C, P_E, SUPERHEAT, WALL_E2
from ac_plant_node.dynamics.drive import set_drive
from ac_plant_node.dynamics.exponential import (
    MAX_PHI_ERROR,
    as_parabola,
    exponential_state,
    make_phi,
    remainder,
)
from ac_plant_node.dynamics.linear_algebra import copy_into
from ac_plant_node.dynamics.workspace import (
    AGE,
    ERROR_SCALE,
    PHI_1,
    PHI_2,
    PHI_HALF,
    PHI_S,
    T_HELD,
    TOLERANCE,
    Work,
    rates_of,
)
from ac_plant_node.properties.tables import Tables
from fdi_node.envelope.compiled import Array, jit
from fdi_node.envelope.model import N_READINGS, READING_SCALE

MAX_PARABOLA_ERROR = 200.0
"""Largest error estimate of a step with N as a parabola, in units of the tolerance. The estimate is what the parabola
changes; the step itself is at least twice as good, and leaves no more than the steps with N as a straight line do."""


@jit
def _short_step(k: Work, par: Array, tab: Tables, h: float, C: Array, out: Array) -> float:
    """Step of length h by ``y + h [phi_1(hJ) f(y) + phi_2(hJ) a + 2 phi_3(hJ) b]``; inf if that will not do.

    N is what the rates are beside those of the linear plant, along the step of the linear plant, and ``a t/h + b
    (t/h)^2`` in time (an exponential Rosenbrock method: Hochbruck, Ostermann & Schweitzer, SIAM J. Numer. Anal. 47
    (2009) 786). A straight line, b = 0, takes two right-hand sides; it is enough where N moves the state by no more
    than the error that the plant's own step may have. Else a parabola takes a third one. Outputs are those at the end
    of the linear step, and move with the rest as their Jacobian `C` (4, n) says. Returned is by how much N as a line
    moves the state, in units of the tolerance.
    """
    memory, end, a, b, half = k.memory, k.u[0], k.u[1], k.u[2], k.u[3]
    if rates_of(k, 0.0, k.y, k.f0, par, tab) != 0:
        return np.inf
    if memory[PHI_S] != h:
        make_phi(k, h)
    copy_into(k.y, k.y0)
    for i in range(N_STATES):
        v = 0.0
        for j in range(N_STATES):
            v += k.phi[PHI_1, i, j] * k.f0[j]
        end[i] = h * v
    if remainder(k, h, end, a, par, tab) != 0:
        return np.inf
    out[0], out[1], out[2], out[3] = k.aux[P_E], k.aux[SUPERHEAT], k.aux[WALL_E2] - 273.15, k.aux[P_C]
    total = 0.0
    for i in range(N_STATES):
        v = 0.0
        for j in range(N_STATES):
            v += k.phi[PHI_2, i, j] * a[j]
        k.y1[i] = k.y[i] + end[i] + h * v
        total += (h * v / ERROR_SCALE[i]) ** 2
    left = float(np.sqrt(total / N_STATES) / memory[TOLERANCE])
    if not left <= MAX_PHI_ERROR:
        for i in range(N_STATES):
            v = 0.0
            for j in range(N_STATES):
                v += k.phi[PHI_HALF, i, j] * k.f0[j]
            half[i] = 0.5 * h * v
        if remainder(k, 0.5 * h, half, b, par, tab) != 0:
            return np.inf
        as_parabola(a, b)
        if not exponential_state(k, 1.0, h, k.y1) <= MAX_PARABOLA_ERROR:
            return np.inf
    for i in range(N_STATES):
        d = (k.y1[i] - k.y[i] - end[i]) / ERROR_SCALE[i]
        for r in range(N_READINGS):
            out[r] += C[r, i] * d * READING_SCALE[r]
    copy_into(k.y1, k.y)
    memory[AGE] += 1.0
    return left


@jit
def go_on(k: Work, work: Array, par: Array, tab: Tables, held: Array, h: float, C: Array, out: Array) -> float:
    """Go on to the next tick from a corrected state, driven by `held`, with outputs `out` (4,) there.

    Returns
    -------
    float
        As `_short_step`, inf for a step of the plant's own; nan when the state cannot be continued inside the property
        tables or `held` is not finite.
    """
    k.memory[T_HELD] = h
    set_drive(held, par, k.drive)
    left: float = _short_step(k, par, tab, h, C, out)
    if left < np.inf:
        copy_into(held, k.held)
        return left
    k.held[0] = np.nan  # the integration has to begin anew
    return np.inf if integrator.run(work, par, tab, held, h, out) == 0 else np.nan
