"""From mass and energy in a heat exchanger to its pressure and zones: the closures of the moving-boundary model.

Each heat exchanger is one scalar equation in its pressure, solved by Newton's method inside a bracket. The functions
`evaporator_at` and `condenser_at` evaluate it at a trial pressure and hand back everything that the balances need; the
regime (which zones exist) is part of that evaluation, see `ac_plant_node.dynamics.balances`.
"""

import math
from typing import NamedTuple

from ac_plant_node.properties.compiled import jit
from ac_plant_node.properties.lookup import Saturation, isentrope, liquid, saturation, vapour
from ac_plant_node.properties.tables import Tables

_X_INLET_MAX = 0.95  # the mean void fraction is taken from at most this inlet quality
_X_OUTLET_MIN = 0.7  # the suction header holds back liquid: quality drawn by the compressor
_PRESSURE_TOLERANCE = 1.0e-13  # relative step below which Newton's method has arrived


class Evaporator(NamedTuple):
    """The evaporator at a trial pressure. Subscripts: 1 two-phase zone, 2 superheated zone; `e_` is rho times h.

    `residual` of the energy balance with its slopes in p (at fixed mass and energy) and in the mean density; the
    regime; zone length, void fraction and its slope in the inlet enthalpy, inlet quality; slopes in p end in `_p`,
    in h in `_h`; `half` is dh_2/dh_e2, 0 when the outlet is wet.
    """

    p: float
    residual: float
    slope: float
    slope_rho: float
    regime: int
    zeta: float
    void: float
    void_h: float
    x_in: float
    sat: Saturation
    rho_1: float
    e_1: float
    rho_1_p: float
    e_1_p: float
    rho_2: float
    rho_2_h: float
    rho_2_p: float
    e_2_p: float
    h_2: float
    h_2_p: float
    half: float
    t_2: float


class Condenser(NamedTuple):
    """The condenser at a trial pressure. Subscripts: 1 superheated, 2 two-phase, 3 subcooled; `_d` discharge gas.

    `rho_rest`, `e_rest`, `h_rest`, `void_rest` describe what is beyond the first zone when it is one body (regimes 1
    and 2); `void_full` is the mean void fraction of complete condensation. Otherwise as `Evaporator`.
    """

    p: float
    residual: float
    slope: float
    slope_rho: float
    regime: int
    zeta_1: float
    zeta_2: float
    void_rest: float
    void_full: float
    rho_rest: float
    e_rest: float
    h_rest: float
    sat: Saturation
    h_d: float
    h_d_s: float
    h_d_h: float
    half_1: float
    h_1: float
    h_1_p: float
    rho_1: float
    rho_1_h: float
    rho_1_p: float
    e_1: float
    e_1_p: float
    t_1: float
    rho_2: float
    e_2: float
    rho_2_p: float
    e_2_p: float
    t_2: float
    half_3: float
    h_3: float
    h_3_p: float
    rho_3: float
    rho_3_h: float
    rho_3_p: float
    e_3: float
    e_3_p: float
    t_3: float


@jit
def mean_void(slip: float, x1: float) -> tuple[float, float, float]:
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
def mixture(
    rbar: float, ra: float, rb: float, ha: float, hb: float, ra_p: float, rb_p: float, ha_p: float, hb_p: float
) -> tuple[float, float, float, float]:
    """Fill a volume with two materials of densities ra, rb and volumetric enthalpies ha, hb at mean density `rbar`.

    Returns the share of the first, the volumetric enthalpy, its slope in p at fixed `rbar`, its slope in `rbar`.
    """
    gap = ra - rb
    share = (rbar - rb) / gap
    slope = (ha - hb) / gap
    share_p = (-rb_p - share * (ra_p - rb_p)) / gap
    return share, hb + share * (ha - hb), share * ha_p + (1.0 - share) * hb_p + (ha - hb) * share_p, slope


@jit
def two_phase(sat: Saturation, x_in: float, x_in_p: float) -> tuple[float, float, float, float, float, float]:
    """Two-phase zone from quality `x_in` to 1: density, volumetric enthalpy, their slopes in p, void and its slope."""
    slip = (sat.rho_g / sat.rho_f) ** (2.0 / 3.0)
    slip_p = slip * (2.0 / 3.0) * (sat.rho_g_p / sat.rho_g - sat.rho_f_p / sat.rho_f)
    void, void_s, void_x = mean_void(slip, x_in)
    void_p = void_s * slip_p + void_x * x_in_p
    e_f, e_g = sat.rho_f * sat.h_f, sat.rho_g * sat.h_g
    e_f_p = sat.rho_f_p * sat.h_f + sat.rho_f * sat.h_f_p
    e_g_p = sat.rho_g_p * sat.h_g + sat.rho_g * sat.h_g_p
    rho = sat.rho_f + void * (sat.rho_g - sat.rho_f)
    e = e_f + void * (e_g - e_f)
    rho_p = sat.rho_f_p + void * (sat.rho_g_p - sat.rho_f_p) + void_p * (sat.rho_g - sat.rho_f)
    e_p = e_f_p + void * (e_g_p - e_f_p) + void_p * (e_g - e_f)
    return rho, e, rho_p, e_p, void, void_x


