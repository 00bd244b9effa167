"""What the right-hand side is driven by: inputs and faults, and what follows from them alone, as one flat array.

Inputs are held from one command to the next, so air-side conductances, humidity and faulty efficiencies are worked out
once for a hold and not at each evaluation of the right-hand side.

Air side: effectiveness-NTU with one fluid isothermal, ``G = m c_p (1 - exp(-NTU))``, ``NTU = UA/(m c_p)``, ``UA ~
m^0.5`` for both heat exchangers (Chang & Wang, Int. J. Heat Mass Transfer 40 (1997) 533: the Colburn factor of louvred
fins goes with the -0.49 power of the air speed). Humid air has ``c_p + W c_v`` in place of ``c_p``.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ac_plant_node.dynamics.moist_air import (
    CP_VAPOUR_J_KGK,
    enthalpy,
    humidity_ratio,
    temperature,
)
from ac_plant_node.inputs import FAULT, INPUT, INPUT_LOW, N_HELD, N_INPUTS, N_PHYSICS
from ac_plant_node.parameters.values import INDEX, Parameters
from ac_plant_node.properties.compiled import Array, jit

SPEED, OPENING, AIR, AIR_C = (
    INPUT["compressor_speed"],
    INPUT["valve_opening"],
    INPUT["air_mass_flow"],
    INPUT["air_inlet_temperature"],
)
_C_AIR, _C_AIR_C = INPUT["condenser_air_mass_flow"], INPUT["condenser_air_inlet_temperature"]
_HUMIDITY = INPUT["air_humidity"]
_OFFSET, _DISPLACEMENT, _EFFICIENCY, LEAK = (
    N_INPUTS + FAULT[kind]
    for kind in ("valve_offset", "compressor_displacement", "isentropic_efficiency", "refrigerant_leak")
)
_C_FOULED, _C_FAN, _E_FOULED = (
    N_INPUTS + FAULT[kind] for kind in ("condenser_fouling", "condenser_fan", "evaporator_fouling")
)
VALVE, V_D, ETA_S, T_AIR_E, T_AIR_C, G_E, G_C, RATIO, HALF_E, SPREAD_1, SPREAD_2 = range(N_HELD, N_HELD + 11)
"""What follows: true opening of the valve, displacement m3, isentropic efficiency, air at the inlets K, air-side
conductances W/K; of humid air its humidity ratio at the evaporator's inlet, exp(-NTU/2), and tanh(N/4) of both zones
(see `ac_plant_node.dynamics.moist_air`)."""
N_DRIVE = N_HELD + 11

_EUA, _EMA, _EXP = INDEX["evaporator_air_ua_w_k"], INDEX["evaporator_air_nominal_kg_s"], INDEX["air_ua_exponent"]
_CUA, _CMA, _CP = INDEX["condenser_air_ua_w_k"], INDEX["condenser_air_kg_s"], INDEX["air_cp_j_kgk"]
_VD, _ETAS = INDEX["displacement_m3_rev"], INDEX["isentropic_efficiency"]
_AE, _ETP = INDEX["evaporator_inner_area_m2"], INDEX["evaporator_two_phase_w_m2k"]
_ESH = INDEX["evaporator_superheated_w_m2k"]
_C_AIR_LEAST = float(INPUT_LOW[_C_AIR])  # what wind and warmth still move when the fan is dead


@jit
def set_drive(held: Array, par: Array, w: Array) -> None:
    """Work out the array `w` (N_DRIVE,) of the inputs and faults `held` (N_HELD,)."""
    for i in range(N_HELD):
        w[i] = held[i]
    w[VALVE] = min(max(w[OPENING] + w[_OFFSET], 0.0), 1.0)
    w[V_D] = par[_VD] * (1.0 - w[_DISPLACEMENT])
    w[ETA_S] = par[_ETAS] * (1.0 - w[_EFFICIENCY])
    w[T_AIR_E], w[T_AIR_C] = w[AIR_C] + 273.15, w[_C_AIR_C] + 273.15
    w[RATIO] = humidity_ratio(w[AIR_C], w[_HUMIDITY]) if w[_HUMIDITY] > 0.0 else 0.0
    air = max(w[AIR], 1.0e-6)
    flow = air * (par[_CP] + w[RATIO] * CP_VAPOUR_J_KGK)
    ua = par[_EUA] * (1.0 - w[_E_FOULED]) * (air / par[_EMA]) ** par[_EXP]
    w[G_E] = flow * (1.0 - math.exp(-ua / flow))
    if w[RATIO] > 0.0:
        w[HALF_E] = math.exp(-0.5 * ua / flow)
        w[SPREAD_1] = math.tanh(0.25 * ua / flow / (1.0 + ua / (par[_AE] * par[_ETP])))
        w[SPREAD_2] = math.tanh(0.25 * ua / flow / (1.0 + ua / (par[_AE] * par[_ESH])))
    air = max(w[_C_AIR] * (1.0 - w[_C_FAN]), _C_AIR_LEAST)
    flow = air * par[_CP]
    w[G_C] = flow * (1.0 - math.exp(-par[_CUA] * (1.0 - w[_C_FOULED]) * (air / par[_CMA]) ** par[_EXP] / flow))


@jit
def outlet_air(w: Array, par: Array, heat: float, water: float, drained: float) -> tuple[float, float]:
    """Return temperature (degC) and humidity ratio of the air behind the evaporator, by its balances.

    `heat` (W) is what the air has given to the wall, `water` (kg/s) and `drained` (W) what has run off and the enthalpy
    of it.
    """
    ratio = w[RATIO] - water / w[AIR]
    return temperature(enthalpy(w[AIR_C], w[RATIO], par[_CP]) - (heat + drained) / w[AIR], ratio, par[_CP]), ratio


def default_held(parameters: Parameters) -> NDArray[np.float64]:
    """Return inputs and faults (N_HELD,) of a healthy plant; the paper's four inputs in it are zero."""
    held = np.zeros(N_HELD)
    held[_C_AIR], held[_C_AIR_C] = parameters["condenser_air_kg_s"], parameters["condenser_air_inlet_k"] - 273.15
    return held


def held_inputs(
    inputs: NDArray[np.float64], parameters: Parameters, faults: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Return inputs and faults (N_HELD,) as `drive` takes them, with the parameters' own for those left out."""
    held = default_held(parameters)
    held[: len(inputs)] = inputs
    if faults is not None:
        held[N_INPUTS:] = faults[:N_PHYSICS]
    return held


def drive(
    inputs: NDArray[np.float64], parameters: Parameters, faults: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Return the array (N_DRIVE,) that `rhs` takes.

    Parameters
    ----------
    inputs : (n,) array, n from 4 to N_INPUTS
        In the order of `ac_plant_node.inputs.INPUTS`; those left out are the parameters' own (dry air).
    parameters : Parameters
    faults : (N_FAULTS,) array, optional
        SI, in the order of `ac_plant_node.inputs.FAULTS`; none by default.
    """
    w = np.zeros(N_DRIVE)
    set_drive(held_inputs(inputs, parameters, faults), parameters.values, w)
    return w
