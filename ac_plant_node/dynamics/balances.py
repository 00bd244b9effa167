"""Compiled right-hand side of the moving-boundary air conditioner, every zone present or absent.

States
------
The public state is the paper's ``x = [zeta_e1, p_e, h_e2, T_e1w, T_e2w | zeta_c1, zeta_c2, p_c, h_c3, T_c1w, T_c2w,
T_c3w]``. Time integration runs in twelve other coordinates of the same state,

``s = [M_e, U_e, h_e2, T_ew, D_e | M_c, U_c, zeta_c1, h_c3, T_cw, D_c1, D_c3]``,

the refrigerant mass and internal energy of each heat exchanger, the mean temperature of each wall, and what is left:
outlet enthalpies, one zone length and differences of zone wall temperatures (``D_e = T_e1w - T_e2w``, ``D_c1 = T_c1w -
T_c2w``, ``D_c3 = T_c3w - T_c2w``). Mass and energy are *linear* in ``s``, so any Runge-Kutta or Rosenbrock step keeps
them to round-off, at zone switches too. Pressures and zone lengths follow from ``(M, U)`` by one scalar equation per
heat exchanger (`ac_plant_node.dynamics.zones`): it is the balance of the zones that exist, and *which* zones exist
is decided by that same equation, so nothing jumps in mass, energy or pressure when a zone appears or vanishes.

Regimes (the mode switch of Li & Alleyne, Int. J. Refrigeration 33 (2010) 538, with ``h_e2``, ``h_c3``, ``D`` as their
pseudo-states while the zone they describe is absent):

=========  ===============================  ==========================================
regime     evaporator                       condenser
=========  ===============================  ==========================================
0          two-phase + superheated          (superheated +) two-phase + subcooled
1          two-phase only, void free        (superheated +) two-phase, void free
2          vapour only                      vapour only
=========  ===============================  ==========================================

The superheated zone of the condenser may have length zero in every regime.

Balances: docs/plant.md derives them. Sources: He, Liu & Asada, ASME J. Dyn. Sys. 119 (1997) 183 (moving boundaries);
Zivi, ASME J. Heat Transfer 86 (1964) 247 (void fraction); McKinley & Alleyne, Int. J. Refrigeration 31 (2008) 1253
(mean void fraction as a state while a zone is absent).
"""

import numpy as np

from ac_plant_node.dynamics.descriptor import solve_descriptor
from ac_plant_node.dynamics.drive import ETA_S, G_C, G_E, T_AIR_C, T_AIR_E
from ac_plant_node.dynamics.transfer import (
    ZETA_FLOOR,
    Flows,
    Heat,
    Suction,
    flows,
    heat_flows,
    ramp,
    suction_state,
    upwind,
)
from ac_plant_node.dynamics.zones import (
    Condenser,
    Evaporator,
    condenser_at,
    evaporator_at,
    inventory,
    solve_condenser,
    solve_evaporator,
)
from ac_plant_node.parameters.values import INDEX
from ac_plant_node.properties.compiled import Array, jit
from ac_plant_node.properties.tables import Tables

N_STATES = 12
STATE_NAMES = (
    "zeta_e1", "p_e", "h_e2", "T_e1w", "T_e2w", "zeta_c1", "zeta_c2", "p_c", "h_c3", "T_c1w", "T_c2w", "T_c3w",
)  # fmt: skip
"""Names of the public state x."""

# Positions in the array of auxiliary results.
X, P_E, P_C = 0, 1, 7  # the public state, 12 numbers, with the pressures in it
M_COMPRESSOR, M_VALVE, Q_EVAPORATOR, Q_AIR_E, Q_AIR_C, POWER = 12, 13, 14, 15, 16, 17
H_DISCHARGE, SUPERHEAT, SUBCOOLING, REGIME_E, REGIME_C, ETA_V = 18, 19, 20, 21, 22, 23
VOID_E, VOID_C, HEAT_IN, WALL_E2, MASS, ENERGY = 24, 25, 26, 27, 28, 29
# Latent heat W, water that condenses kg/s, what of it falls on walls below 0 degC, its enthalpy as it leaves W.
LATENT, WATER, FROST, DRAINED = 30, 31, 32, 33
N_AUX = 34

# Parameter positions, as compile-time constants.
_VE, _AE, _CE = INDEX["evaporator_volume_m3"], INDEX["evaporator_inner_area_m2"], INDEX["evaporator_wall_j_k"]
_VC, _AC, _CC = INDEX["condenser_volume_m3"], INDEX["condenser_inner_area_m2"], INDEX["condenser_wall_j_k"]
_ETAS = INDEX["isentropic_efficiency"]
_TAU_WALL_S = 5.0  # lag with which the wall of an absent zone joins its neighbour's temperature


