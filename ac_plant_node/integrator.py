"""Time integration of the plant in compiled code: the loop over substeps never returns to Python."""

import numpy as np
from numba import njit

from ac_plant_node.model import HEAT_IN, N_STATES, POWER, Q_AIR_C, Q_AIR_E, rhs

SUBSTEP_S = 0.02
"""Length of the classical Runge-Kutta substep (the fastest mode of the plant, about 50 1/s, allows 0.05 s)."""

_JIT = {"cache": True, "error_model": "numpy", "fastmath": False}


@njit(**_JIT)
def march(s, w, par, tab, guess, z, work, aux, tally, n, h):  # type: ignore[no-untyped-def]
    """`n` Runge-Kutta substeps of length `h` with inputs `w` held; `s` and `tally` are updated in place.

    `tally` holds the integrals of net heat and work, and of their magnitudes (J), by the same quadrature as the state:
    stored energy minus the first is constant to round-off.

    Returns 0, or 1 when the state left what the tables hold.
    """
    k1, k2, k3, k4, trial = work[0], work[1], work[2], work[3], work[4]
    for _ in range(n):
        status = rhs(s, w, par, tab, guess, z, k1, aux)
        heat = aux[HEAT_IN]
        moved = abs(aux[Q_AIR_E]) + abs(aux[Q_AIR_C]) + abs(aux[POWER])
        for i in range(N_STATES):
            trial[i] = s[i] + 0.5 * h * k1[i]
        status = max(status, rhs(trial, w, par, tab, guess, z, k2, aux))
        heat += 2.0 * aux[HEAT_IN]
        moved += 2.0 * (abs(aux[Q_AIR_E]) + abs(aux[Q_AIR_C]) + abs(aux[POWER]))
        for i in range(N_STATES):
            trial[i] = s[i] + 0.5 * h * k2[i]
        status = max(status, rhs(trial, w, par, tab, guess, z, k3, aux))
        heat += 2.0 * aux[HEAT_IN]
        moved += 2.0 * (abs(aux[Q_AIR_E]) + abs(aux[Q_AIR_C]) + abs(aux[POWER]))
        for i in range(N_STATES):
            trial[i] = s[i] + h * k3[i]
        status = max(status, rhs(trial, w, par, tab, guess, z, k4, aux))
        heat += aux[HEAT_IN]
        moved += abs(aux[Q_AIR_E]) + abs(aux[Q_AIR_C]) + abs(aux[POWER])
        for i in range(N_STATES):
            s[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
        tally[0] += h / 6.0 * heat
        tally[1] += h / 6.0 * moved
        if status != 0:
            return status
    return rhs(s, w, par, tab, guess, z, work[0], aux)


def new_work() -> np.ndarray:
    """Work space of `march`."""
    return np.zeros((5, N_STATES))
