"""The descriptor system of the moving boundaries: rates of pressures, zone lengths and outlet enthalpies.

Seven linear equations, derived in docs/plant.md: the closures of mass and energy of both heat exchangers,
differentiated in time, and a balance of each single-phase zone.
"""

from typing import NamedTuple

from ac_plant_node.dynamics.linear_algebra import solve
from ac_plant_node.dynamics.transfer import (
    CP_VAPOUR_J_KGK,
    OUTLET_BAND_K,
    TAU_MIXED_S,
    TAU_OUTLET_S,
    ZETA_FLOOR,
    Flows,
    Heat,
    Suction,
    dry_outlet,
    ramp,
)
from ac_plant_node.dynamics.zones import Condenser, Evaporator, outlet_targets
from ac_plant_node.parameters.values import INDEX
from ac_plant_node.properties.compiled import Array, jit

_VE, _VC = INDEX["evaporator_volume_m3"], INDEX["condenser_volume_m3"]

# Numerical regularisation, all of it in rows that carry neither mass nor energy.
_ZETA_RATE = 5.0  # 1/s: fastest relative change of the condenser's first zone
_ZETA_C1_MAX = 0.9  # longest first zone of the condenser
_SUPERHEAT_FLOOR = 2.0e3  # J/kg: least mean superheat that the condenser's first zone is divided by
_ZETA_LOOP = 0.12  # superheated zones shorter than this are asked for the gain of the loop through the condenser,
_LEAST_LOOP = 0.5  # and the determinant with that loop is kept above this share of the one without


class Side(NamedTuple):
    """What else the balances of one heat exchanger need.

    `volume`; `rho_rate`, `e_rate`: rates of mass and energy over volume; `target`: what the outlet's enthalpy tends to
    while the single-phase zone before it is absent; `own`: 1, but for such a zone about to vanish; `inward`: whether
    fluid flows into that zone.
    """

    volume: float
    rho_rate: float
    e_rate: float
    target: float
    own: float
    inward: bool


@jit
def _evaporator_rows(z: Array, ev: Evaporator, flow: Flows, heat: Heat, h_e2: float, side: Side) -> None:
    """Rows 0 (mass), 1 (energy), 2 (superheated zone) of the descriptor system."""
    if ev.regime != 0:
        z[0, 0] = ev.slope
        z[0, 7] = side.e_rate - ev.slope_rho * side.rho_rate
        z[1, 1] = 1.0
        z[2, 2] = 1.0
        z[2, 7] = (side.target - h_e2) / (TAU_OUTLET_S if ev.regime == 1 else TAU_MIXED_S)
        if ev.regime == 2 and heat.fed > 0.0:
            by_p, rate = dry_outlet(ev, heat, h_e2, side.volume, side.rho_rate, side.e_rate)
            z[2, 0], z[2, 7] = heat.fed * by_p, (1.0 - heat.fed) * z[2, 7] + heat.fed * rate
        return
    sat, zeta_1, zeta_2 = ev.sat, ev.zeta, 1.0 - ev.zeta
    z[0, 0] = zeta_1 * ev.rho_1_p + zeta_2 * ev.rho_2_p
    z[0, 1] = ev.rho_1 - ev.rho_2
    z[0, 2] = zeta_2 * ev.half * ev.rho_2_h
    z[0, 6] = zeta_1 * (sat.rho_g - sat.rho_f) * ev.void_h
    z[0, 7] = side.rho_rate
    z[1, 0] = zeta_1 * ev.e_1_p + zeta_2 * ev.e_2_p - 1.0
    z[1, 1] = ev.e_1 - ev.rho_2 * ev.h_2
    z[1, 2] = zeta_2 * ev.half * (ev.rho_2 + ev.h_2 * ev.rho_2_h)
    z[1, 6] = zeta_1 * (sat.rho_g * sat.h_g - sat.rho_f * sat.h_f) * ev.void_h
    z[1, 7] = side.e_rate
    over = ev.h_2 - sat.h_g if side.inward else 0.0
    z[2, 0] = zeta_2 * (ev.rho_2 * ev.h_2_p + over * ev.rho_2_p - 1.0)
    z[2, 1] = -over * ev.rho_2
    z[2, 2] = max(zeta_2, ZETA_FLOOR) * 0.5 * (ev.rho_2 + over * ev.rho_2_h)
    z[2, 7] = (flow.m_c * (ev.h_2 - over - h_e2) + zeta_2 * heat.q_e2) / side.volume
    # The linear profile must not carry the outlet below saturation, nor stay above every temperature around it. While
    # the two-phase zone is being born the outlet may be as hot as ends its heat flow: pulled down, it would smother it.
    spare = (1.0 - ramp(zeta_1 / ZETA_FLOOR)) * OUTLET_BAND_K
    z[2, 7] -= z[2, 2] * (min(h_e2 - sat.h_g, 0.0) + CP_VAPOUR_J_KGK * max(heat.excess - spare, 0.0)) / TAU_OUTLET_S
    if side.own < 1.0:
        pseudo = (ev.h_2 - h_e2) / TAU_MIXED_S if zeta_1 < 0.5 else (sat.h_g - h_e2) / TAU_OUTLET_S
        z[2, 0], z[2, 1] = side.own * z[2, 0], side.own * z[2, 1]
        z[2, 7] = side.own * z[2, 7] + (1.0 - side.own) * z[2, 2] * pseudo


