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
heat exchanger (`_evaporator_at`, `_condenser_at`): it is the balance of the zones that exist, and *which* zones exist
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

# ruff: noqa: RUF059 - the compiled functions hand over long tuples of which every caller needs another part.

import math

import numpy as np

from ac_plant_node.compiled import jit
from ac_plant_node.lookup import isentrope, liquid, saturation, vapour, vapour_entropy
from ac_plant_node.parameters import INDEX

N_STATES = 12
STATE_NAMES = (
    "zeta_e1", "p_e", "h_e2", "T_e1w", "T_e2w", "zeta_c1", "zeta_c2", "p_c", "h_c3", "T_c1w", "T_c2w", "T_c3w",
)  # fmt: skip
"""Names of the public state x."""

# Positions in the array of auxiliary results.
X = 0  # the public state, 12 numbers
M_COMPRESSOR, M_VALVE, Q_EVAPORATOR, Q_AIR_E, Q_AIR_C, POWER = 12, 13, 14, 15, 16, 17
H_DISCHARGE, SUPERHEAT, SUBCOOLING, REGIME_E, REGIME_C, ETA_V = 18, 19, 20, 21, 22, 23
VOID_E, VOID_C, HEAT_IN, WALL_E2 = 24, 25, 26, 27
N_AUX = 28

# Parameter positions, as compile-time constants.
_VE, _AE, _CE = INDEX["evaporator_volume_m3"], INDEX["evaporator_inner_area_m2"], INDEX["evaporator_wall_j_k"]
_VC, _AC, _CC = INDEX["condenser_volume_m3"], INDEX["condenser_inner_area_m2"], INDEX["condenser_wall_j_k"]
_ETP, _ESH = INDEX["evaporator_two_phase_w_m2k"], INDEX["evaporator_superheated_w_m2k"]
_CSH, _CTP, _CSC = (
    INDEX["condenser_superheated_w_m2k"],
    INDEX["condenser_two_phase_w_m2k"],
    INDEX["condenser_subcooled_w_m2k"],
)
_EUA, _EMA, _EXP = INDEX["evaporator_air_ua_w_k"], INDEX["evaporator_air_nominal_kg_s"], INDEX["air_ua_exponent"]
_CUA, _CMA, _CTA = INDEX["condenser_air_ua_w_k"], INDEX["condenser_air_kg_s"], INDEX["condenser_air_inlet_k"]
_CP = INDEX["air_cp_j_kgk"]
_VD, _ETAS = INDEX["displacement_m3_rev"], INDEX["isentropic_efficiency"]
_EV0, _EV1, _EV2 = INDEX["eta_v_offset"], INDEX["eta_v_pressure_ratio"], INDEX["eta_v_speed"]
_AV0, _AV1, _AV2 = INDEX["valve_area_0_m2"], INDEX["valve_area_1_m2"], INDEX["valve_area_2_m2"]
_CD = INDEX["valve_discharge_coefficient"]

# Numerical regularisation, all of it in rows that carry neither mass nor energy.
_ZETA_FLOOR = 0.02  # a vanishing zone answers as if it had at least this length
_OUTLET_BAND_K = 2.0  # over this span above the hottest surroundings the superheated zone's heat flow ends
_CP_VAPOUR = 1.0e3  # J/(kg K): turns a temperature into an enthalpy where only the order of size matters
_ZETA_RATE = 5.0  # 1/s: fastest relative change of the condenser's first zone
_ZETA_C1_MAX = 0.9  # longest first zone of the condenser
_TAU_OUTLET_S = 0.05  # lag of an outlet enthalpy whose zone is absent
_TAU_MIXED_S = 0.5  # lag with which a heat exchanger full of vapour becomes one well-mixed volume
_TAU_WALL_S = 5.0  # lag with which the wall of an absent zone joins its neighbour's temperature
# Of the order of the fastest boundary motion of ordinary operation: at 0.01 the upwinding switches sides at every
# change of command, a kink in T_w and SH of up to 100 % of their linear response that no linear design can see.
_UPWIND_RATE = 0.2  # 1/s: zone boundaries slower than this carry the mean of both wall temperatures
_UPWIND_SHARP, _UPWIND_ZONE = 0.01, 0.08  # but this sharp where a zone is about to vanish, shorter than the second
_SUPERHEAT_FLOOR = 2.0e3  # J/kg: least mean superheat that the condenser's first zone is divided by
_X_INLET_MAX = 0.95  # the mean void fraction is taken from at most this inlet quality
_X_OUTLET_MIN = 0.7  # the suction header holds back liquid: quality drawn by the compressor
_DRY_LIQUID = 0.02  # liquid volume fraction below which the boiling coefficient fades to that of vapour
_DP_SMOOTH_PA = 2.0e3  # valve flow is linear in the pressure difference below this
_SPEED_FLOOR = 300.0 / 1000.0  # lowest speed (1000 rpm) that enters the volumetric efficiency
_P_LOW_PA, _P_LOW_SPAN_PA = 20.0e3, 30.0e3  # suction pressure at which the compressor no longer draws
_HIGH_CUT_START, _HIGH_CUT_END = 0.83, 0.91  # discharge pressure limiter, over the highest tabulated pressure
_CHOKE_RATIO = 0.55  # critical pressure ratio of vapour through the valve