@jit
def _wall_rates(
    z: Array,
    ev: Evaporator,
    co: Condenser,
    heat: Heat,
    zeta_c3: float,
    own_e: float,
    own_c: float,
    s: Array,
    w: Array,
    par: Array,
    ds: Array,
) -> None:
    """Rates of the mean wall temperatures (energy) and of the differences between zones (moving boundaries)."""
    dzeta_e, dzeta_1, dzeta_3 = z[1, 7], z[4, 7], -z[4, 7] - z[5, 7]
    zeta_e2, d_e, d_1, d_3 = 1.0 - ev.zeta, s[4], s[10], s[11]
    up = upwind(dzeta_e, min(ev.zeta, zeta_e2))
    e_1 = (w[G_E] * (w[T_AIR_E] - heat.tw_e1) + heat.latent_1 - heat.q_e1) / par[_CE]
    e_1 -= up * d_e * dzeta_e / max(ev.zeta, ZETA_FLOOR)
    e_2 = (w[G_E] * (w[T_AIR_E] - heat.tw_e2) + heat.latent_2 - heat.q_e2) / par[_CE]
    e_2 -= (1.0 - up) * d_e * dzeta_e / max(zeta_e2, ZETA_FLOOR)
    up_1, up_3 = upwind(dzeta_1, min(co.zeta_1, co.zeta_2)), upwind(dzeta_3, min(zeta_c3, co.zeta_2))
    c_1 = (w[G_C] * (w[T_AIR_C] - heat.tw_c1) - heat.q_c1) / par[_CC]
    c_1 -= up_1 * d_1 * dzeta_1 / max(co.zeta_1, ZETA_FLOOR)
    c_3 = (w[G_C] * (w[T_AIR_C] - heat.tw_c3) - heat.q_c3) / par[_CC]
    c_3 -= up_3 * d_3 * dzeta_3 / max(zeta_c3, ZETA_FLOOR)
    c_2 = (w[G_C] * (w[T_AIR_C] - heat.tw_c2) - heat.q_c2) / par[_CC]
    c_2 -= ((1.0 - up_1) * d_1 * dzeta_1 + (1.0 - up_3) * d_3 * dzeta_3) / max(co.zeta_2, ZETA_FLOOR)
    own_1 = ramp(co.zeta_1 / ZETA_FLOOR)
    ds[3] = (heat.air_e - heat.q_e) / par[_CE]
    ds[4] = own_e * (e_1 - e_2) - (1.0 - own_e) * d_e / _TAU_WALL_S
    ds[9] = (heat.air_c - heat.q_c) / par[_CC]
    ds[10] = own_1 * (c_1 - c_2) - (1.0 - own_1) * d_1 / _TAU_WALL_S
    ds[11] = own_c * (c_3 - c_2) - (1.0 - own_c) * d_3 / _TAU_WALL_S


@jit
def _write_results(
    aux: Array,
    ev: Evaporator,
    co: Condenser,
    suction: Suction,
    flow: Flows,
    heat: Heat,
    zeta_c3: float,
    s: Array,
    par: Array,
) -> None:
    """What others read: the public state x, flows, and what the zones hold."""
    aux[0], aux[1], aux[2], aux[3], aux[4] = ev.zeta, ev.p, s[2], heat.tw_e1, heat.tw_e2
    aux[5], aux[6], aux[7], aux[8] = co.zeta_1, co.zeta_2, co.p, s[8]
    aux[9], aux[10], aux[11] = heat.tw_c1, heat.tw_c2, heat.tw_c3
    power = flow.m_c * (co.h_d - s[2])
    aux[M_COMPRESSOR], aux[M_VALVE], aux[ETA_V] = flow.m_c, flow.m_v, flow.eta_v
    aux[Q_EVAPORATOR], aux[Q_AIR_E], aux[Q_AIR_C], aux[POWER] = heat.q_e, heat.air_e, heat.air_c, power
    aux[HEAT_IN] = heat.air_e + heat.air_c + power
    aux[H_DISCHARGE], aux[SUPERHEAT], aux[SUBCOOLING] = co.h_d, suction.superheat, flow.subcooling
    aux[REGIME_E], aux[REGIME_C], aux[VOID_E], aux[VOID_C] = ev.regime, co.regime, ev.void, co.void_rest
    aux[WALL_E2] = heat.tw_e2 if ev.zeta < 1.0 else heat.tw_e1
    aux[LATENT], aux[WATER], aux[FROST], aux[DRAINED] = heat.latent, heat.water, heat.frost, heat.drained
    aux[MASS], aux[ENERGY] = inventory(ev, co, zeta_c3, par[_VE], par[_VC])


@jit
def rhs(s: Array, w: Array, par: Array, tab: Tables, guess: Array, z: Array, ds: Array, aux: Array) -> int:
    """Time derivative of the integration state.

    Parameters
    ----------
    s : (12,) array
        Integration state, see the module's docstring.
    w : (N_DRIVE,) array
        Inputs, faults and what follows from them, from `ac_plant_node.dynamics.drive`.
    par : array
        `ac_plant_node.parameters.values.Parameters.array`.
    tab : Tables
    guess : (2,) array
        Start values for p_e, p_c; overwritten with the solution (a warm start).
    z : (7, 8) array
        Work space of the descriptor system.
    ds : (12,) array
        Result.
    aux : (N_AUX,) array
        Public state x and flows, see the index constants.

    Returns
    -------
    int
        0, or 1 when no pressure inside the tables fits the mass and energy of a heat exchanger.
    """
    ev, suction, failed_e = evaporator_zones(s, par, tab, guess[0])
    co, failed_c = condenser_zones(s, w, suction, par, tab, guess[1])
    if failed_e == 0 and failed_c == 0:
        guess[0], guess[1] = ev.p, co.p
    balances(s, w, par, ev, suction, co, flows(ev, co, suction, s[8], w, par, tab), z, ds, aux)
    return max(failed_e, failed_c)


