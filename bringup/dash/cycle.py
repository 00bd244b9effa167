"""The refrigerant cycle on the pressure-enthalpy diagram, from what the loop publishes. Pure: no ROS, no Bokeh.

Corners: 1 compressor inlet, 2 its outlet, 3 condenser outlet, 4 evaporator inlet. What is measured gives 1 and 2 as the
plant's own model has them; the condenser's outlet is no measurement of this loop, so 3 (and 4 = 3, the valve being
isenthalpic) follows from the plant's health reports, once a second, and where there are none is assumed.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Corners:
    """The cycle's corners 1, 2, 3, 4.

    Attributes
    ----------
    enthalpy_j_kg, pressure_pa : ndarray, shape (4,)
    """

    enthalpy_j_kg: Vector
    pressure_pa: Vector


@cache
def _plant() -> tuple[Any, float]:
    from ac_plant_node.parameters.file import load_parameters
    from ac_plant_node.properties.tables import load_tables

    parameters = load_parameters()
    return load_tables(parameters.refrigerant, progress=False), float(parameters["isentropic_efficiency"])


def dome(points: int = 120) -> tuple[Vector, Vector]:
    """Return the saturation line from boiling liquid over the top to dry vapour: enthalpy [J/kg] and pressure [Pa]."""
    from ac_plant_node.properties.lookup import saturation

    tables, _ = _plant()
    pressures = np.geomspace(5.0e4, float(tables.grid[8]), points)
    lines = np.array([saturation(tables, p)[1:3] for p in pressures])
    return np.concatenate([lines[:, 0], lines[::-1, 1]]), np.concatenate([pressures, pressures[::-1]])


def subcooled_enthalpy(p_c: float, h_c3: float) -> float:
    """Return how far the condenser's outlet is below boiling liquid, J/kg: it hardly changes from report to report."""
    from ac_plant_node.properties.lookup import saturation

    return float(saturation(_plant()[0], p_c).h_f - h_c3)


def corners(p_e: float, superheat: float, p_c: float, below_boiling_j_kg: float) -> Corners:
    """Return the corners of the cycle.

    Parameters
    ----------
    p_e, p_c : float
        Evaporator and condenser pressure [Pa]: no pressure drop in either.
    superheat : float
        [K]; where there is none the compressor is taken to draw dry saturated vapour.
    below_boiling_j_kg : float
        Enthalpy of boiling liquid minus that of the condenser's outlet, see `subcooled_enthalpy`.
    """
    from ac_plant_node.calibration import superheated_enthalpy
    from ac_plant_node.properties.lookup import isentrope, saturation, vapour_entropy

    tables, efficiency = _plant()
    low, high = saturation(tables, p_e), saturation(tables, p_c)
    h_1 = superheated_enthalpy(tables, p_e, superheat) if superheat > 0.0 else low.h_g
    s_1 = vapour_entropy(tables, p_e, low.ln_p, h_1, low.h_g, low.h_g_p)[0]
    h_2s = isentrope(tables, p_c, high.ln_p, s_1, high.h_g, high.h_g_p, high.s_g, high.s_g_p, high.t)[0]
    # As ac_plant_node.dynamics.zones: a constant isentropic efficiency.
    h_2 = h_1 + max(h_2s - h_1, 0.0) / efficiency
    h_3 = high.h_f - below_boiling_j_kg
    return Corners(np.array([h_1, h_2, h_3, h_3]), np.array([p_e, p_c, p_c, p_e]))
