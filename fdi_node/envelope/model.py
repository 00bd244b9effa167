"""The plant as the observer sees it: driven by what is told and by the unknowns, with Jacobians by differences."""

from typing import NamedTuple

import numpy as np

from ac_plant_node.dynamics.balances import (
    N_STATES,
    P_C,
    P_E,
    SUPERHEAT,
    WALL_E2,
    balances,
    condenser_zones,
    evaporator_zones,
)
from ac_plant_node.dynamics.drive import ETA_S, set_drive
from ac_plant_node.dynamics.transfer import Suction, flows
from ac_plant_node.dynamics.workspace import CHARGE, ERROR_SCALE, Work
from ac_plant_node.dynamics.zones import Condenser, Evaporator
from ac_plant_node.inputs import HELD_HIGH, HELD_LOW, N_HELD
from ac_plant_node.properties.tables import Tables
from fdi_node.envelope.compiled import Array, jit

N_READINGS = 4
READING_SCALE = np.array([1.0e3, 1.0, 1.0, 1.0e4])
"""Sizes of p_e, SH, T_w, p_c, for numbers without units."""
STATE_SCALE = ERROR_SCALE
"""Sizes of the integration vector's components."""
ENERGY = 5
"""The component of the integration vector that is an integral of heat, and no state."""

FACTOR, ADDED, READING, PARAMETER = range(4)  # as `fdi_node.envelope.unknowns.Place`
PLACE, POSITION, SCALE, LOWEST, HIGHEST = range(5)  # columns of `fdi_node.envelope.unknowns.table`


@jit
def apply(x: Array, rows: Array, told: Array, nominal: Array, par: Array, held: Array) -> None:
    """Work out what the plant is driven by, `held` (N_HELD,), and its parameters `par`.

    Parameters
    ----------
    x : (m,) array
        The unknowns.
    rows : (m, 5) array
        From `fdi_node.envelope.unknowns.table`.
    told : (N_HELD,) array
        The plant's inputs as commanded and measured.
    nominal : array
        The design's parameters.
    """
    for i in range(N_HELD):
        held[i] = told[i]
    for i in range(par.shape[0]):
        par[i] = nominal[i]
    for i in range(rows.shape[0]):
        place, at = int(rows[i, PLACE]), int(rows[i, POSITION])
        if place == FACTOR:
            held[at] *= np.exp(x[i])
        elif place == ADDED:
            held[at] += x[i]
        elif place == PARAMETER:
            par[at] *= np.exp(x[i])
    for i in range(N_HELD):
        held[i] = min(max(held[i], HELD_LOW[i]), HELD_HIGH[i])


@jit
def _drive(k: Work, x: Array, rows: Array, told: Array, nominal: Array, par: Array) -> None:
    """Set what the rates are driven by."""
    apply(x, rows, told, nominal, par, k.held)
    set_drive(k.held, par, k.drive)


@jit
def _outputs(k: Work, out: Array) -> None:
    out[0], out[1], out[2], out[3] = k.aux[P_E], k.aux[SUPERHEAT], k.aux[WALL_E2] - 273.15, k.aux[P_C]


class Base(NamedTuple):
    """Zones of the state that differences are taken around, with 1 where there are none inside the tables."""

    evaporator: Evaporator
    suction: Suction
    outside_e: int
    condenser: Condenser
    outside_c: int


@jit
def _rates(
    k: Work,
    s: Array,
    par: Array,
    tab: Tables,
    base: Base,
    other_evaporator: bool,
    other_condenser: bool,
    dy: Array,
    out: Array,
) -> int:
    """Rates and outputs at the integration state `s`; the base's zones where they are no others; 0 if there are any."""
    ev, suction, failed_e, co, failed_c = base
    if other_evaporator:
        ev, suction, failed_e = evaporator_zones(s, par, tab, ev.p)
    if other_condenser:
        co, failed_c = condenser_zones(s, k.drive, suction, par, tab, co.p)
    balances(s, k.drive, par, ev, suction, co, flows(ev, co, suction, s[8], k.drive, par, tab), k.z, dy, k.aux)
    _outputs(k, out)
    return int(failed_e + failed_c)


@jit
def linearise(
    k: Work,
    x: Array,
    rows: Array,
    told: Array,
    nominal: Array,
    par: Array,
    tab: Tables,
    step: Array,
    A: Array,
    C: Array,
) -> None:
    """Work out the Jacobians of rates and outputs at the present state, in units of the scales, by central differences.

    A column whose differences leave the property tables is zero. Only what depends on it is worked out again: wall
    temperatures move no zone, the condenser's energy and first zone not the evaporator, the plant's inputs no zone
    unless through the compressor's efficiency.

    Parameters
    ----------
    k : Work
        Of the observer's integration; its state is kept, its drive is not: the integration has to begin anew.
    x, rows, told, nominal, par
        As `apply`.
    tab : Tables
    step : (12 + m,) array
        Half the distance of the differences, in units of the scales; 0: the column stays zero.
    A, C : (12, 12 + m) and (4, 12 + m) arrays
        Results: rates per second, readings.
    """
    m, charge = rows.shape[0], k.memory[CHARGE]
    up, down, s = np.zeros(N_STATES), np.zeros(N_STATES), k.s
    out_up, out_down, moved = np.zeros(N_READINGS), np.zeros(N_READINGS), np.zeros(m)
    A[:, :], C[:, :] = 0.0, 0.0
    _drive(k, x, rows, told, nominal, par)
    for i in range(N_STATES):
        s[i] = k.y[i]
    s[ENERGY] = charge - s[0]
    efficiency = k.drive[ETA_S]
    ev, suction, outside_e = evaporator_zones(s, par, tab, k.guess[0])
    co, outside_c = condenser_zones(s, k.drive, suction, par, tab, k.guess[1])
    base = Base(ev, suction, outside_e, co, outside_c)
    for j in range(N_STATES + m):
        if j == ENERGY or step[j] == 0.0:
            continue
        u = j - N_STATES
        scale = STATE_SCALE[j] if u < 0 else rows[u, SCALE]
        if u >= 0 and int(rows[u, PLACE]) == READING:
            at = int(rows[u, POSITION])
            C[at, j] = scale / READING_SCALE[at]
            continue
        is_parameter, is_wall = u >= 0 and int(rows[u, PLACE]) == PARAMETER, j == 3 or j == 4 or 9 <= j < N_STATES
        other_evaporator = j < 3 or j == 8 or is_parameter
        failed = 0
        for sign in range(2):
            d = step[j] * scale if sign == 0 else -step[j] * scale
            dy, out = (up, out_up) if sign == 0 else (down, out_down)
            if u < 0:
                s[j] = k.y[j] + d
                s[ENERGY] = charge - s[0]
            else:
                for i in range(m):
                    moved[i] = x[i]
                moved[u] += d
                _drive(k, moved, rows, told, nominal, par)
            other_condenser = (u < 0 and not is_wall) or is_parameter or k.drive[ETA_S] != efficiency
            failed += _rates(k, s, par, tab, base, other_evaporator, other_condenser, dy, out)
        if u < 0:
            s[j] = k.y[j]
        else:
            _drive(k, x, rows, told, nominal, par)
        s[ENERGY] = charge - s[0]
        if failed == 0:
            for i in range(N_STATES):
                A[i, j] = (up[i] - down[i]) / (2.0 * step[j] * STATE_SCALE[i]) if i != ENERGY else 0.0
            for i in range(N_READINGS):
                C[i, j] = (out_up[i] - out_down[i]) / (2.0 * step[j] * READING_SCALE[i])
    k.held[0] = np.nan