@jit
def evaporator_zones(s: Array, par: Array, tab: Tables, start: float) -> tuple[Evaporator, Suction, int]:
    """Zones of the evaporator, what the compressor draws, 0 or 1 as `solve_evaporator`: of s[0, 1, 2, 8]."""
    ev, failed = solve_evaporator(start, s[0] / par[_VE], s[1] / par[_VE], s[2], s[8], tab)
    return ev, suction_state(ev, s[2], tab), failed


@jit
def condenser_zones(
    s: Array, w: Array, suction: Suction, par: Array, tab: Tables, start: float
) -> tuple[Condenser, int]:
    """Zones of the condenser, 0 or 1 as `solve_condenser`: of s[2, 5, 6, 7, 8], `suction` and the drive `w`."""
    zeta_1 = min(max(s[7], 0.0), 0.98)
    return solve_condenser(start, s[5] / par[_VC], s[6] / par[_VC], zeta_1, s[8], suction.s, s[2], w[ETA_S], tab)


@jit
def balances(
    s: Array,
    w: Array,
    par: Array,
    ev: Evaporator,
    suction: Suction,
    co: Condenser,
    flow: Flows,
    z: Array,
    ds: Array,
    aux: Array,
) -> None:
    """Rates and auxiliary results of `rhs`, given the zones of `s` and the mass flows."""
    zeta_c3 = 1.0 - co.zeta_1 - co.zeta_2 if co.regime == 0 else 0.0
    heat = heat_flows(ev, co, flow, zeta_c3, suction.superheat, s, w, par)
    # Conserved quantities: exact whatever the zones do.
    ds[0], ds[1] = flow.m_v - flow.m_c, flow.m_v * s[8] - flow.m_c * s[2] + heat.q_e
    ds[5], ds[6] = flow.m_c - flow.m_out, flow.m_c * co.h_d - flow.m_out * s[8] + heat.q_c
    # Zones shorter than the floor fade into the law of the regime next to theirs, so that rates are continuous.
    wet, dry = ramp(ev.zeta / ZETA_FLOOR), ramp((1.0 - ev.zeta) / ZETA_FLOOR)
    own_e, own_c = wet * dry, ramp(zeta_c3 / ZETA_FLOOR)
    # A feed that wets the inlet makes a two-phase zone of any length grow.
    row_e = own_e if wet == 1.0 else (wet + (1.0 - wet) * heat.fed) * dry
    solve_descriptor(z, ev, co, suction, flow, heat, zeta_c3, row_e, own_c, (ds[0], ds[1], ds[5], ds[6]), s, par)
    ds[2], ds[7], ds[8] = z[2, 7], z[4, 7], z[6, 7]
    _wall_rates(z, ev, co, heat, zeta_c3, own_e, own_c, s, w, par, ds)
    _write_results(aux, ev, co, suction, flow, heat, zeta_c3, s, par)


@jit
def conserved(x: Array, par: Array, tab: Tables, s: Array) -> None:
    """Integration state `s` of a public state `x` with all five zones present (lengths between 0 and 1)."""
    # A density beyond any zone's leaves the zones' own properties as they are.
    ev = evaporator_at(x[1], 1.0e9, 0.0, x[2], x[8], tab)
    suction = suction_state(ev, x[2], tab)
    co = condenser_at(x[7], 1.0e9, 0.0, x[5], x[8], suction.s, x[2], par[_ETAS], tab)
    z_1, z_2, z_3 = x[5], x[6], 1.0 - x[5] - x[6]
    s[0] = par[_VE] * (x[0] * ev.rho_1 + (1.0 - x[0]) * ev.rho_2)
    s[1] = par[_VE] * (x[0] * ev.e_1 + (1.0 - x[0]) * ev.rho_2 * ev.h_2 - x[1])
    s[2], s[3], s[4] = x[2], x[0] * x[3] + (1.0 - x[0]) * x[4], x[3] - x[4]
    s[5] = par[_VC] * (z_1 * co.rho_1 + z_2 * co.rho_2 + z_3 * co.rho_3)
    s[6] = par[_VC] * (z_1 * co.e_1 + z_2 * co.e_2 + z_3 * co.e_3 - x[7])
    s[7], s[8] = x[5], x[8]
    s[9] = z_1 * x[9] + z_2 * x[10] + z_3 * x[11]
    s[10], s[11] = x[9] - x[10], x[11] - x[10]


def new_workspace() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Arrays `guess`, `z`, `ds`, `aux` for `rhs`."""
    return np.array([3.0e5, 1.2e6]), np.zeros((7, 8)), np.zeros(N_STATES), np.zeros(N_AUX)
