"""Refrigerant property tables for run time, built once from CoolProp and cached on disk.

Every table is a piecewise cubic (saturation line, over ``ln p``) or bicubic (single phase, over ``ln p`` and a second
coordinate) polynomial whose *derivatives are those of the interpolant itself*: the balances of mass and energy then
close to round-off instead of to the accuracy of the table (a density slope that disagrees with the density creates
or destroys refrigerant).

Second coordinates, chosen so that the saturation line is a grid line and no cell straddles it:

* vapour: ``d = h - h_g(p)`` from 0 to 200 kJ/kg; stored ``p/rho``, ``T``, ``s``,
* vapour, for the isentrope: ``s - s_g(p)`` from 0 to 400 J/(kg K); stored ``h - h_g(p)``,
* liquid: ``(h_f(p) - h) / (h_f(p) - h_min)`` from 0 to 1; stored ``rho``, ``T``.

Reference: I. H. Bell et al., *CoolProp*, Ind. Eng. Chem. Res. 53 (2014) 2498; the equation of state behind R134a is
Tillner-Roth & Baehr, J. Phys. Chem. Ref. Data 23 (1994) 657; behind R1234yf, Lemmon & Akasaka (2022).
"""

import sys
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ac_common.cache import Arrays, cached

TABLE_VERSION = 3
"""Raised whenever the content or layout of the tables changes: part of the cache key."""

REFRIGERANTS = ("R134a", "R1234yf")

P_MIN_PA = 8.0e3
"""Lowest tabulated pressure."""
P_MAX_REDUCED = 0.92
"""Highest tabulated pressure over the critical pressure."""
VAPOUR_SPAN_J_KG = 200.0e3
"""Enthalpy span of the vapour tables above saturation."""
ENTROPY_SPAN_J_KGK = 400.0
"""Entropy span of the isentrope table above saturation."""
N_SATURATION = 400
N_PRESSURE = 120
N_SECOND = 64


class Tables(NamedTuple):
    """The tables of one refrigerant as flat arrays, ready for the compiled code.

    Attributes
    ----------
    sat : (N-1, 7, 4) array
        Cubic coefficients over ``ln p`` of T, h_f, h_g, rho_f, rho_g, s_f, s_g (K, J/kg, kg/m3, J/(kg K)).
    vapour : (Nx-1, Ny-1, 3, 16) array
        Bicubic patches of p/rho, T, s over (ln p, h - h_g).
    isentrope : (Nx-1, Ny-1, 1, 16) array
        Bicubic patches of h - h_g over (ln p, s - s_g).
    liquid : (Nx-1, Ny-1, 2, 16) array
        Bicubic patches of rho, T over (ln p, (h_f - h)/(h_f - h_min)).
    grid : (9,) array
        ln p_min, inverse step of the saturation grid, inverse step of ln p of the patches, inverse steps of the three
        second coordinates, h_min, p_min, p_max.
    """

    sat: NDArray[np.float64]
    vapour: NDArray[np.float64]
    isentrope: NDArray[np.float64]
    liquid: NDArray[np.float64]
    grid: NDArray[np.float64]


def table_identity(refrigerant: str) -> str:
    """Name what the tables of `refrigerant` depend on: fluid, CoolProp version, table layout.

    Raises
    ------
    ValueError
        When the refrigerant is not one of `REFRIGERANTS`.
    """
    if refrigerant not in REFRIGERANTS:
        raise ValueError(f"unknown refrigerant {refrigerant!r}: allowed are {', '.join(REFRIGERANTS)}")
    # Asked of the installation: loading CoolProp would cost a running node tens of megabytes.
    return f"{refrigerant}/CoolProp-{version('CoolProp')}/tables-{TABLE_VERSION}"


def load_tables(refrigerant: str = "R134a", progress: bool = True) -> Tables:
    """Return the tables of a refrigerant from the cache, built first (some seconds) when they are not there yet.

    Several processes may build them at once; an unwritable cache folder only costs the time of building again. All in a
    process have the same arrays.
    """
    return _loaded(refrigerant, table_identity(refrigerant), progress)


@cache
def _loaded(refrigerant: str, identity: str, progress: bool) -> Tables:
    def build() -> Arrays:
        if progress:
            print(f"acftc: building {refrigerant} property tables (once, some seconds)", file=sys.stderr)
        return build_tables(refrigerant)._asdict()

    found = cached(f"tables-{refrigerant}", {"tables": identity}, build)
    return Tables(*(np.ascontiguousarray(found[name]) for name in Tables._fields))


