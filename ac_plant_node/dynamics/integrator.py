"""Time integration of the plant in compiled code: adaptive, L-stable, conserving, and free of Python loops.

Conservation: the integration vector ``y`` is the state ``s`` of `ac_plant_node.dynamics.balances` with one exchange.
The mass of the condenser is the total charge minus the evaporator's, so it needs no equation; in its slot the integral
of net heat and work is carried, less the energy that leaks out. Stored energy minus that integral is linear in ``y``
and every Rosenbrock step keeps it. A leak's rate is held as the inputs are, so the total charge is a known function of
time.

Step sizes are chosen by error control and do not end where a caller's duration ends: the state between is read from
the cubic Hermite interpolant of the last step, which keeps linear invariants too. A step with unchanged inputs goes on
where the last one stopped, so the trajectory does not depend on how a duration is cut.

The first step after a change of inputs is an exponential one (`ac_plant_node.dynamics.exponential`), all others are
those of a Rosenbrock method (`ac_plant_node.dynamics.rosenbrock`).
"""

import numpy as np

from ac_plant_node.dynamics.balances import (
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
from ac_plant_node.dynamics.drive import LEAK, set_drive
from ac_plant_node.dynamics.exponential import MAX_PHI_AGE, exponential_state, exponential_step, make_phi
from ac_plant_node.dynamics.linear_algebra import copy_into
from ac_plant_node.dynamics.rosenbrock import MAX_AGE, rosenbrock_step
from ac_plant_node.dynamics.workspace import (
    AGE,
    CHARGE,
    CLOCK_NS,
    EXPONENTIAL,
    FIRST,
    H_LAST,
    H_NEXT,
    LEAK_RATE,
    LEAKED_J,
    LEAKED_NOW_J,
    MOVED,
    N_WORK,
    PHI_S,
    POWERS,
    T_HELD,
    T_LAST,
    TOLERANCE,
    Work,
    rates_of,
    views,
)
from ac_plant_node.inputs import HELD_HIGH, HELD_LOW, N_HELD
from ac_plant_node.parameters.values import INDEX
from ac_plant_node.properties.compiled import Array, jit
from ac_plant_node.properties.tables import Tables

DEFAULT_TOLERANCE = 1.0e-5
"""Local error per step allowed, relative to `ERROR_SCALE`."""
LEAST_CHARGE = 0.2
"""A leak ends when this share of the nominal charge is left, about what fills the heat exchangers with vapour."""
LEAST_PRESSURE_PA = 101325.0
"""A leak ends when the condenser's pressure is no higher than the atmosphere's."""
FIRST_STEP_S = 0.1
"""Longest first step after a change of inputs: one control interval. An exponential one takes as long as the inputs
before were held, if that is less."""
OUTSIDE, NOT_FINITE = 1, 2
"""What `run` may return instead of 0."""

_NOMINAL_CHARGE = INDEX["charge_kg"]


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
def _stop_leak(k: Work, par: Array, tab: Tables, y: Array, rate: Array) -> int:
    """End a leak at the start of a step when nothing is left to leak or to drive it out; 0 or 1 as `rhs`."""
    memory = k.memory
    left = memory[CHARGE] - memory[LEAK_RATE] * memory[T_LAST]
    leaks = left > LEAST_CHARGE * par[_NOMINAL_CHARGE] and k.aux_1[P_C] > LEAST_PRESSURE_PA
    if memory[LEAK_RATE] == 0.0 or leaks:
        return 0
    memory[CHARGE], memory[LEAK_RATE], k.drive[LEAK] = left, 0.0, 0.0
    return rates_of(k, memory[T_LAST], y, rate, par, tab)


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
    memory[LEAK_RATE] = k.drive[LEAK]
    for i in range(N_STATES):
        k.y0[i] = k.y1[i] = k.y[i]
    memory[T_LAST] = 0.0
    status = rates_of(k, 0.0, k.y1, k.f1, par, tab)
    copy_into(k.aux, k.aux_1)
    if status == 0:
        status = _stop_leak(k, par, tab, k.y1, k.f1)
    memory[POWERS] = _powers(k.aux)
    memory[FIRST] = FIRST_STEP_S if memory[T_HELD] <= 0.0 else min(memory[T_HELD], FIRST_STEP_S)
    memory[H_LAST] = memory[CLOCK_NS] = memory[T_HELD] = 0.0
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
        As `ac_plant_node.dynamics.balances.rhs`.
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
        if _stop_leak(k, par, tab, k.y0, k.f0) != 0:
            return OUTSIDE
        first, memory[FIRST], memory[EXPONENTIAL] = memory[FIRST], 0.0, 0.0
        if not (first > 0.0 and exponential_step(k, first, par, tab)) and rosenbrock_step(k, par, tab) != 0:
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
    """Array of an integration that starts at `state` (12,), as in `balances`; `run` goes on with it."""
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
