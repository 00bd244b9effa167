"""The plant's model with CoolProp in place of tables, not compiled: slow, for the verification of both.

The functions of `ac_plant_node.dynamics.balances` are taken as plain Python and given look-ups that call CoolProp's
equation of state, and one for humid air that calls CoolProp's. What differs from the plant is then exactly the
properties; and the time it takes is what tables and compiler save. For tests and benchmarks.
"""

from types import FunctionType
from typing import Any

import CoolProp
import numpy as np
from CoolProp.HumidAirProp import HAPropsSI
from numpy.typing import NDArray

from ac_plant_node.dynamics import balances, descriptor, linear_algebra, moist_air, transfer, zones
from ac_plant_node.dynamics.drive import drive
from ac_plant_node.parameters.file import load_parameters
from ac_plant_node.parameters.values import Parameters
from ac_plant_node.properties.lookup import Saturation
from ac_plant_node.properties.tables import Tables, load_tables


class CoolPropModel:
    """The right-hand side of `ac_plant_node.dynamics.balances.rhs` evaluated with CoolProp.

    Parameters
    ----------
    parameters : Parameters, optional
        The shipped set by default.
    """

    def __init__(self, parameters: Parameters | None = None) -> None:
        self.parameters = parameters or load_parameters()
        self.tab: Tables = load_tables(self.parameters.refrigerant)  # only its pressure limits are read
        space: dict[str, Any] = {
            **vars(linear_algebra),
            **vars(moist_air),
            **vars(zones),
            **vars(transfer),
            **vars(descriptor),
            **vars(balances),
        }
        for name, value in list(space.items()):
            if hasattr(value, "py_func"):
                space[name] = FunctionType(value.py_func.__code__, space, name)
        space.update(coolprop_lookups(self.parameters.refrigerant))
        self._rhs, self._conserved = space["rhs"], space["conserved"]
        self._guess, self._z, self._ds, self.aux = balances.new_workspace()

    def rates(self, s: NDArray[np.float64], w: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the rates (12,) of an integration state; the auxiliary results are in `aux` afterwards."""
        self._rhs(
            s, drive(w, self.parameters), self.parameters.values, self.tab, self._guess, self._z, self._ds, self.aux
        )
        return self._ds.copy()

    def conserved(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the integration state (12,) of a public state x with all five zones."""
        s = np.zeros(balances.N_STATES)
        self._conserved(x, self.parameters.values, self.tab, s)
        return s


def coolprop_lookups(refrigerant: str) -> dict[str, Any]:
    """Return the functions of `ac_plant_node.properties.lookup` by name, each a handful of CoolProp calls."""

    def humidity_ratio(t_c: float, relative: float) -> float:
        return float(HAPropsSI("W", "T", t_c + 273.15, "P", moist_air.PRESSURE_PA, "R", relative))

    fluid = CoolProp.AbstractState("HEOS", refrigerant)
    i_t, i_h, i_d, i_s, i_p = CoolProp.iT, CoolProp.iHmass, CoolProp.iDmass, CoolProp.iSmass, CoolProp.iP

    def saturation(_tab: Tables, p: float) -> Saturation:
        fluid.update(CoolProp.PQ_INPUTS, p, 0.0)
        t, h_f, r_f, s_f = fluid.T(), fluid.hmass(), fluid.rhomass(), fluid.smass()
        f_p = [fluid.first_saturation_deriv(of, i_p) for of in (i_t, i_h, i_d, i_s)]
        fluid.update(CoolProp.PQ_INPUTS, p, 1.0)
        h_g, r_g, s_g = fluid.hmass(), fluid.rhomass(), fluid.smass()
        g_p = [fluid.first_saturation_deriv(of, i_p) for of in (i_h, i_d, i_s)]
        ln_p = float(np.log(p))
        return Saturation(t, h_f, h_g, r_f, r_g, s_f, s_g, f_p[0], f_p[1], g_p[0], f_p[2], g_p[1], f_p[3], g_p[2], ln_p)

    def single_phase(p: float, h: float, edge: float, quality: float) -> tuple[float, float, float, float]:
        if abs(h - edge) < 1.0e-6:
            fluid.update(CoolProp.PQ_INPUTS, p, quality)
            fluid.specify_phase(CoolProp.iphase_gas if quality else CoolProp.iphase_liquid)
            fluid.update(CoolProp.DmassT_INPUTS, fluid.rhomass(), fluid.T())
        else:
            fluid.update(CoolProp.HmassP_INPUTS, h, p)
        result = (
            fluid.rhomass(), fluid.first_partial_deriv(i_d, i_p, i_h), fluid.first_partial_deriv(i_d, i_h, i_p),
            fluid.T(),
        )  # fmt: skip
        fluid.unspecify_phase()
        return result

    def vapour(_tab: Tables, p: float, _lnp: float, h: float, h_g: float, _h_g_p: float) -> tuple[float, ...]:
        return single_phase(p, h, h_g, 1.0)

    def liquid(_tab: Tables, p: float, _lnp: float, h: float, h_f: float, _h_f_p: float) -> tuple[float, ...]:
        return single_phase(p, h, h_f, 0.0)

    def vapour_entropy(_tab: Tables, p: float, _lnp: float, h: float, _h_g: float, _h_g_p: float) -> tuple[float, ...]:
        fluid.update(CoolProp.HmassP_INPUTS, h, p)
        return fluid.smass(), -1.0 / (fluid.rhomass() * fluid.T()), 1.0 / fluid.T()

    def isentrope(
        _tab: Tables, p: float, _lnp: float, s: float, h_g: float, h_g_p: float, s_g: float, s_g_p: float, t_sat: float
    ) -> tuple[float, ...]:
        if s < s_g:
            return h_g + t_sat * (s - s_g), h_g_p - t_sat * s_g_p, t_sat
        fluid.update(CoolProp.PSmass_INPUTS, p, s)
        return fluid.hmass(), 1.0 / fluid.rhomass(), fluid.T()

    return {
        "saturation": saturation, "vapour": vapour, "vapour_entropy": vapour_entropy, "isentrope": isentrope,
        "liquid": liquid, "humidity_ratio": humidity_ratio,
    }  # fmt: skip
