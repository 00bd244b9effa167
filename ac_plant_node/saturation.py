"""Saturation temperature of the plant's refrigerant over pressure, from its tables: no CoolProp, no compiler."""

import math
import os
from functools import cache

from ac_plant_node.parameters.file import PLANT_VARIABLE, load_parameters
from ac_plant_node.properties.tables import Tables, load_tables


@cache
def _tables(_plant: str | None) -> Tables:
    return load_tables(load_parameters().refrigerant)


def _cubic(pressure_pa: float) -> tuple[list[float], float]:
    """Return the coefficients of T over `ln p` in the cell of `pressure_pa`, and the position in that cell."""
    tables = _tables(os.environ.get(PLANT_VARIABLE))
    cells = (math.log(pressure_pa) - tables.grid[0]) * tables.grid[1]
    cell = min(max(int(cells), 0), len(tables.sat) - 1)
    return tables.sat[cell, 0].tolist(), (cells - cell) / float(tables.grid[1])


def saturation_temperature(pressure_pa: float) -> float:
    """Return the saturation temperature [K] at `pressure_pa` [Pa], which must be positive."""
    (a, b, c, d), t = _cubic(pressure_pa)
    return float(a + t * (b + t * (c + t * d)))


def saturation_slope(pressure_pa: float) -> float:
    """Return the slope `dT_sat/dp` [K/Pa] at `pressure_pa` [Pa], which must be positive."""
    (_, b, c, d), t = _cubic(pressure_pa)
    return float((b + t * (2.0 * c + t * 3.0 * d)) / pressure_pa)
