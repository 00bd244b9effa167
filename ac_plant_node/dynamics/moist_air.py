"""Moist air at sea level, and what of its water a cold wall takes.

``h = c_p t + W (h_0 + c_v t)`` per kilogram of dry air, with ``t`` in degC and the humidity ratio ``W = 0.622 p_v/(p -
p_v)`` (ASHRAE Handbook, Fundamentals, chapter Psychrometrics). Saturation pressure over water and over ice: A. L.
Buck, New equations for computing vapor pressure and enhancement factor, J. Appl. Meteorol. 20 (1981) 1527, with the
coefficients of 1996 and the enhancement factor of air at one atmosphere. Within 0.2 % of CoolProp's humid air from
-20 to 65 degC.

Coil: air of humidity `W_in` along a wall of one temperature, with heat and mass transfer alike (Lewis number 1, the
enthalpy potential of Merkel and Threlkeld; ASHRAE Handbook, HVAC Systems and Equipment, chapter Air-Cooling and
Dehumidifying Coils):

``t_out = T_w + (t_in - T_w) exp(-NTU)``, ``W_out = W_s + (W_in - W_s) exp(-NTU)``, ``W_s = min(W_sat(T_w), W_in)``.

The refrigerant takes up more heat where the air comes in, so a wall of mean temperature `T_w` over a refrigerant at
`T_r` is warmer there and colder where the air leaves. With heat falling off as ``exp(-N x)`` along the path, ``N`` that
of air and refrigerant side together, the two halves of the path are ``(T_w - T_r) tanh(N/4)`` above and below the mean.
Condensation, which is bent over temperature, is taken half by half; sensible heat, as in dry air, from the mean.

The water leaves as liquid at the wall's temperature; the wall takes up ``m [h_in - h_out - (W_in - W_out) c_w T_w]``.
Below 0 degC saturation is that over ice; the heat of fusion is left out, as the frost gives it back when it melts.
"""

import math

from ac_plant_node.properties.compiled import jit

PRESSURE_PA = 101325.0
H_VAPOUR_J_KG = 2.501e6
"""Enthalpy of water vapour at 0 degC over that of liquid water."""
CP_VAPOUR_J_KGK = 1860.0
CP_WATER_J_KGK = 4186.0
_RATIO = 0.621945
_ENHANCED = 1.0042


@jit
def saturation_pressure(t_c: float) -> float:
    """Return the vapour pressure (Pa) of saturated air at `t_c` (degC), over ice below 0 degC."""
    # One value at 0 degC for both (Buck: 611.21 and 611.15 Pa), so that nothing jumps there.
    if t_c >= 0.0:
        return _ENHANCED * 611.21 * math.exp((18.678 - t_c / 234.5) * t_c / (257.14 + t_c))
    return _ENHANCED * 611.21 * math.exp((23.036 - t_c / 333.7) * t_c / (279.82 + t_c))


@jit
def humidity_ratio(t_c: float, relative: float) -> float:
    """Return kilograms of water per kilogram of dry air at `t_c` (degC) and a relative humidity (0..1)."""
    p = relative * saturation_pressure(t_c)
    return _RATIO * p / max(PRESSURE_PA - p, 1.0e3)


@jit
def relative_humidity(t_c: float, ratio: float) -> float:
    """Return the relative humidity (0..) of air at `t_c` (degC) with a humidity ratio; above 1 it carries mist."""
    return ratio * PRESSURE_PA / ((_RATIO + ratio) * saturation_pressure(t_c))


@jit
def enthalpy(t_c: float, ratio: float, cp_air: float) -> float:
    """Return the enthalpy (J per kg of dry air) at `t_c` (degC) and a humidity ratio."""
    return cp_air * t_c + ratio * (H_VAPOUR_J_KG + CP_VAPOUR_J_KGK * t_c)


@jit
def temperature(h: float, ratio: float, cp_air: float) -> float:
    """Return the temperature (degC) at which air of a humidity ratio has the enthalpy `h` (J per kg of dry air)."""
    return (h - ratio * H_VAPOUR_J_KG) / (cp_air + ratio * CP_VAPOUR_J_KGK)


@jit
def condensation(
    air: float, ratio: float, half: float, t_air: float, t_wall: float, spread: float
) -> tuple[float, float]:
    """Return the water (kg/s) that a zone's wall takes out of the air, and the latent heat (W) with it.

    Parameters
    ----------
    air, ratio : float
        Dry air, kg/s, and its humidity ratio at the inlet.
    half : float
        ``exp(-NTU/2)``, the share of the driving differences that is left half way.
    t_air, t_wall : float
        Air at the inlet, and mean of the wall, K.
    spread : float
        How much warmer than its mean the wall is in the half where the air comes in, K.
    """
    wall_c = t_wall - 273.15
    left = ratio - (1.0 - half) * max(ratio - humidity_ratio(wall_c + spread, 1.0), 0.0)
    left -= (1.0 - half) * max(left - humidity_ratio(wall_c - spread, 1.0), 0.0)
    water = air * (ratio - left)
    if water <= 0.0:
        return 0.0, 0.0
    out_c = wall_c + half * half * (t_air - t_wall)
    return water, water * (H_VAPOUR_J_KG + CP_VAPOUR_J_KGK * out_c - CP_WATER_J_KGK * wall_c)
