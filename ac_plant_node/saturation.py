"""Saturation temperature of the plant's refrigerant over pressure, from its tables: no CoolProp."""

import math
import os
from functools import cache

import numpy as np

from ac_common.compiled import Array, step_compiler
from ac_plant_node.parameters.file import PLANT_VARIABLE, load_parameters
from ac_plant_node.properties.tables import load_tables

_jit = step_compiler("ac_plant_node.saturation")


@cache
def _curve(_plant: str | None) -> Array:
    tables = load_tables(load_parameters().refrigerant)
    return np.concatenate([tables.grid[:2], tables.sat[:, 0].ravel()])


def saturation_curve() -> Array:
    """Return the saturation temperature over pressure as one flat array, for compiled code.

    First grid point and points per unit of `ln p`, then the four coefficients of each cell.
    """
    return _curve(os.environ.get(PLANT_VARIABLE))


@_jit
def _cubic(curve: Array, pressure_pa: float) -> tuple[int, float]:
    """Return where the coefficients of the cell of `pressure_pa` begin, and the position in that cell."""
    cells = (math.log(pressure_pa) - curve[0]) * curve[1]
    cell = min(max(int(cells), 0), (len(curve) - 2) // 4 - 1)
    return 2 + 4 * cell, (cells - cell) / curve[1]


@_jit
def temperature_on(curve: Array, pressure_pa: float) -> float:
    """Return the saturation temperature [K] at `pressure_pa` [Pa], which must be positive."""
    at, t = _cubic(curve, pressure_pa)
    temperature: float = curve[at] + t * (curve[at + 1] + t * (curve[at + 2] + t * curve[at + 3]))
    return temperature


@_jit
def slope_on(curve: Array, pressure_pa: float) -> float:
    """Return the slope `dT_sat/dp` [K/Pa] at `pressure_pa` [Pa], which must be positive."""
    at, t = _cubic(curve, pressure_pa)
    slope: float = (curve[at + 1] + t * (2.0 * curve[at + 2] + t * 3.0 * curve[at + 3])) / pressure_pa
    return slope


def saturation_temperature(pressure_pa: float) -> float:
    """Return the saturation temperature [K] at `pressure_pa` [Pa], which must be positive."""
    return float(temperature_on(saturation_curve(), float(pressure_pa)))


def saturation_slope(pressure_pa: float) -> float:
    """Return the slope `dT_sat/dp` [K/Pa] at `pressure_pa` [Pa], which must be positive."""
    return float(slope_on(saturation_curve(), float(pressure_pa)))