def build_tables(refrigerant: str = "R134a") -> Tables:
    """Sample CoolProp on the grids and fit the interpolants (some seconds)."""
    import CoolProp
    from scipy.interpolate import CubicSpline

    table_identity(refrigerant)
    fluid = CoolProp.AbstractState("HEOS", refrigerant)
    p_max = P_MAX_REDUCED * fluid.p_critical()
    ln_p = np.linspace(np.log(P_MIN_PA), np.log(p_max), N_SATURATION)
    sat_values = np.array([_saturation(fluid, p) for p in np.exp(ln_p)])
    spline = CubicSpline(ln_p, sat_values)
    sat = np.ascontiguousarray(np.transpose(spline.c[::-1], (1, 2, 0)))

    x = np.linspace(np.log(P_MIN_PA), np.log(p_max), N_PRESSURE)
    h_f, h_g, s_g = spline(x)[:, 1], spline(x)[:, 2], spline(x)[:, 6]
    d = np.linspace(0.0, VAPOUR_SPAN_J_KG, N_SECOND)
    s = np.linspace(0.0, ENTROPY_SPAN_J_KGK, N_SECOND)
    h_min = _lowest_liquid_enthalpy(fluid)
    y = np.linspace(0.0, 1.0, N_SECOND)

    def vapour(i: int, j: int) -> tuple[float, ...]:
        p = float(np.exp(x[i]))
        _at_enthalpy(fluid, p, h_g[i] + d[j], gas=True, edge=j == 0)
        return p / fluid.rhomass(), fluid.T(), fluid.smass()

    def isentrope(i: int, j: int) -> tuple[float, ...]:
        p = float(np.exp(x[i]))
        if j == 0:
            return (0.0,)
        fluid.update(CoolProp.PSmass_INPUTS, p, s_g[i] + s[j])
        return (fluid.hmass() - h_g[i],)

    def liquid(i: int, j: int) -> tuple[float, ...]:
        p = float(np.exp(x[i]))
        _at_enthalpy(fluid, p, h_f[i] - y[j] * (h_f[i] - h_min), gas=False, edge=j == 0)
        return fluid.rhomass(), fluid.T()

    dx = x[1] - x[0]
    grid = np.array(
        [
            x[0],
            1.0 / (ln_p[1] - ln_p[0]),
            1.0 / dx,
            1.0 / (d[1] - d[0]),
            1.0 / (s[1] - s[0]),
            1.0 / (y[1] - y[0]),
            h_min,
            P_MIN_PA,
            p_max,
        ]
    )
    return Tables(sat, _patches(vapour, x, d), _patches(isentrope, x, s), _patches(liquid, x, y), grid)


def _saturation(fluid: Any, p: float) -> tuple[float, ...]:
    import CoolProp

    fluid.update(CoolProp.PQ_INPUTS, p, 0.0)
    t, h_f, rho_f, s_f = fluid.T(), fluid.hmass(), fluid.rhomass(), fluid.smass()
    fluid.update(CoolProp.PQ_INPUTS, p, 1.0)
    return t, h_f, fluid.hmass(), rho_f, fluid.rhomass(), s_f, fluid.smass()


def _lowest_liquid_enthalpy(fluid: Any) -> float:
    import CoolProp

    fluid.update(CoolProp.QT_INPUTS, 0.0, 180.0)
    return float(fluid.hmass())


def _at_enthalpy(fluid: Any, p: float, h: float, *, gas: bool, edge: bool) -> None:
    """Put `fluid` at (p, h); on the saturation line itself by quality, where a flash of (p, h) is ambiguous."""
    import CoolProp

    if edge:
        fluid.update(CoolProp.PQ_INPUTS, p, 1.0 if gas else 0.0)
    else:
        fluid.update(CoolProp.HmassP_INPUTS, h, p)


def _patches(
    sample: Callable[[int, int], tuple[float, ...]], x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return bicubic coefficients, lowest power first, in cell coordinates 0..1: c[i, j, quantity, 4*k + l] t^k u^l."""
    from scipy.interpolate import RectBivariateSpline

    values = np.array([[sample(i, j) for j in range(len(y))] for i in range(len(x))])
    nx, ny, n = values.shape
    hx, hy = x[1] - x[0], y[1] - y[0]
    # Hermite basis to monomials: value 0, slope 0, value 1, slope 1 -> 1, t, t^2, t^3.
    hermite = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [-3, -2, 3, -1], [2, 1, -2, 1]], dtype=float)
    out = np.empty((nx - 1, ny - 1, n, 16))
    for q in range(n):
        fit = RectBivariateSpline(x, y, values[:, :, q], s=0)
        f = fit(x, y)
        f_x = fit(x, y, dx=1) * hx
        f_y = fit(x, y, dy=1) * hy
        f_xy = fit(x, y, dx=1, dy=1) * hx * hy
        corner = np.empty((nx - 1, ny - 1, 4, 4))
        for a, rows in enumerate((slice(0, nx - 1), slice(1, nx))):
            for b, cols in enumerate((slice(0, ny - 1), slice(1, ny))):
                corner[:, :, 2 * a, 2 * b] = f[rows, cols]
                corner[:, :, 2 * a + 1, 2 * b] = f_x[rows, cols]
                corner[:, :, 2 * a, 2 * b + 1] = f_y[rows, cols]
                corner[:, :, 2 * a + 1, 2 * b + 1] = f_xy[rows, cols]
        out[:, :, q, :] = np.einsum("ka,ijab,lb->ijkl", hermite, corner, hermite).reshape(nx - 1, ny - 1, 16)
    return out