_PI2 = 2.0 * math.pi


@jit
def mean_void(slip, x1):  # type: ignore[no-untyped-def]
    """Mean of Zivi's void fraction between qualities `x1` and 1, with d/d(slip) and d/d(x1).

    ``gamma(x) = x / (x + (1 - x) S)``, ``S = (rho_g/rho_f)^(2/3)``; quality linear along the zone (uniform heat flux).
    """
    a = 1.0 - slip
    b = slip + a * x1
    log_b = math.log(b)
    dry = 1.0 - x1
    mean = 1.0 / a + slip * log_b / (a * a * dry)
    d_slip = 1.0 / (a * a) + (log_b + slip * dry / b) / (a * a * dry) + 2.0 * slip * log_b / (a * a * a * dry)
    return mean, d_slip, (mean - x1 / b) / dry


@jit
def _mixture(rbar, ra, rb, ha, hb, ra_p, rb_p, ha_p, hb_p):  # type: ignore[no-untyped-def]
    """Fill a volume with two materials of densities ra, rb and volumetric enthalpies ha, hb at mean density `rbar`.

    Returns the share of the first, the volumetric enthalpy, its slope in p at fixed `rbar`, its slope in `rbar`.
    """
    gap = ra - rb
    share = (rbar - rb) / gap
    slope = (ha - hb) / gap
    share_p = (-rb_p - share * (ra_p - rb_p)) / gap
    return share, hb + share * (ha - hb), share * ha_p + (1.0 - share) * hb_p + (ha - hb) * share_p, slope


@jit
def _evaporator_at(p, rbar, e, h2, h4, tab):  # type: ignore[no-untyped-def]
    """Zones of the evaporator at a trial pressure.

    `rbar`, `e` are mass and internal energy over volume. Returns the residual of the energy balance, its slopes in p
    (at fixed mass and energy) and in `rbar`, the regime, and everything the balances need.
    """
    t, hf, hg, rf, rg, sf, sg, t_p, hf_p, hg_p, rf_p, rg_p, sf_p, sg_p, lnp = saturation(tab, p)
    hfg = hg - hf
    x4 = (h4 - hf) / hfg
    x4_p = -(hf_p + x4 * (hg_p - hf_p)) / hfg
    x4_h = 1.0 / hfg
    if x4 < 0.0:
        x4, x4_p, x4_h = 0.0, 0.0, 0.0
    elif x4 > _X_INLET_MAX:
        x4, x4_p, x4_h = _X_INLET_MAX, 0.0, 0.0
    slip = (rg / rf) ** (2.0 / 3.0)
    slip_p = slip * (2.0 / 3.0) * (rg_p / rg - rf_p / rf)
    void, void_s, void_x = mean_void(slip, x4)
    void_p = void_s * slip_p + void_x * x4_p
    void_h = void_x * x4_h
    vf, vg = rf * hf, rg * hg
    vf_p, vg_p = rf_p * hf + rf * hf_p, rg_p * hg + rg * hg_p
    r1 = rf + void * (rg - rf)
    e1 = vf + void * (vg - vf)
    r1_p = rf_p + void * (rg_p - rf_p) + void_p * (rg - rf)
    e1_p = vf_p + void * (vg_p - vf_p) + void_p * (vg - vf)
    half = 0.5 if h2 > hg else 0.0
    hm = hg + half * (h2 - hg)
    hm_p = (1.0 - half) * hg_p
    r2, r2_pp, r2_h, t2 = vapour(tab, p, lnp, hm, hg, hg_p)
    r2_p = r2_pp + r2_h * hm_p
    e2 = r2 * hm
    e2_p = r2_p * hm + r2 * hm_p
    regime = 0
    if rbar > r1:
        regime = 1
        share, h, h_p, slope = _mixture(rbar, rf, rg, vf, vg, rf_p, rg_p, vf_p, vg_p)
        zeta = 1.0
        void = 1.0 - share
        residual = h - p - e
    elif rbar >= r2:
        zeta, h, h_p, slope = _mixture(rbar, r1, r2, e1, e2, r1_p, r2_p, e1_p, e2_p)
        residual = h - p - e
    else:
        regime = 2
        zeta = 0.0
        void = 1.0
        hm = (e + p) / rbar
        dry = max(hm, hg)  # below saturated vapour the table ends: its edge keeps the residual's sign right
        r2, r2_pp, r2_h, t2 = vapour(tab, p, lnp, dry, hg, hg_p)
        residual = rbar * (dry - hm + (rbar - r2) / r2_h)
        h_p = -rbar * r2_pp / r2_h
        slope = hm + rbar / r2_h
    return (
        residual, h_p - 1.0, slope, regime, zeta, void, void_h, x4,
        t, hf, hg, rf, rg, sf, sg, hf_p, hg_p, lnp,
        r1, e1, r1_p, e1_p, r2, r2_pp, r2_h, hm, hm_p, half, t2, r2_p, e2_p,
    )  # fmt: skip


