"""The memory of one integration: its layout in one flat array, the rates in terms of it, and their Jacobian."""

from typing import NamedTuple

import numpy as np

from ac_plant_node.dynamics.balances import HEAT_IN, N_AUX, N_STATES, balances, condenser_zones, evaporator_zones, rhs
from ac_plant_node.dynamics.drive import N_DRIVE
from ac_plant_node.dynamics.transfer import flows
from ac_plant_node.inputs import N_HELD
from ac_plant_node.properties.compiled import Array, jit
from ac_plant_node.properties.tables import Tables

ERROR_SCALE = np.array([1e-2, 1e3, 1e5, 5.0, 5.0, 1e5, 1e4, 0.1, 1e5, 5.0, 5.0, 5.0])
"""Sizes of the components of y for error control."""

_DIFFERENCE = np.array([1e-8, 1e-3, 1e-1, 1e-5, 1e-5, 1.0, 1e-3, 1e-7, 1e-1, 1e-5, 1e-5, 1e-5])

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
    `z`: as `ac_plant_node.dynamics.balances.rhs`; `y0`, `f0`, `y1`, `f1`, `aux_1`: ends of the last step, rates and
    results there; `u`: stages; `jac`, `lu`, `pivots`, `phi`: matrices; `trial`, `s`, `rate`: work space.
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
def rates_of(k: Work, t: float, y: Array, dy: Array, par: Array, tab: Tables) -> int:
    """Right-hand side in terms of the integration vector y, `t` seconds after the last change of inputs."""
    for i in range(N_STATES):
        k.s[i] = y[i]
    k.s[5] = k.memory[CHARGE] - k.memory[LEAK_RATE] * t - y[0]
    status = rhs(k.s, k.drive, par, tab, k.guess, k.z, dy, k.aux)
    dy[5] = k.aux[HEAT_IN] - k.memory[LEAK_RATE] * y[8]
    return status


@jit
def make_jacobian(k: Work, par: Array, tab: Tables) -> None:
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
            failed = rates_of(k, now, trial, dy, par, tab)
            for i in range(n):
                s[i] = k.y0[i]
            s[5] = charge - k.y0[0]
        if failed != 0:
            trial[j] = k.y0[j] - _DIFFERENCE[j]
            rates_of(k, now, trial, dy, par, tab)
            for i in range(n):
                s[i] = k.y0[i]
            s[5] = charge - k.y0[0]
        inv = 1.0 / (trial[j] - k.y0[j])
        for i in range(n):
            k.jac[i, j] = (dy[i] - k.f0[i]) * inv
    k.memory[AGE] = k.memory[PHI_S] = 0.0