@jit
def saturated_mixture(sat: Saturation, rho: float) -> tuple[float, float, float, float]:
    """A body of saturated liquid and vapour of density `rho`: void fraction, and `mixture`'s other three results."""
    share, e, e_p, slope = mixture(
        rho, sat.rho_g, sat.rho_f, sat.rho_g * sat.h_g, sat.rho_f * sat.h_f, sat.rho_g_p, sat.rho_f_p,
        sat.rho_g_p * sat.h_g + sat.rho_g * sat.h_g_p, sat.rho_f_p * sat.h_f + sat.rho_f * sat.h_f_p,
    )  # fmt: skip
    return share, e, e_p, slope


@jit
def _vapour_body(
    sat: Saturation, p: float, rho: float, e: float, tab: Tables
) -> tuple[float, float, float, float, float, float, float, float]:
    """Vapour throughout, at mean density `rho` and internal energy `e` per volume: residual, slopes, h, rho(p, h), T.

    Below saturated vapour the table ends; its edge keeps the residual's sign right.
    """
    h = (e + p) / rho
    dry = max(h, sat.h_g)
    rho_h, rho_p, slope_h, t = vapour(tab, p, sat.ln_p, dry, sat.h_g, sat.h_g_p)
    residual = rho * (dry - h + (rho - rho_h) / slope_h)
    return residual, -rho * rho_p / slope_h - 1.0, h + rho / slope_h, h, rho_h, rho_p, slope_h, t


@jit
def evaporator_at(p: float, rho: float, e: float, h_e2: float, h_4: float, tab: Tables) -> Evaporator:
    """Zones of the evaporator at a trial pressure; `rho`, `e` are mass and internal energy over volume."""
    sat = saturation(tab, p)
    h_fg = sat.h_g - sat.h_f
    x = (h_4 - sat.h_f) / h_fg
    x_p = -(sat.h_f_p + x * (sat.h_g_p - sat.h_f_p)) / h_fg
    x_h = 1.0 / h_fg
    if x < 0.0:
        x, x_p, x_h = 0.0, 0.0, 0.0
    elif x > _X_INLET_MAX:
        x, x_p, x_h = _X_INLET_MAX, 0.0, 0.0
    rho_1, e_1, rho_1_p, e_1_p, void, void_x = two_phase(sat, x, x_p)
    half = 0.5 if h_e2 > sat.h_g else 0.0
    h_2 = sat.h_g + half * (h_e2 - sat.h_g)
    h_2_p = (1.0 - half) * sat.h_g_p
    rho_2, rho_p, rho_2_h, t_2 = vapour(tab, p, sat.ln_p, h_2, sat.h_g, sat.h_g_p)
    rho_2_p = rho_p + rho_2_h * h_2_p
    e_2_p = rho_2_p * h_2 + rho_2 * h_2_p
    regime, zeta = 0, 0.0
    if rho > rho_1:
        regime, zeta = 1, 1.0
        void, body, body_p, slope_rho = saturated_mixture(sat, rho)
        residual, slope = body - p - e, body_p - 1.0
    elif rho >= rho_2:
        zeta, body, body_p, slope_rho = mixture(rho, rho_1, rho_2, e_1, rho_2 * h_2, rho_1_p, rho_2_p, e_1_p, e_2_p)
        residual, slope = body - p - e, body_p - 1.0
    else:
        regime, void = 2, 1.0
        residual, slope, slope_rho, h_2, rho_2, _, rho_2_h, t_2 = _vapour_body(sat, p, rho, e, tab)
    return Evaporator(
        p, residual, slope, slope_rho, regime, zeta, void, void_x * x_h, x, sat, rho_1, e_1, rho_1_p, e_1_p,
        rho_2, rho_2_h, rho_2_p, e_2_p, h_2, h_2_p, half, t_2,
    )  # fmt: skip


