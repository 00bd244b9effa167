"""What flows in the plant at given zones: refrigerant through compressor and valve, heat between air, walls and it."""

import math
from typing import NamedTuple

from ac_plant_node.dynamics.drive import (
    AIR,
    G_C,
    G_E,
    HALF_E,
    LEAK,
    RATIO,
    SPEED,
    SPREAD_1,
    SPREAD_2,
    T_AIR_C,
    T_AIR_E,
    V_D,
    VALVE,
)
from ac_plant_node.dynamics.moist_air import CP_WATER_J_KGK, condensation
from ac_plant_node.dynamics.zones import Condenser, Evaporator
from ac_plant_node.parameters.values import INDEX
from ac_plant_node.properties.compiled import Array, jit
from ac_plant_node.properties.lookup import liquid, vapour, vapour_entropy
from ac_plant_node.properties.tables import Tables

_AE, _AC = INDEX["evaporator_inner_area_m2"], INDEX["condenser_inner_area_m2"]
_ETP, _ESH = INDEX["evaporator_two_phase_w_m2k"], INDEX["evaporator_superheated_w_m2k"]
_CSH, _CTP, _CSC = (
    INDEX["condenser_superheated_w_m2k"],
    INDEX["condenser_two_phase_w_m2k"],
    INDEX["condenser_subcooled_w_m2k"],
)
_EV0, _EV1, _EV2 = INDEX["eta_v_offset"], INDEX["eta_v_pressure_ratio"], INDEX["eta_v_speed"]
_AV0, _AV1, _AV2 = INDEX["valve_area_0_m2"], INDEX["valve_area_1_m2"], INDEX["valve_area_2_m2"]
_CD = INDEX["valve_discharge_coefficient"]

ZETA_FLOOR = 0.02
"""A vanishing zone answers as if it had at least this length."""
TAU_OUTLET_S = 0.05  # lag of an outlet enthalpy whose zone is absent
TAU_MIXED_S = 0.5  # lag with which a heat exchanger full of vapour becomes one well-mixed volume
CP_VAPOUR_J_KGK = 1.0e3  # turns a temperature into an enthalpy where only the order of size matters
OUTLET_BAND_K = 5.0  # over this span above the hottest surroundings the superheated zone's heat flow ends
_THIN_KG_M3 = 10.0  # but over a longer one in vapour as thin as this, which would run through 5 K in a millisecond
_WETTING_W = 100.0  # heat to evaporate the feed above which it wets the inlet in full: a few per cent of nominal
_DRY_LIQUID = 0.02  # liquid volume fraction below which the boiling coefficient fades to that of vapour
_DP_SMOOTH_PA = 2.0e3  # valve flow is linear in the pressure difference below this
_SPEED_FLOOR = 300.0 / 1000.0  # lowest speed (1000 rpm) that enters the volumetric efficiency
_P_LOW_PA, _P_LOW_SPAN_PA = 20.0e3, 30.0e3  # suction pressure at which the compressor no longer draws
_HIGH_CUT_START, _HIGH_CUT_END = 0.83, 0.91  # discharge pressure limiter, over the highest tabulated pressure
_CHOKE_RATIO = 0.55  # critical pressure ratio of vapour through the valve
# Of the order of the fastest boundary motion of ordinary operation: at 0.01 the upwinding switches sides at every
# change of command, a kink in T_w and SH of up to 100 % of their linear response that no linear design can see.
_UPWIND_RATE = 0.2  # 1/s: zone boundaries slower than this carry the mean of both wall temperatures
_UPWIND_SHARP, _UPWIND_ZONE = 0.01, 0.08  # but this sharp where a zone is about to vanish, shorter than the second
_PI2 = 2.0 * math.pi


@jit
def _smooth_root(dp: float) -> float:
    """``sqrt(dp)`` for positive `dp`, linear near zero, zero below."""
    if dp <= 0.0:
        return 0.0
    root: float = dp / (dp * dp + _DP_SMOOTH_PA * _DP_SMOOTH_PA) ** 0.25
    return root