@jit
def _condenser_at(p, rbar, e, zeta1, h3, s1, he, eta, tab):  # type: ignore[no-untyped-def]
    """Zones of the condenser at a trial pressure, as `_evaporator_at`.

    The first zone has the given length `zeta1` and the mean enthalpy ``(h_2 + h_g)/2`` of the discharge gas; the rest
    of the volume is two-phase and subcooled (regime 0), two-phase (1) or vapour (2).
    """
    t, hf, hg, rf, rg, sf, sg, t_p, hf_p, hg_p, rf_p, rg_p, sf_p, sg_p, lnp = saturation(tab, p)
    # Discharge enthalpy and its slopes in p_c, s_1, h_1.
    hs, hs_p, hs_s = isentrope(tab, p, lnp, s1, hg, hg_p, sg, sg_p, t)
    hd, hd_p, hd_s, hd_h = he, 0.0, 0.0, 1.0
    if hs > he:
        hd, hd_p, hd_s, hd_h = he + (hs - he) / eta, hs_p / eta, hs_s / eta, 1.0 - 1.0 / eta
    half = 0.5 if hd > hg else 0.0
    hm1 = hg + half * (hd - hg)
    hm1_p = (1.0 - half) * hg_p + half * hd_p
    r1, r1_pp, r1_h, t1 = vapour(tab, p, lnp, hm1, hg, hg_p)
    r1_p = r1_pp + r1_h * hm1_p
    e1, e1_p = r1 * hm1, r1_p * hm1 + r1 * hm1_p
    # What the first zone leaves to the rest.
    rest = 1.0 - zeta1
    rr = (rbar - zeta1 * r1) / rest
    er = (e + p - zeta1 * e1) / rest
    rr_p = -zeta1 * r1_p / rest
    slip = (rg / rf) ** (2.0 / 3.0)
    slip_p = slip * (2.0 / 3.0) * (rg_p / rg - rf_p / rf)
    void, void_s, _ = mean_void(slip, 0.0)
    void_p = void_s * slip_p
    vf, vg = rf * hf, rg * hg
    vf_p, vg_p = rf_p * hf + rf * hf_p, rg_p * hg + rg * hg_p
    r2 = rf + void * (rg - rf)
    e2 = vf + void * (vg - vf)
    r2_p = rf_p + void * (rg_p - rf_p) + void_p * (rg - rf)
    e2_p = vf_p + void * (vg_p - vf_p) + void_p * (vg - vf)
    half3 = 0.5 if h3 < hf else 0.0
    hm3 = hf + half3 * (h3 - hf)
    hm3_p = (1.0 - half3) * hf_p
    r3, r3_pp, r3_h, t3 = liquid(tab, p, lnp, hm3, hf, hf_p)
    r3_p = r3_pp + r3_h * hm3_p
    e3, e3_p = r3 * hm3, r3_p * hm3 + r3 * hm3_p
    regime = 0
    void_rest = void
    h_rest, t2 = 0.0, t
    if rr >= r2:
        share, h, h_p, slope = _mixture(rr, r2, r3, e2, e3, r2_p, r3_p, e2_p, e3_p)
        zeta2 = rest * share
        residual = rest * (h - er)
    elif rr >= rg:
        regime = 1
        share, h, h_p, slope = _mixture(rr, rg, rf, vg, vf, rg_p, rf_p, vg_p, vf_p)
        zeta2 = rest
        void_rest = share
        residual = rest * (h - er)
    else:
        regime = 2
        zeta2 = rest
        void_rest = 1.0
        h_rest = (e + p) / rbar
        dry = max(h_rest, hg)
        r2, r2_pp, r2_h, t2 = vapour(tab, p, lnp, dry, hg, hg_p)
        residual = rbar * (dry - h_rest + (rbar - r2) / r2_h)
        slope = h_rest + rbar / r2_h
        h_p, total_p = 0.0, -rbar * r2_pp / r2_h - 1.0
        h = er
    if regime < 2:
        # Total slope: the rest's density moves with p as the first zone's does.
        total_p = rest * (h_p + slope * rr_p) + zeta1 * e1_p - 1.0
    return (
        residual, total_p, slope, regime, zeta2, void_rest, h_rest,
        t, hf, hg, rf, rg, hf_p, hg_p, lnp, hd, hd_p, hd_s, hd_h, half, hm1, hm1_p, r1, r1_pp, r1_h, t1, r1_p, e1, e1_p,
        r2, e2, r2_p, e2_p, half3, hm3, hm3_p, r3, r3_pp, r3_h, t3, r3_p, e3, e3_p, h_p, h, rr, t2, void,
    )  # fmt: skip


@jit
def _next_pressure(p, residual, slope, low, high):  # type: ignore[no-untyped-def]
    """Newton's next pressure, or the middle of the bracket when the step leaves it."""
    trial = p - residual / slope if slope > 0.0 else -1.0
    if low < trial < high:
        return trial
    return 0.5 * (low + high)