@jit
def condenser_at(
    p: float, rho: float, e: float, zeta_1: float, h_c3: float, s_1: float, h_1in: float, eta_s: float, tab: Tables
) -> Condenser:
    """Zones of the condenser at a trial pressure.

    The first zone has the given length and the mean enthalpy ``(h_2 + h_g)/2`` of the discharge gas, which has been
    compressed from entropy `s_1` and enthalpy `h_1in`: ``h_2 = h_1 + (h_2s - h_1)/eta_s``.
    """
    sat = saturation(tab, p)
    h_s, h_s_p, h_s_s = isentrope(tab, p, sat.ln_p, s_1, sat.h_g, sat.h_g_p, sat.s_g, sat.s_g_p, sat.t)
    h_d, h_d_p, h_d_s, h_d_h = h_1in, 0.0, 0.0, 1.0
    if h_s > h_1in:
        h_d, h_d_p, h_d_s, h_d_h = h_1in + (h_s - h_1in) / eta_s, h_s_p / eta_s, h_s_s / eta_s, 1.0 - 1.0 / eta_s
    half_1 = 0.5 if h_d > sat.h_g else 0.0
    h_1 = sat.h_g + half_1 * (h_d - sat.h_g)
    h_1_p = (1.0 - half_1) * sat.h_g_p + half_1 * h_d_p
    rho_1, rho_p, rho_1_h, t_1 = vapour(tab, p, sat.ln_p, h_1, sat.h_g, sat.h_g_p)
    rho_1_p = rho_p + rho_1_h * h_1_p
    e_1, e_1_p = rho_1 * h_1, rho_1_p * h_1 + rho_1 * h_1_p
    rho_2, e_2, rho_2_p, e_2_p, void_full, _ = two_phase(sat, 0.0, 0.0)
    half_3 = 0.5 if h_c3 < sat.h_f else 0.0
    h_3 = sat.h_f + half_3 * (h_c3 - sat.h_f)
    h_3_p = (1.0 - half_3) * sat.h_f_p
    rho_3, rho_p, rho_3_h, t_3 = liquid(tab, p, sat.ln_p, h_3, sat.h_f, sat.h_f_p)
    rho_3_p = rho_p + rho_3_h * h_3_p
    e_3, e_3_p = rho_3 * h_3, rho_3_p * h_3 + rho_3 * h_3_p
    # What the first zone leaves to the rest.
    rest = 1.0 - zeta_1
    rho_rest = (rho - zeta_1 * rho_1) / rest
    e_rest = (e + p - zeta_1 * e_1) / rest
    regime, zeta_2, void_rest, h_rest, t_2 = 0, rest, void_full, 0.0, sat.t
    if rho_rest >= sat.rho_g:
        if rho_rest >= rho_2:
            share, body, body_p, slope_rho = mixture(rho_rest, rho_2, rho_3, e_2, e_3, rho_2_p, rho_3_p, e_2_p, e_3_p)
            zeta_2 = rest * share
        else:
            regime = 1
            void_rest, body, body_p, slope_rho = saturated_mixture(sat, rho_rest)
        residual = rest * (body - e_rest)
        # The rest's density moves with p as the first zone's does.
        slope = rest * body_p - slope_rho * zeta_1 * rho_1_p + zeta_1 * e_1_p - 1.0
        e_rest = body
    else:
        regime, void_rest = 2, 1.0
        residual, slope, slope_rho, h_rest, rho_rest, _, _, t_2 = _vapour_body(sat, p, rho, e, tab)
    return Condenser(
        p, residual, slope, slope_rho, regime, zeta_1, zeta_2, void_rest, void_full, rho_rest, e_rest, h_rest, sat,
        h_d, h_d_s, h_d_h, half_1, h_1, h_1_p, rho_1, rho_1_h, rho_1_p, e_1, e_1_p, t_1,
        rho_2, e_2, rho_2_p, e_2_p, t_2, half_3, h_3, h_3_p, rho_3, rho_3_h, rho_3_p, e_3, e_3_p, t_3,
    )  # fmt: skip


@jit
def next_pressure(p: float, residual: float, slope: float, low: float, high: float) -> tuple[float, float, float]:
    """Return Newton's next pressure, or the middle of the bracket when the step leaves it, and the narrower bracket."""
    if residual > 0.0:
        high = p
    else:
        low = p
    trial = p - residual / slope if slope > 0.0 else -1.0
    return trial if low < trial < high else 0.5 * (low + high), low, high