@jit
def ramp(x: float) -> float:
    """Smooth step from 0 at 0 to 1 at 1."""
    x = min(max(x, 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)


@jit
def eta_volumetric(par: Array, ratio: float, speed_krpm: float) -> float:
    """Volumetric efficiency map ``a + b (PR - 4) + c (1 - 1000 rpm / N)``, kept between 0 and 1."""
    eta: float = par[_EV0] + par[_EV1] * (ratio - 4.0) + par[_EV2] * (1.0 - 1.0 / max(speed_krpm, _SPEED_FLOOR))
    return min(max(eta, 0.0), 1.0)


@jit
def valve_area(par: Array, opening: float) -> float:
    """Flow area over opening (0..1): a quadratic through the calibrated points, closing linearly below 10 %."""
    area: float = par[_AV0] + opening * (par[_AV1] + opening * par[_AV2])
    return max(area, 0.0) * min(opening * 10.0, 1.0)


class Suction(NamedTuple):
    """What the compressor draws: entropy with its slopes in p_e and h_e2, density, superheat."""

    s: float
    s_p: float
    s_h: float
    rho: float
    superheat: float


class Flows(NamedTuple):
    """Mass flows (kg/s), volumetric efficiency, subcooling at the condenser's outlet (K).

    `m_c` through the compressor, `m_v` through the valve, `m_out` out of the condenser: the valve's and what leaks.
    """

    m_c: float
    m_v: float
    m_out: float
    eta_v: float
    subcooling: float


class Heat(NamedTuple):
    """Heat flows (W) and wall temperatures (K).

    `q_e1` .. `q_c3`: wall to refrigerant, per unit of zone length; `q_e`, `q_c` their sums over the zones; `air_e`,
    `air_c` air to wall; `excess` how much hotter the evaporator's outlet is than the hottest thing around it; `feed_w`
    the heat that it takes to evaporate what the valve feeds, `fed` 1 but for a feed that ends or is hardly wet; `wet_c`
    1 but for a condenser about to run out of liquid; `latent_1`, `latent_2` latent heat of the evaporator's zones, per
    unit of zone length; `latent`, `water`, `frost`, `drained` latent heat, water (kg/s) and its enthalpy, of both.
    """

    tw_e1: float
    tw_e2: float
    tw_c1: float
    tw_c2: float
    tw_c3: float
    q_e1: float
    q_e2: float
    q_c1: float
    q_c2: float
    q_c3: float
    q_e: float
    q_c: float
    air_e: float
    air_c: float
    excess: float
    feed_w: float
    fed: float
    wet_c: float
    latent_1: float
    latent_2: float
    latent: float
    water: float
    frost: float
    drained: float


@jit
def suction_state(ev: Evaporator, h_1: float, tab: Tables) -> Suction:
    """State at the compressor's inlet, superheated or wet."""
    sat = ev.sat
    if h_1 >= sat.h_g:
        s, s_p, s_h = vapour_entropy(tab, ev.p, sat.ln_p, h_1, sat.h_g, sat.h_g_p)
        rho, _, _, t = vapour(tab, ev.p, sat.ln_p, h_1, sat.h_g, sat.h_g_p)
        return Suction(s, s_p, s_h, rho, t - sat.t)
    x = (h_1 - sat.h_f) / (sat.h_g - sat.h_f)
    rho = 1.0 / (1.0 / sat.rho_f + max(x, 0.3) * (1.0 / sat.rho_g - 1.0 / sat.rho_f))
    # ds = dh/T - v dp/T along the wet suction state, v close to that of the vapour.
    return Suction(sat.s_g - (sat.h_g - h_1) / sat.t, -1.0 / (sat.t * sat.rho_g), 1.0 / sat.t, rho, 0.0)


@jit
def flows(ev: Evaporator, co: Condenser, suction: Suction, h_3: float, w: Array, par: Array, tab: Tables) -> Flows:
    """Compressor and valve: eta_v V_d (N/60) rho_1 and C_d A sqrt(2 rho_3 dp), with their limits."""
    p_high = tab.grid[8]
    eta_v = eta_volumetric(par, co.p / ev.p, w[SPEED] * (0.06 / _PI2))
    limit = ramp((ev.p - _P_LOW_PA) / _P_LOW_SPAN_PA) * ramp(
        (_HIGH_CUT_END * p_high - co.p) / ((_HIGH_CUT_END - _HIGH_CUT_START) * p_high)
    )
    m_c = eta_v * w[V_D] * w[SPEED] / _PI2 * suction.rho * limit
    sat, choke, t_3 = co.sat, 0.0, co.sat.t
    if h_3 <= sat.h_f:
        rho_3, _, _, t_3 = liquid(tab, co.p, sat.ln_p, h_3, sat.h_f, sat.h_f_p)
    else:
        x = (h_3 - sat.h_f) / (sat.h_g - sat.h_f)
        if x < 1.0:
            rho_3 = 1.0 / (1.0 / sat.rho_f + x * (1.0 / sat.rho_g - 1.0 / sat.rho_f))
        else:
            rho_3, _, _, t_3 = vapour(tab, co.p, sat.ln_p, h_3, sat.h_g, sat.h_g_p)
        choke = _CHOKE_RATIO * min(x, 1.0)
    drop = _smooth_root(co.p - max(ev.p, choke * co.p))
    m_v = par[_CD] * valve_area(par, w[VALVE]) * math.sqrt(2.0 * rho_3) * drop
    return Flows(m_c, m_v, m_v + w[LEAK], eta_v, max(sat.t - t_3, 0.0))


@jit
def heat_flows(
    ev: Evaporator, co: Condenser, flow: Flows, zeta_c3: float, superheat: float, s: Array, w: Array, par: Array
) -> Heat:
    """Heat between air, walls and refrigerant; the air meets every zone side by side and leaves water on cold walls."""
    zeta_e2 = 1.0 - ev.zeta
    tw_e1, tw_e2 = s[3] + zeta_e2 * s[4], s[3] - ev.zeta * s[4]
    tw_c2 = s[9] - co.zeta_1 * s[10] - zeta_c3 * s[11]
    tw_c1, tw_c3 = tw_c2 + s[10], tw_c2 + s[11]
    wet_e = min((1.0 - ev.void) / _DRY_LIQUID, 1.0)
    wet_c = min((1.0 - co.void_rest) / _DRY_LIQUID, 1.0)
    q_e1 = par[_AE] * (par[_ESH] + (par[_ETP] - par[_ESH]) * wet_e) * (tw_e1 - ev.sat.t)
    q_e2 = par[_AE] * par[_ESH] * (tw_e2 - ev.t_2)
    feed_w = flow.m_v * max(ev.sat.h_g - s[8], 0.0)
    fed = ramp(feed_w / _WETTING_W)
    # Vapour that leaves as hot as the hottest thing around it takes up no more heat (a linear profile does not know).
    excess = ev.sat.t + superheat - max(w[T_AIR_E], tw_e1, tw_e2)
    taken = 1.0
    if ev.regime != 1 and q_e2 > 0.0:
        longer = ramp(ev.zeta / ZETA_FLOOR) * OUTLET_BAND_K * max(_THIN_KG_M3 / ev.rho_2 - 1.0, 0.0)
        taken -= (1.0 if ev.regime == 0 else fed) * ramp((excess + longer) / (OUTLET_BAND_K + longer))
        q_e2 *= taken
    q_c1 = par[_AC] * par[_CSH] * (tw_c1 - (co.t_2 if co.regime == 2 else co.t_1))
    q_c2 = par[_AC] * (par[_CSH] + (par[_CTP] - par[_CSH]) * wet_c) * (tw_c2 - co.t_2)
    q_c3 = par[_AC] * par[_CSC] * (tw_c3 - co.t_3)
    latent_1 = latent_2 = latent = water = frost = drained = 0.0
    if w[RATIO] > 0.0:
        spread_1, spread_2 = w[SPREAD_1] * (tw_e1 - ev.sat.t), w[SPREAD_2] * (tw_e2 - ev.t_2) * taken
        water_1, latent_1 = condensation(w[AIR], w[RATIO], w[HALF_E], w[T_AIR_E], tw_e1, spread_1)
        water_2, latent_2 = condensation(w[AIR], w[RATIO], w[HALF_E], w[T_AIR_E], tw_e2, spread_2)
        water_1, water_2 = ev.zeta * water_1, zeta_e2 * water_2
        water, latent = water_1 + water_2, ev.zeta * latent_1 + zeta_e2 * latent_2
        frost = (water_1 if tw_e1 < 273.15 else 0.0) + (water_2 if tw_e2 < 273.15 else 0.0)
        drained = CP_WATER_J_KGK * (water_1 * (tw_e1 - 273.15) + water_2 * (tw_e2 - 273.15))
    return Heat(
        tw_e1, tw_e2, tw_c1, tw_c2, tw_c3, q_e1, q_e2, q_c1, q_c2, q_c3,
        ev.zeta * q_e1 + zeta_e2 * q_e2, co.zeta_1 * q_c1 + co.zeta_2 * q_c2 + zeta_c3 * q_c3,
        w[G_E] * (w[T_AIR_E] - s[3]) + latent, w[G_C] * (w[T_AIR_C] - s[9]), excess, feed_w, fed, wet_c,
        latent_1, latent_2, latent, water, frost, drained,
    )  # fmt: skip


@jit
def dry_outlet(
    ev: Evaporator, heat: Heat, h_e2: float, volume: float, rho_rate: float, e_rate: float
) -> tuple[float, float]:
    """Law of the outlet's enthalpy while a wet feed meets vapour only: what stands before dp/dt, and the rate.

    The vapour is then the superheated zone next to a two-phase zone of length zero: its profile rises from saturation
    to ``h_e2 = 2 h - h_g`` around the mean `h`. By its own balance, with saturated vapour in place of the feed crossing
    the boundary, that zone's mean rises faster than that of the body by ``m_v (h_g - h_c3) / M``: less vapour than
    there is fits into the volume, and the rest is the two-phase zone.
    """
    rho, h = ev.rho_2, ev.h_2
    rate = (2.0 * h - ev.sat.h_g - h_e2) / TAU_MIXED_S + 2.0 * heat.feed_w / (rho * volume)
    rate -= CP_VAPOUR_J_KGK * max(heat.excess - OUTLET_BAND_K, 0.0) / TAU_OUTLET_S
    # d(2 h - h_g)/dt, with dh/dt = (d(rho h)/dt - h drho/dt)/rho and rho h = e + p
    return ev.sat.h_g_p - 2.0 / rho, rate + 2.0 * (e_rate - h * rho_rate) / rho


@jit
def upwind(rate: float, shorter: float) -> float:
    """Share of the far side's wall temperature that a zone boundary moving outwards at `rate` (1/s) picks up.

    `shorter` is the length of the shorter of the two zones: before one vanishes, the upwinding turns sharp.
    """
    width = _UPWIND_SHARP + (_UPWIND_RATE - _UPWIND_SHARP) * ramp(shorter / _UPWIND_ZONE)
    return 0.5 * (1.0 + rate / math.sqrt(rate * rate + width * width))