@jit
def _condenser_rows(
    z: Array,
    co: Condenser,
    flow: Flows,
    heat: Heat,
    zeta_3: float,
    h_c3: float,
    c_pe: float,
    c_h2: float,
    side: Side,
) -> None:
    """Rows 3 (mass), 4 (energy), 6 (subcooled zone); `c_pe`, `c_h2` are slopes of h_2 in p_e and h_e2."""
    sat, zeta_1, zeta_2 = co.sat, co.zeta_1, co.zeta_2
    if co.regime != 0:
        if co.regime == 1:
            by_h1 = zeta_1 * (co.rho_1 + (co.h_1 - co.slope_rho) * co.rho_1_h) * co.half_1
            z[3, 0], z[3, 2] = by_h1 * c_pe, by_h1 * c_h2
            z[3, 4] = co.e_1 - co.e_rest - co.slope_rho * (co.rho_1 - co.rho_rest)
        z[3, 3] = co.slope
        z[3, 7] = side.e_rate - co.slope_rho * side.rho_rate
        z[4, 4], z[4, 5] = 1.0, 1.0
        z[6, 6] = 1.0
        z[6, 7] = (side.target - h_c3) / (TAU_OUTLET_S if co.regime == 1 else TAU_MIXED_S)
        return
    rho_h1 = zeta_1 * co.rho_1_h * co.half_1
    e_h1 = zeta_1 * (co.rho_1 + co.h_1 * co.rho_1_h) * co.half_1
    z[3, 0], z[3, 2] = rho_h1 * c_pe, rho_h1 * c_h2
    z[3, 3] = zeta_1 * co.rho_1_p + zeta_2 * co.rho_2_p + zeta_3 * co.rho_3_p
    z[3, 4], z[3, 5] = co.rho_1 - co.rho_3, co.rho_2 - co.rho_3
    z[3, 6] = zeta_3 * co.rho_3_h * co.half_3
    z[3, 7] = side.rho_rate
    z[4, 0], z[4, 2] = e_h1 * c_pe, e_h1 * c_h2
    z[4, 3] = zeta_1 * co.e_1_p + zeta_2 * co.e_2_p + zeta_3 * co.e_3_p - 1.0
    z[4, 4], z[4, 5] = co.e_1 - co.e_3, co.e_2 - co.e_3
    z[4, 6] = zeta_3 * (co.rho_3 + co.h_3 * co.rho_3_h) * co.half_3
    z[4, 7] = side.e_rate
    under = co.h_3 - sat.h_f if side.inward else 0.0
    z[6, 3] = zeta_3 * (co.rho_3 * co.h_3_p + under * co.rho_3_p - 1.0)
    z[6, 4], z[6, 5] = -under * co.rho_3, -under * co.rho_3
    z[6, 6] = max(zeta_3, ZETA_FLOOR) * 0.5 * (co.rho_3 + under * co.rho_3_h)
    z[6, 7] = (flow.m_out * (co.h_3 - under - h_c3) + zeta_3 * heat.q_c3) / side.volume
    if h_c3 > sat.h_f:
        z[6, 7] += z[6, 6] * (sat.h_f - h_c3) / TAU_OUTLET_S
    if side.own < 1.0:
        for j in range(3, 6):
            z[6, j] *= side.own
        z[6, 7] = side.own * z[6, 7] + (1.0 - side.own) * z[6, 6] * (sat.h_f - h_c3) / TAU_OUTLET_S


@jit
def _first_zone_row(
    z: Array,
    co: Condenser,
    flow: Flows,
    heat: Heat,
    c_pe: float,
    c_h2: float,
    limited: bool,
    bound: float,
    volume: float,
) -> None:
    """Row 5: the condenser's superheated zone, which gives the rate of zeta_c1."""
    if co.regime == 2:
        z[5, 4] = 1.0
        z[5, 7] = -co.zeta_1 / TAU_MIXED_S  # vapour throughout: one well-mixed volume
    elif limited:
        z[5, 4] = 1.0
        z[5, 7] = bound
    else:
        over = co.h_1 - co.sat.h_g
        by_h1 = co.zeta_1 * (co.rho_1 + over * co.rho_1_h) * co.half_1
        z[5, 0], z[5, 2] = by_h1 * c_pe, by_h1 * c_h2
        z[5, 3] = co.zeta_1 * (co.rho_1 * co.h_1_p + over * co.rho_1_p - 1.0)
        z[5, 4] = max(over, _SUPERHEAT_FLOOR) * co.rho_1
        # Nothing but discharge gas makes the zone longer: in heat that a warmer wall brings in proportion to its length
        # it would grow out of round-off while the compressor stands still.
        z[5, 7] = (flow.m_c * max(co.h_d - co.sat.h_g, 0.0) + co.zeta_1 * min(heat.q_c1, 0.0)) / volume


