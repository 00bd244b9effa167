"""The equations of `ac_plant_node.cabin`, compiled."""

import math

from ac_plant_node.dynamics.moist_air import (
    CP_VAPOUR_J_KGK,
    H_VAPOUR_J_KG,
    enthalpy,
    humidity_ratio,
    relative_humidity,
    temperature,
)
from ac_plant_node.properties.compiled import Array, jit

LONGEST_STEP_S = 0.5
"""Longest step of the fourth-order Runge-Kutta method; the air's time constant is some 8 s."""
AIR_KG, INTERIOR_J_K, INTERIOR_W_K, OUTSIDE_W_K, APERTURE_M2, SENSIBLE_W, LATENT_W, AIR_CP_J_KGK = range(8)
"""Positions in the array of a cabin's parameters."""
Loads = tuple[float, float, float, float, float, float, float]
Rates = tuple[float, float, float, float]
_VAPOUR_J_KG = H_VAPOUR_J_KG + 34.0 * CP_VAPOUR_J_KGK


@jit
def _rates(air_j: float, water_kg: float, interior_j: float, loads: Loads, par: Array) -> Rates:
    """Return the rates of enthalpy and water of the air, energy of the interior, and energy that comes in."""
    vent_h, vent_ratio, blower, outside_c, sun, warmth, breath = loads
    h, ratio = air_j / par[AIR_KG], water_kg / par[AIR_KG]
    air_c, interior_c = temperature(h, ratio, par[AIR_CP_J_KGK]), interior_j / par[INTERIOR_J_K]
    inner = par[INTERIOR_W_K] * (interior_c - air_c)
    outer = blower * (vent_h - h) + par[OUTSIDE_W_K] * (outside_c - air_c) + warmth
    water = blower * (vent_ratio - ratio) + breath
    return outer + inner, water, sun - inner, outer + sun


@jit
def step(
    air_c: float, interior_c: float, ratio: float, vent_c: float, vent_ratio: float, blower: float, outside_c: float,
    sun_w_m2: float, people: float, duration_s: float, par: Array,
) -> tuple[float, float, float, float, float]:  # fmt: skip
    """Return temperatures (degC) of air and interior and humidity ratio after a time, and energy (J), water (kg) in.

    Parameters
    ----------
    air_c, interior_c, ratio : float
        The state.
    vent_c, vent_ratio, blower : float
        Air out of the vents: degC, humidity ratio, dry air kg/s.
    outside_c, sun_w_m2, people, duration_s : float
    par : (8,) array
        The cabin's parameters.
    """
    loads = (
        enthalpy(vent_c, vent_ratio, par[AIR_CP_J_KGK]), vent_ratio, blower, outside_c, par[APERTURE_M2] * sun_w_m2,
        people * (par[SENSIBLE_W] + par[LATENT_W]), people * par[LATENT_W] / _VAPOUR_J_KG,
    )  # fmt: skip
    air, water = par[AIR_KG] * enthalpy(air_c, ratio, par[AIR_CP_J_KGK]), par[AIR_KG] * ratio
    interior, energy_in, water_in = par[INTERIOR_J_K] * interior_c, 0.0, 0.0
    steps = max(math.ceil(duration_s / LONGEST_STEP_S), 1)
    h = duration_s / steps
    half, sixth = 0.5 * h, h / 6.0
    for _ in range(steps):
        a = _rates(air, water, interior, loads, par)
        b = _rates(air + half * a[0], water + half * a[1], interior + half * a[2], loads, par)
        c = _rates(air + half * b[0], water + half * b[1], interior + half * b[2], loads, par)
        d = _rates(air + h * c[0], water + h * c[1], interior + h * c[2], loads, par)
        air += sixth * (a[0] + 2.0 * b[0] + 2.0 * c[0] + d[0])
        more_water = sixth * (a[1] + 2.0 * b[1] + 2.0 * c[1] + d[1])
        water += more_water
        water_in += more_water
        interior += sixth * (a[2] + 2.0 * b[2] + 2.0 * c[2] + d[2])
        energy_in += sixth * (a[3] + 2.0 * b[3] + 2.0 * c[3] + d[3])
    ratio = water / par[AIR_KG]
    air_c = temperature(air / par[AIR_KG], ratio, par[AIR_CP_J_KGK])
    return air_c, interior / par[INTERIOR_J_K], ratio, energy_in, water_in


@jit
def mixed(
    air_c: float, ratio: float, outside_c: float, outside_humidity: float, share: float, cp_air: float
) -> tuple[float, float]:
    """Return temperature (degC) and relative humidity (0..1) of a share of cabin air, the rest outside air."""
    outside = humidity_ratio(outside_c, outside_humidity)
    water = share * ratio + (1.0 - share) * outside
    h = share * enthalpy(air_c, ratio, cp_air)
    h += (1.0 - share) * enthalpy(outside_c, outside, cp_air)
    mixed_c = temperature(h, water, cp_air)
    return mixed_c, min(relative_humidity(mixed_c, water), 1.0)