@jit
def _smooth_root(dp):  # type: ignore[no-untyped-def]
    """``sqrt(dp)`` for positive `dp`, linear near zero, zero below."""
    if dp <= 0.0:
        return 0.0
    return dp / (dp * dp + _DP_SMOOTH_PA * _DP_SMOOTH_PA) ** 0.25


@jit
def _ramp(x):  # type: ignore[no-untyped-def]
    """Smooth step from 0 at 0 to 1 at 1."""
    x = min(max(x, 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)


@jit
def _upwind(rate, shorter):  # type: ignore[no-untyped-def]
    """Share of the far side's wall temperature that a zone boundary moving outwards at `rate` (1/s) picks up.

    `shorter` is the length of the shorter of the two zones: before one vanishes, the upwinding turns sharp.
    """
    width = _UPWIND_SHARP + (_UPWIND_RATE - _UPWIND_SHARP) * _ramp(shorter / _UPWIND_ZONE)
    return 0.5 * (1.0 + rate / math.sqrt(rate * rate + width * width))


@jit
def _solve(a, n):  # type: ignore[no-untyped-def]
    """Solve the n x n system in the n x (n+1) array `a` in place (Gauss, partial pivoting); result in column n."""
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(k, n + 1):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
        inv = 1.0 / a[k, k]
        for i in range(k + 1, n):
            f = a[i, k] * inv
            if f != 0.0:
                for j in range(k + 1, n + 1):
                    a[i, j] -= f * a[k, j]
    for k in range(n - 1, -1, -1):
        b = a[k, n]
        for j in range(k + 1, n):
            b -= a[k, j] * a[j, n]
        a[k, n] = b / a[k, k]


@jit
def eta_volumetric(par, ratio, speed_krpm):  # type: ignore[no-untyped-def]
    """Volumetric efficiency map ``a + b (PR - 4) + c (1 - 1000 rpm / N)``, kept between 0 and 1."""
    eta = par[_EV0] + par[_EV1] * (ratio - 4.0) + par[_EV2] * (1.0 - 1.0 / max(speed_krpm, _SPEED_FLOOR))
    return min(max(eta, 0.0), 1.0)


@jit
def valve_area(par, opening):  # type: ignore[no-untyped-def]
    """Flow area over opening (0..1): a quadratic through the calibrated points, closing linearly below 10 %."""
    area = par[_AV0] + opening * (par[_AV1] + opening * par[_AV2])
    return max(area, 0.0) * min(opening * 10.0, 1.0)


@jit
def rhs(s, w, par, tab, guess, z, ds, aux):  # type: ignore[no-untyped-def]
    """Time derivative of the integration state.

    Parameters
    ----------
    s : (12,) array
        Integration state, see the module's docstring.
    w : (4,) array
        Inputs: compressor speed rad/s, valve opening 0..1, evaporator air kg/s, its inlet temperature degC.
    par : array
        `ac_plant_node.parameters.Parameters.array`.
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
    p_low, p_high = tab.grid[7], tab.grid[8]
    # --- evaporator: pressure from mass and energy -----------------------------------------------------------------
    guess_e, guess_c = guess[0], guess[1]
    ve, h2, h4 = par[_VE], s[2], s[8]
    rbar_e, e_e = s[0] / ve, s[1] / ve
    p, low, high = min(max(guess[0], p_low), p_high), p_low, p_high
    status = 1
    for _ in range(60):
        (
            residual, slope_pe, slope_re, regime_e, zeta_e, void_e, void_h, x4,
            te, hf_e, hg_e, rf_e, rg_e, sf_e, sg_e, hf_pe, hg_pe, lnp_e,
            r1_e, e1_e, r1_pe, e1_pe, r2_e, r2_ppe, r2_he, hm_e, hm_pe, half_e, t2_e, r2_pe, e2_pe,
        ) = _evaporator_at(p, rbar_e, e_e, h2, h4, tab)  # fmt: skip
        if abs(residual) <= 1.0e-13 * abs(slope_pe) * p:
            status = 0
            break
        if residual > 0.0:
            high = p
        else:
            low = p
        p = _next_pressure(p, residual, slope_pe, low, high)
        if high - low <= 4.0e-16 * p:
            status = 0 if p_low * 1.0001 < p < p_high * 0.9999 else 1
            break
    pe = p
    guess[0] = pe
    # --- compressor suction ----------------------------------------------------------------------------------------
    if h2 >= hg_e:
        s1, s1_p, s1_h = vapour_entropy(tab, pe, lnp_e, h2, hg_e, hg_pe)
        rho_1, _, _, t_out = vapour(tab, pe, lnp_e, h2, hg_e, hg_pe)
        superheat = t_out - te
    else:
        x1 = (h2 - hf_e) / (hg_e - hf_e)
        s1 = sg_e - (hg_e - h2) / te
        s1_h = 1.0 / te
        s1_p = -1.0 / (te * rg_e)  # ds = dh/T - v dp/T along the wet suction state, v close to that of the vapour
        rho_1 = 1.0 / (1.0 / rf_e + max(x1, 0.3) * (1.0 / rg_e - 1.0 / rf_e))
        superheat = 0.0
    # --- condenser: pressure from mass and energy ------------------------------------------------------------------
    vc, h3 = par[_VC], s[8]
    zc1 = min(max(s[7], 0.0), 0.98)
    rbar_c, e_c = s[5] / vc, s[6] / vc
    eta_s = par[_ETAS]
    p, low, high = min(max(guess[1], p_low), p_high), p_low, p_high
    status_c = 1
    for _ in range(60):
        (
            residual, slope_pc, slope_rc, regime_c, zeta_c2, void_c, h_rest,
            tc, hf_c, hg_c, rf_c, rg_c, hf_pc, hg_pc, lnp_c, hd, hd_p, hd_s, hd_h, half_1, hm1, hm1_p,
            r1_c, r1_ppc, r1_hc, t1_c, r1_pc, e1_c, e1_pc,
            r2_c, e2_c, r2_pc, e2_pc, half_3, hm3, hm3_p, r3_c, r3_ppc, r3_hc, t3_c, r3_pc, e3_c, e3_pc,
            h_p_rest, e_rest, r_rest, t2_c, void_full,
        ) = _condenser_at(p, rbar_c, e_c, zc1, h3, s1, h2, eta_s, tab)  # fmt: skip
        if abs(residual) <= 1.0e-13 * abs(slope_pc) * p:
            status_c = 0
            break
        if residual > 0.0:
            high = p
        else:
            low = p
        p = _next_pressure(p, residual, slope_pc, low, high)
        if high - low <= 4.0e-16 * p:
            status_c = 0 if p_low * 1.0001 < p < p_high * 0.9999 else 1
            break
    pc = p
    guess[1] = pc
    status = max(status, status_c)
    if status != 0:
        guess[0], guess[1] = guess_e, guess_c
    zeta_c3 = 1.0 - zc1 - zeta_c2 if regime_c == 0 else 0.0
    zeta_e2 = 1.0 - zeta_e
    # --- flows -----------------------------------------------------------------------------------------------------
    speed = w[0]
    eta_v = eta_volumetric(par, pc / pe, speed * (0.06 / _PI2))
    limit = _ramp((pe - _P_LOW_PA) / _P_LOW_SPAN_PA) * _ramp(
        (_HIGH_CUT_END * p_high - pc) / ((_HIGH_CUT_END - _HIGH_CUT_START) * p_high)
    )
    m_c = eta_v * par[_VD] * speed / _PI2 * rho_1 * limit
    choke = 0.0
    if h3 <= hf_c:
        rho_3, _, _, t3_out = liquid(tab, pc, lnp_c, h3, hf_c, hf_pc)
    else:
        x3 = (h3 - hf_c) / (hg_c - hf_c)
        t3_out = tc
        if x3 < 1.0:
            rho_3 = 1.0 / (1.0 / rf_c + x3 * (1.0 / rg_c - 1.0 / rf_c))
        else:
            rho_3, _, _, t3_out = vapour(tab, pc, lnp_c, h3, hg_c, hg_pc)
        choke = _CHOKE_RATIO * min(x3, 1.0)
    m_v = par[_CD] * valve_area(par, w[1]) * math.sqrt(2.0 * rho_3) * _smooth_root(pc - max(pe, choke * pc))
    # --- walls and heat --------------------------------------------------------------------------------------------
    tw_e, d_e = s[3], s[4]
    tw_e1, tw_e2 = tw_e + zeta_e2 * d_e, tw_e - zeta_e * d_e
    tw_c2 = s[9] - zc1 * s[10] - zeta_c3 * s[11]
    tw_c1, tw_c3 = tw_c2 + s[10], tw_c2 + s[11]
    wetness = min((1.0 - void_e) / _DRY_LIQUID, 1.0)
    k_e1 = par[_AE] * (par[_ESH] + (par[_ETP] - par[_ESH]) * wetness)
    k_e2 = par[_AE] * par[_ESH]
    q_e1 = k_e1 * (tw_e1 - te)  # per unit of zone length
    q_e2 = k_e2 * (tw_e2 - t2_e)
    t_air = w[3] + 273.15
    # Vapour that leaves as hot as the hottest thing around it takes up no more heat (a linear profile does not know).
    excess = te + superheat - max(t_air, tw_e1, tw_e2)
    if regime_e == 0 and q_e2 > 0.0:
        q_e2 *= 1.0 - _ramp(excess / _OUTLET_BAND_K)
    wetness_c = min((1.0 - void_c) / _DRY_LIQUID, 1.0)
    q_c1 = par[_AC] * par[_CSH] * (tw_c1 - t1_c)
    q_c2 = par[_AC] * (par[_CSH] + (par[_CTP] - par[_CSH]) * wetness_c) * (tw_c2 - t2_c)
    q_c3 = par[_AC] * par[_CSC] * (tw_c3 - t3_c)
    q_e = zeta_e * q_e1 + zeta_e2 * q_e2
    q_c = zc1 * q_c1 + zeta_c2 * q_c2 + zeta_c3 * q_c3
    if regime_c == 2:
        q_c1 = par[_AC] * par[_CSH] * (tw_c1 - t2_c)
        q_c = zc1 * q_c1 + zeta_c2 * q_c2
    air = max(w[2], 1.0e-6)
    g_e = air * par[_CP]
    g_e *= 1.0 - math.exp(-par[_EUA] * (air / par[_EMA]) ** par[_EXP] / g_e)
    g_c = par[_CMA] * par[_CP]
    g_c *= 1.0 - math.exp(-par[_CUA] / g_c)
    q_air_e = g_e * (t_air - tw_e)
    q_air_c = g_c * (par[_CTA] - s[9])
    # --- conserved quantities: exact whatever the zones do ---------------------------------------------------------
    dm_e, du_e = m_v - m_c, m_v * h3 - m_c * h2 + q_e
    dm_c, du_c = m_c - m_v, m_c * hd - m_v * h3 + q_c
    # --- descriptor system for [p_e, zeta_e1, h_e2, p_c, zeta_c1, zeta_c2, h_c3] -----------------------------------
    target_e, target_c = hm_e, h_rest
    # The linear profile must not carry the outlet below saturation, nor stay above every temperature around it.
    beyond_e = min(h2 - hg_e, 0.0) + _CP_VAPOUR * max(excess, 0.0)
    if regime_e == 1:
        # Liquid beyond what complete evaporation holds leaves with the vapour: slope of Zivi's profile at x = 1.
        full, _, _ = mean_void((rg_e / rf_e) ** (2.0 / 3.0), x4)
        wet = min((1.0 - x4) * (full - void_e) / (1.0 - full), 1.0 - _X_OUTLET_MIN)
        target_e = hg_e - wet * (hg_e - hf_e)
    if regime_c == 1:
        # Vapour beyond what complete condensation holds leaves with the liquid: slope of Zivi's profile at x = 0.
        y = (void_c - void_full) / (1.0 - void_full)
        x_out = y * ((1.0 - void_full) / void_full * (1.0 - y) + y)
        target_c = hf_c + x_out * (hg_c - hf_c)
    # Rows 2, 5, 6 (no mass, no energy in them) take what crosses a zone boundary from upwind, and keep the first zone
    # of the condenser from overrunning the others; both are decided by the solution, so it may take a second pass.
    over, over_1, under = hm_e - hg_e, hm1 - hg_c, hm3 - hf_c
    c_pe = hd_s * s1_p
    c_h2 = hd_s * s1_h + hd_h
    # Zones shorter than the floor fade into the law of the regime next to theirs, so that rates are continuous.
    own_e = _ramp(zeta_e / _ZETA_FLOOR) * _ramp(zeta_e2 / _ZETA_FLOOR)
    own_c = _ramp(zeta_c3 / _ZETA_FLOOR)
    pseudo_e = (hm_e - h2) / _TAU_MIXED_S if zeta_e < 0.5 else (hg_e - h2) / _TAU_OUTLET_S
    inward_e, inward_c, limited = True, True, False
    bound = 0.0
    for _ in range(3):
        for i in range(7):
            for j in range(8):
                z[i, j] = 0.0
        if regime_e == 0:
            z[0, 0] = zeta_e * r1_pe + zeta_e2 * r2_pe
            z[0, 1] = r1_e - r2_e
            z[0, 2] = zeta_e2 * half_e * r2_he
            z[0, 6] = zeta_e * (rg_e - rf_e) * void_h
            z[0, 7] = dm_e / ve
            z[1, 0] = zeta_e * e1_pe + zeta_e2 * e2_pe - 1.0
            z[1, 1] = e1_e - r2_e * hm_e
            z[1, 2] = zeta_e2 * half_e * (r2_e + hm_e * r2_he)
            z[1, 6] = zeta_e * (rg_e * hg_e - rf_e * hf_e) * void_h
            z[1, 7] = du_e / ve
            share = over if inward_e else 0.0
            z[2, 0] = zeta_e2 * (r2_e * hm_pe + share * r2_pe - 1.0)
            z[2, 1] = -share * r2_e
            z[2, 2] = max(zeta_e2, _ZETA_FLOOR) * 0.5 * (r2_e + share * r2_he)
            z[2, 7] = (m_c * (hm_e - share - h2) + zeta_e2 * q_e2) / ve
            z[2, 7] -= z[2, 2] * beyond_e / _TAU_OUTLET_S
            if own_e < 1.0:
                z[2, 0], z[2, 1] = own_e * z[2, 0], own_e * z[2, 1]
                z[2, 7] = own_e * z[2, 7] + (1.0 - own_e) * z[2, 2] * pseudo_e
        else:
            z[0, 0] = slope_pe
            z[0, 7] = (du_e - slope_re * dm_e) / ve
            z[1, 1] = 1.0
            z[2, 2] = 1.0
            z[2, 7] = (target_e - h2) / (_TAU_OUTLET_S if regime_e == 1 else _TAU_MIXED_S)
        if regime_c == 0:
            r_m = zc1 * r1_hc * half_1
            e_m = zc1 * (r1_c + hm1 * r1_hc) * half_1
            z[3, 0] = r_m * c_pe
            z[3, 2] = r_m * c_h2
            z[3, 3] = zc1 * r1_pc + zeta_c2 * r2_pc + zeta_c3 * r3_pc
            z[3, 4] = r1_c - r3_c
            z[3, 5] = r2_c - r3_c
            z[3, 6] = zeta_c3 * r3_hc * half_3
            z[3, 7] = dm_c / vc
            z[4, 0] = e_m * c_pe
            z[4, 2] = e_m * c_h2
            z[4, 3] = zc1 * e1_pc + zeta_c2 * e2_pc + zeta_c3 * e3_pc - 1.0
            z[4, 4] = e1_c - e3_c
            z[4, 5] = e2_c - e3_c
            z[4, 6] = zeta_c3 * (r3_c + hm3 * r3_hc) * half_3
            z[4, 7] = du_c / vc
            share = under if inward_c else 0.0
            z[6, 3] = zeta_c3 * (r3_c * hm3_p + share * r3_pc - 1.0)
            z[6, 4] = -share * r3_c
            z[6, 5] = -share * r3_c
            z[6, 6] = max(zeta_c3, _ZETA_FLOOR) * 0.5 * (r3_c + share * r3_hc)
            z[6, 7] = (m_v * (hm3 - share - h3) + zeta_c3 * q_c3) / vc
            if h3 > hf_c:
                z[6, 7] += z[6, 6] * (hf_c - h3) / _TAU_OUTLET_S
            if own_c < 1.0:
                for j in range(3, 6):
                    z[6, j] *= own_c
                z[6, 7] = own_c * z[6, 7] + (1.0 - own_c) * z[6, 6] * (hf_c - h3) / _TAU_OUTLET_S
        else:
            e_m = zc1 * (r1_c + (hm1 - slope_rc) * r1_hc) * half_1
            z[3, 0] = e_m * c_pe
            z[3, 2] = e_m * c_h2
            z[3, 3] = slope_pc
            z[3, 4] = e1_c - e_rest - slope_rc * (r1_c - r_rest)
            z[3, 7] = (du_c - slope_rc * dm_c) / vc
            z[4, 4] = 1.0
            z[4, 5] = 1.0
            z[6, 6] = 1.0
            z[6, 7] = (target_c - h3) / (_TAU_OUTLET_S if regime_c == 1 else _TAU_MIXED_S)
        if regime_c == 2:
            z[3, 0], z[3, 2], z[3, 4] = 0.0, 0.0, 0.0  # the whole volume is one, whatever zeta_c1 says
            z[5, 4] = 1.0
            z[5, 7] = -zc1 / _TAU_MIXED_S  # vapour throughout: one well-mixed volume
        elif limited:
            z[5, 4] = 1.0
            z[5, 7] = bound
        else:
            m_1 = zc1 * (r1_c + over_1 * r1_hc) * half_1
            z[5, 0] = m_1 * c_pe
            z[5, 2] = m_1 * c_h2
            z[5, 3] = zc1 * (r1_c * hm1_p + over_1 * r1_pc - 1.0)
            z[5, 4] = max(over_1, _SUPERHEAT_FLOOR) * r1_c
            z[5, 7] = (m_c * max(hd - hg_c, 0.0) + zc1 * q_c1) / vc
        _solve(z, 7)
        again = False
        if regime_e == 0 and inward_e:
            dm_2 = zeta_e2 * (r2_pe * z[0, 7] + half_e * r2_he * z[2, 7]) - r2_e * z[1, 7]
            if m_c + ve * dm_2 < 0.0:
                inward_e, again = False, True
        if regime_c == 0 and inward_c:
            dm_3 = zeta_c3 * (r3_pc * z[3, 7] + half_3 * r3_hc * z[6, 7]) - r3_c * (z[4, 7] + z[5, 7])
            if m_v + vc * dm_3 < 0.0:
                inward_c, again = False, True
        if not limited and regime_c != 2:
            bound = wetness_c * z[4, 7] - (1.0 - wetness_c) * zc1 / _TAU_MIXED_S
            bound = min(max(bound, -_ZETA_RATE * zc1), _ZETA_RATE * (zeta_c2 - _ZETA_FLOOR))
            bound = min(bound, _ZETA_RATE * (_ZETA_C1_MAX - zc1))
            if bound != z[4, 7]:
                limited, again = True, True
        if not again:
            break
    dzeta_e, dzeta_c1, dzeta_c2 = z[1, 7], z[4, 7], z[5, 7]
    dzeta_c3 = -dzeta_c1 - dzeta_c2
    # --- wall temperatures -----------------------------------------------------------------------------------------
    up = _upwind(dzeta_e, min(zeta_e, zeta_e2))
    dt_e1 = (g_e * (t_air - tw_e1) - q_e1) / par[_CE] - up * d_e * dzeta_e / max(zeta_e, _ZETA_FLOOR)
    dt_e2 = (g_e * (t_air - tw_e2) - q_e2) / par[_CE] - (1.0 - up) * d_e * dzeta_e / max(zeta_e2, _ZETA_FLOOR)
    up1, up3 = _upwind(dzeta_c1, min(zc1, zeta_c2)), _upwind(dzeta_c3, min(zeta_c3, zeta_c2))
    d1, d3 = s[10], s[11]
    dt_c1 = (g_c * (par[_CTA] - tw_c1) - q_c1) / par[_CC] - up1 * d1 * dzeta_c1 / max(zc1, _ZETA_FLOOR)
    dt_c3 = (g_c * (par[_CTA] - tw_c3) - q_c3) / par[_CC] - up3 * d3 * dzeta_c3 / max(zeta_c3, _ZETA_FLOOR)
    dt_c2 = (g_c * (par[_CTA] - tw_c2) - q_c2) / par[_CC] - (
        (1.0 - up1) * d1 * dzeta_c1 + (1.0 - up3) * d3 * dzeta_c3
    ) / max(zeta_c2, _ZETA_FLOOR)
    ds[0], ds[1], ds[2] = dm_e, du_e, z[2, 7]
    ds[3] = (q_air_e - q_e) / par[_CE]
    ds[4] = own_e * (dt_e1 - dt_e2) - (1.0 - own_e) * d_e / _TAU_WALL_S
    ds[5], ds[6], ds[7], ds[8] = dm_c, du_c, dzeta_c1, z[6, 7]
    ds[9] = (q_air_c - q_c) / par[_CC]
    own_1 = _ramp(zc1 / _ZETA_FLOOR)
    ds[10] = own_1 * (dt_c1 - dt_c2) - (1.0 - own_1) * d1 / _TAU_WALL_S
    ds[11] = own_c * (dt_c3 - dt_c2) - (1.0 - own_c) * d3 / _TAU_WALL_S
    # --- what others read ------------------------------------------------------------------------------------------
    aux[0], aux[1], aux[2], aux[3], aux[4] = zeta_e, pe, h2, tw_e1, tw_e2
    aux[5], aux[6], aux[7], aux[8], aux[9], aux[10], aux[11] = zc1, zeta_c2, pc, h3, tw_c1, tw_c2, tw_c3
    aux[M_COMPRESSOR], aux[M_VALVE], aux[Q_EVAPORATOR] = m_c, m_v, q_e
    aux[Q_AIR_E], aux[Q_AIR_C], aux[POWER] = q_air_e, q_air_c, m_c * (hd - h2)
    aux[H_DISCHARGE], aux[SUPERHEAT], aux[SUBCOOLING] = hd, superheat, max(tc - t3_out, 0.0)
    aux[REGIME_E], aux[REGIME_C], aux[ETA_V] = regime_e, regime_c, eta_v
    aux[VOID_E], aux[VOID_C] = void_e, void_c
    aux[HEAT_IN] = q_air_e + q_air_c + m_c * (hd - h2)
    aux[WALL_E2] = tw_e2 if zeta_e2 > 0.0 else tw_e1
    return status


@jit
def conserved(x, par, tab, s):  # type: ignore[no-untyped-def]
    """Integration state `s` of a public state `x` with all five zones present (lengths between 0 and 1)."""
    _, _, _, _, _, _, _, _, _, hf, hg, rf, rg, sf, sg, _, hg_p, lnp, r1, e1, _, _, r2, _, _, hm, _, _, _, _, _ = (
        _evaporator_at(x[1], 1.0e9, 0.0, x[2], x[8], tab)
    )
    ze = x[0]
    s[0] = par[_VE] * (ze * r1 + (1.0 - ze) * r2)
    s[1] = par[_VE] * (ze * e1 + (1.0 - ze) * r2 * hm - x[1])
    s[2], s[3], s[4] = x[2], ze * x[3] + (1.0 - ze) * x[4], x[3] - x[4]
    s1, _, _ = vapour_entropy(tab, x[1], lnp, x[2], hg, hg_p)
    c = _condenser_at(x[7], 1.0e9, 0.0, x[5], x[8], s1, x[2], par[_ETAS], tab)
    z1, z2 = x[5], x[6]
    z3 = 1.0 - z1 - z2
    s[5] = par[_VC] * (z1 * c[22] + z2 * c[29] + z3 * c[36])
    s[6] = par[_VC] * (z1 * c[27] + z2 * c[30] + z3 * c[41] - x[7])
    s[7], s[8] = x[5], x[8]
    s[9] = z1 * x[9] + z2 * x[10] + z3 * x[11]
    s[10], s[11] = x[9] - x[10], x[11] - x[10]


def new_workspace() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Arrays `guess`, `z`, `ds`, `aux` for `rhs`."""
    return np.array([3.0e5, 1.2e6]), np.zeros((7, 8)), np.zeros(N_STATES), np.zeros(N_AUX)