@jit
def _loop_share(
    z: Array,
    ev: Evaporator,
    co: Condenser,
    flow: Flows,
    heat: Heat,
    zeta_c3: float,
    c_h2: float,
    side_e: Side,
    side_c: Side,
    s: Array,
) -> float:
    """Share of ``dh_e2/dt`` that the condenser may see for the system to have one solution.

    The discharge gas follows `h_e2`, the condenser's outlet the discharge gas, the evaporator's void fraction that
    outlet, and a short superheated zone answers its boundary with `h_e2`: a loop without any storage. With the loop cut
    the determinant is that of the two heat exchangers; closed, and fluid flowing back out of the subcooled zone, it may
    be zero or of the other sign, so that rates grow beyond bounds and two solutions, or none, fit. The column of `h_e2`
    in the condenser's rows, put through the system without it, gives the ratio of the two, ``1 - gain``.
    """
    z[:, :] = 0.0
    _evaporator_rows(z, ev, flow, heat, s[2], side_e)
    _condenser_rows(z, co, flow, heat, zeta_c3, s[8], 0.0, c_h2, side_c)
    _first_zone_row(z, co, flow, heat, 0.0, c_h2, False, 0.0, side_c.volume)
    z[0, 7] = z[1, 7] = z[2, 7] = 0.0
    for i in range(3, 7):
        z[i, 7], z[i, 2] = z[i, 2], 0.0
    solve(z, 7)
    gain = -z[2, 7]
    if gain <= 1.0 - _LEAST_LOOP:
        return 1.0
    faded = ramp(2.0 * (1.0 - (1.0 - ev.zeta) / _ZETA_LOOP))
    share: float = 1.0 - faded * (1.0 - (1.0 - _LEAST_LOOP) / gain)
    return share


@jit
def solve_descriptor(
    z: Array,
    ev: Evaporator,
    co: Condenser,
    suction: Suction,
    flow: Flows,
    heat: Heat,
    zeta_c3: float,
    own_e: float,
    own_c: float,
    rates: tuple[float, float, float, float],
    s: Array,
    par: Array,
) -> None:
    """Solve the descriptor system for the rates of [p_e, zeta_e1, h_e2, p_c, zeta_c1, zeta_c2, h_c3] (column 7 of z).

    Rows 2, 5, 6 (no mass, no energy in them) take what crosses a zone boundary from upwind, and keep the first zone of
    the condenser from overrunning the others; both are decided by the solution, so it may take a second pass.
    """
    ve, vc = par[_VE], par[_VC]
    c_pe = co.h_d_s * suction.s_p
    c_h2 = co.h_d_s * suction.s_h + co.h_d_h
    target_e, target_c = outlet_targets(ev, co)
    inward_e, inward_c, limited, bound = True, True, False, 0.0
    if ev.regime == 0 and co.regime == 0 and 1.0 - ev.zeta < _ZETA_LOOP:
        side_e = Side(ve, 0.0, 0.0, target_e, own_e, True)
        c_h2 *= _loop_share(z, ev, co, flow, heat, zeta_c3, c_h2, side_e, Side(vc, 0.0, 0.0, target_c, own_c, False), s)
    for _ in range(3):
        z[:, :] = 0.0
        side_e = Side(ve, rates[0] / ve, rates[1] / ve, target_e, own_e, inward_e)
        side_c = Side(vc, rates[2] / vc, rates[3] / vc, target_c, own_c, inward_c)
        _evaporator_rows(z, ev, flow, heat, s[2], side_e)
        _condenser_rows(z, co, flow, heat, zeta_c3, s[8], c_pe, c_h2, side_c)
        _first_zone_row(z, co, flow, heat, c_pe, c_h2, limited, bound, vc)
        solve(z, 7)
        again = False
        if ev.regime == 0 and inward_e:
            growth = (1.0 - ev.zeta) * (ev.rho_2_p * z[0, 7] + ev.half * ev.rho_2_h * z[2, 7]) - ev.rho_2 * z[1, 7]
            if flow.m_c + ve * growth < 0.0:
                inward_e, again = False, True
        if co.regime == 0 and inward_c:
            growth = zeta_c3 * (co.rho_3_p * z[3, 7] + co.half_3 * co.rho_3_h * z[6, 7])
            if flow.m_out + vc * (growth - co.rho_3 * (z[4, 7] + z[5, 7])) < 0.0:
                inward_c, again = False, True
        if not limited and co.regime != 2:
            bound = heat.wet_c * z[4, 7] - (1.0 - heat.wet_c) * co.zeta_1 / TAU_MIXED_S
            bound = min(max(bound, -_ZETA_RATE * co.zeta_1), _ZETA_RATE * (co.zeta_2 - ZETA_FLOOR))
            bound = min(bound, _ZETA_RATE * (_ZETA_C1_MAX - co.zeta_1))
            if bound != z[4, 7]:
                limited, again = True, True
        if not again:
            break
