"""Compiled look-ups in the property tables: values and exact derivatives, no CoolProp.

All functions take the `Tables` tuple first and plain floats after it. Pressures outside the table are extended with
the edge's polynomial held at its edge value, so that a trial step of a solver never reads out of bounds; the model
reports a pressure that *stays* outside.
"""

import math
from typing import NamedTuple

from ac_plant_node.properties.compiled import Array, jit
from ac_plant_node.properties.tables import Tables


class Saturation(NamedTuple):
    """The saturation line at one pressure: liquid f and vapour g, and slopes over pressure (SI)."""

    t: float
    h_f: float
    h_g: float
    rho_f: float
    rho_g: float
    s_f: float
    s_g: float
    t_p: float
    h_f_p: float
    h_g_p: float
    rho_f_p: float
    rho_g_p: float
    s_f_p: float
    s_g_p: float
    ln_p: float


@jit
def saturation(tab: Tables, p: float) -> Saturation:
    """Return the saturation line at pressure `p`, as `Saturation`."""
    sat = tab.sat
    lnp = math.log(p)
    x = (lnp - tab.grid[0]) * tab.grid[1]
    i = min(max(int(x), 0), sat.shape[0] - 1)
    t = (x - i) / tab.grid[1]
    inv_p = 1.0 / p
    c = sat[i]
    temp = c[0, 0] + t * (c[0, 1] + t * (c[0, 2] + t * c[0, 3]))
    h_f = c[1, 0] + t * (c[1, 1] + t * (c[1, 2] + t * c[1, 3]))
    h_g = c[2, 0] + t * (c[2, 1] + t * (c[2, 2] + t * c[2, 3]))
    r_f = c[3, 0] + t * (c[3, 1] + t * (c[3, 2] + t * c[3, 3]))
    r_g = c[4, 0] + t * (c[4, 1] + t * (c[4, 2] + t * c[4, 3]))
    s_f = c[5, 0] + t * (c[5, 1] + t * (c[5, 2] + t * c[5, 3]))
    s_g = c[6, 0] + t * (c[6, 1] + t * (c[6, 2] + t * c[6, 3]))
    temp_p = (c[0, 1] + t * (2.0 * c[0, 2] + t * 3.0 * c[0, 3])) * inv_p
    h_f_p = (c[1, 1] + t * (2.0 * c[1, 2] + t * 3.0 * c[1, 3])) * inv_p
    h_g_p = (c[2, 1] + t * (2.0 * c[2, 2] + t * 3.0 * c[2, 3])) * inv_p
    r_f_p = (c[3, 1] + t * (2.0 * c[3, 2] + t * 3.0 * c[3, 3])) * inv_p
    r_g_p = (c[4, 1] + t * (2.0 * c[4, 2] + t * 3.0 * c[4, 3])) * inv_p
    s_f_p = (c[5, 1] + t * (2.0 * c[5, 2] + t * 3.0 * c[5, 3])) * inv_p
    s_g_p = (c[6, 1] + t * (2.0 * c[6, 2] + t * 3.0 * c[6, 3])) * inv_p
    return Saturation(temp, h_f, h_g, r_f, r_g, s_f, s_g, temp_p, h_f_p, h_g_p, r_f_p, r_g_p, s_f_p, s_g_p, lnp)


@jit
def _bicubic(c: Array, t: float, u: float) -> tuple[float, float, float]:
    """Return value and both slopes of one patch at cell coordinates t, u."""
    a0 = c[0] + u * (c[1] + u * (c[2] + u * c[3]))
    a1 = c[4] + u * (c[5] + u * (c[6] + u * c[7]))
    a2 = c[8] + u * (c[9] + u * (c[10] + u * c[11]))
    a3 = c[12] + u * (c[13] + u * (c[14] + u * c[15]))
    b0 = c[1] + u * (2.0 * c[2] + u * 3.0 * c[3])
    b1 = c[5] + u * (2.0 * c[6] + u * 3.0 * c[7])
    b2 = c[9] + u * (2.0 * c[10] + u * 3.0 * c[11])
    b3 = c[13] + u * (2.0 * c[14] + u * 3.0 * c[15])
    f = a0 + t * (a1 + t * (a2 + t * a3))
    f_t = a1 + t * (2.0 * a2 + t * 3.0 * a3)
    f_u = b0 + t * (b1 + t * (b2 + t * b3))
    return f, f_t, f_u