@jit
def solve_evaporator(
    start: float, rho: float, e: float, h_e2: float, h_4: float, tab: Tables
) -> tuple[Evaporator, int]:
    """The evaporator at the pressure that fits its mass and energy; 0, or 1 when none inside the tables does."""
    p_low, p_high = tab.grid[7], tab.grid[8]
    low, high = p_low, p_high
    zones = evaporator_at(min(max(start, p_low), p_high), rho, e, h_e2, h_4, tab)
    for _ in range(60):
        if abs(zones.residual) <= _PRESSURE_TOLERANCE * abs(zones.slope) * zones.p:
            return zones, 0
        p, low, high = next_pressure(zones.p, zones.residual, zones.slope, low, high)
        zones = evaporator_at(p, rho, e, h_e2, h_4, tab)
        if high - low <= 4.0e-16 * zones.p:
            break
    return zones, 0 if high - low <= 4.0e-16 * zones.p and p_low * 1.0001 < zones.p < p_high * 0.9999 else 1


@jit
def solve_condenser(
    start: float, rho: float, e: float, zeta_1: float, h_c3: float, s_1: float, h_1in: float, eta_s: float, tab: Tables
) -> tuple[Condenser, int]:
    """The condenser at the pressure that fits its mass and energy, as `solve_evaporator`."""
    p_low, p_high = tab.grid[7], tab.grid[8]
    low, high = p_low, p_high
    zones = condenser_at(min(max(start, p_low), p_high), rho, e, zeta_1, h_c3, s_1, h_1in, eta_s, tab)
    for _ in range(60):
        if abs(zones.residual) <= _PRESSURE_TOLERANCE * abs(zones.slope) * zones.p:
            return zones, 0
        p, low, high = next_pressure(zones.p, zones.residual, zones.slope, low, high)
        zones = condenser_at(p, rho, e, zeta_1, h_c3, s_1, h_1in, eta_s, tab)
        if high - low <= 4.0e-16 * zones.p:
            break
    return zones, 0 if high - low <= 4.0e-16 * zones.p and p_low * 1.0001 < zones.p < p_high * 0.9999 else 1


@jit
def _saturated(sat: Saturation, void: float) -> tuple[float, float]:
    """Density and volumetric enthalpy of saturated liquid and vapour at a void fraction."""
    rho = sat.rho_f + void * (sat.rho_g - sat.rho_f)
    return rho, sat.rho_f * sat.h_f + void * (sat.rho_g * sat.h_g - sat.rho_f * sat.h_f)


@jit
def inventory(ev: Evaporator, co: Condenser, zeta_c3: float, ve: float, vc: float) -> tuple[float, float]:
    """Refrigerant mass and internal energy summed over the zones: density by density, not from the state's M and U.

    The two agree as far as the pressures have been solved, so this checks them.
    """
    if ev.regime == 1:
        rho_e, e_e = _saturated(ev.sat, ev.void)
    else:
        rho_e = ev.zeta * ev.rho_1 + (1.0 - ev.zeta) * ev.rho_2
        e_e = ev.zeta * ev.e_1 + (1.0 - ev.zeta) * ev.rho_2 * ev.h_2
    if co.regime == 2:
        rho_c, e_c = co.rho_rest, co.rho_rest * co.h_rest
    else:
        rho_c, e_c = co.zeta_1 * co.rho_1, co.zeta_1 * co.e_1
        rho_2, e_2 = co.rho_2, co.e_2
        if co.regime == 1:
            rho_2, e_2 = _saturated(co.sat, co.void_rest)
        rho_c += co.zeta_2 * rho_2 + zeta_c3 * co.rho_3
        e_c += co.zeta_2 * e_2 + zeta_c3 * co.e_3
    return ve * rho_e + vc * rho_c, ve * (e_e - ev.p) + vc * (e_c - co.p)


@jit
def outlet_targets(ev: Evaporator, co: Condenser) -> tuple[float, float]:
    """Enthalpies that the outlets tend to while the single-phase zone before them is absent."""
    target_e, target_c = ev.h_2, co.h_rest
    if ev.regime == 1:
        # Liquid beyond what complete evaporation holds leaves with the vapour: slope of Zivi's profile at x = 1.
        full, _, _ = mean_void((ev.sat.rho_g / ev.sat.rho_f) ** (2.0 / 3.0), ev.x_in)
        wet = min((1.0 - ev.x_in) * (full - ev.void) / (1.0 - full), 1.0 - _X_OUTLET_MIN)
        target_e = ev.sat.h_g - wet * (ev.sat.h_g - ev.sat.h_f)
    if co.regime == 1:
        # Vapour beyond what complete condensation holds leaves with the liquid: slope of Zivi's profile at x = 0.
        y = (co.void_rest - co.void_full) / (1.0 - co.void_full)
        x_out = y * ((1.0 - co.void_full) / co.void_full * (1.0 - y) + y)
        target_c = co.sat.h_f + x_out * (co.sat.h_g - co.sat.h_f)
    return target_e, target_c