@jit
def _patch_value(table: Array, q: int, x: float, y: Array) -> tuple[float, float, float]:
    """Return value and slopes in cell units; beyond the last row or column of cells along the tangent."""
    nx, ny = table.shape[0], table.shape[1]
    i = min(max(int(x), 0), nx - 1)
    j = min(max(int(y), 0), ny - 1)
    t, u = x - i, y - j
    tc = min(max(t, 0.0), 1.0)
    uc = min(max(u, 0.0), 1.0)
    f, f_t, f_u = _bicubic(table[i, j, q], tc, uc)
    return f + f_t * (t - tc) + f_u * (u - uc), f_t, f_u


@jit
def vapour(tab: Tables, p: float, lnp: float, h: float, h_g: float, h_g_p: float) -> tuple[float, float, float, float]:
    """Return rho, d(rho)/dp at h, d(rho)/dh at p and T of superheated vapour at (p, h)."""
    x = (lnp - tab.grid[0]) * tab.grid[2]
    y = (h - h_g) * tab.grid[3]
    z, z_x, z_y = _patch_value(tab.vapour, 0, x, y)
    temp, _, _ = _patch_value(tab.vapour, 1, x, y)
    z_h = z_y * tab.grid[3]
    z_p = z_x * tab.grid[2] / p - z_h * h_g_p
    rho = p / z
    return rho, rho / p - rho / z * z_p, -rho / z * z_h, temp


@jit
def vapour_entropy(tab: Tables, p: float, lnp: float, h: float, h_g: float, h_g_p: float) -> tuple[float, float, float]:
    """Return s, ds/dp at h and ds/dh at p of superheated vapour at (p, h)."""
    s, s_x, s_y = _patch_value(tab.vapour, 2, (lnp - tab.grid[0]) * tab.grid[2], (h - h_g) * tab.grid[3])
    s_h = s_y * tab.grid[3]
    return s, s_x * tab.grid[2] / p - s_h * h_g_p, s_h


@jit
def isentrope(
    tab: Tables, p: float, lnp: float, s: float, h_g: float, h_g_p: float, s_g: float, s_g_p: float, t_sat: float
) -> tuple[float, float, float]:
    """Return h, dh/dp at s and dh/ds at p of vapour at (p, s), below saturation on the two-phase isobar dh = T ds."""
    if s < s_g:
        return h_g + t_sat * (s - s_g), h_g_p - t_sat * s_g_p, t_sat
    d, d_x, d_y = _patch_value(tab.isentrope, 0, (lnp - tab.grid[0]) * tab.grid[2], (s - s_g) * tab.grid[4])
    h_s = d_y * tab.grid[4]
    return h_g + d, h_g_p + d_x * tab.grid[2] / p - h_s * s_g_p, h_s


@jit
def liquid(tab: Tables, p: float, lnp: float, h: float, h_f: float, h_f_p: float) -> tuple[float, float, float, float]:
    """Return rho, d(rho)/dp at h, d(rho)/dh at p and T of subcooled liquid at (p, h)."""
    span = h_f - tab.grid[6]
    y = (h_f - h) / span
    x = (lnp - tab.grid[0]) * tab.grid[2]
    rho, r_x, r_y = _patch_value(tab.liquid, 0, x, y * tab.grid[5])
    temp, _, _ = _patch_value(tab.liquid, 1, x, y * tab.grid[5])
    r_y *= tab.grid[5]
    return rho, r_x * tab.grid[2] / p + r_y * (1.0 - y) * h_f_p / span, -r_y / span, temp
