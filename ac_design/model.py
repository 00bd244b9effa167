"""The linear plant of all designs: which inputs are commands, disturbances and faults, and in which units.

All designs use *design units*, in which 1 is a typical excursion, so that H-infinity norms compare rpm and pascals as
an engineer would. `to_si` converts a filter to SI units.
"""

from dataclasses import dataclass
from typing import get_args

import control
import numpy as np
from numpy.typing import NDArray

from ac_common.units import KPA, RPM
from ac_design.weights import FdiWeights, SuperheatSensor
from ac_plant_node import linearize, operating_point
from ac_plant_node.saturation import saturation_slope
from gimc.structure import FaultySystem

Matrix = NDArray[np.float64]

COMMAND_UNIT = np.array([100.0 * RPM, 0.05])
"""Design units of the commands: 100 rpm, 5 % of valve opening."""

OUTPUT_UNIT = np.array([5.0 * KPA, 2.5, 2.5])
"""Design units of p_e, SH and T_w: 5 kPa and 2.5 K (the paper's manoeuvre), 2.5 K."""

FAULT_UNIT = np.array([40.0 * RPM, 5.0 * KPA])
"""Design units of f_N and f_p: the paper's faults, 40 rpm and 5 kPa."""

AIR_FLOW_UNIT = 0.1
"""Design unit of the unknown disturbance: this part of the operating point's air mass flow."""

AIR_TEMPERATURE_UNIT = 2.0
"""Design unit of the measured disturbance, the air inlet temperature [K]."""


@dataclass(frozen=True)
class DesignModel:
    """Plant of one operating point in design units.

    Attributes
    ----------
    point : str
    system : FaultySystem
        Commands [N, alpha], unknown disturbance [m_ea], faults [f_N, f_p], outputs [p_e, SH, T_w].
    B_air : ndarray, shape (n, 1)
        Input column of the measured disturbance, the air inlet temperature.
    """

    point: str
    system: FaultySystem
    B_air: Matrix


def design_model(point: str, superheat: SuperheatSensor = "direct") -> DesignModel:
    """Return the linear plant at "low", "med" or "high", scaled to design units.

    With the superheat measured directly (the paper's sensor model) f_p enters the reading of p_e alone; derived from
    the measured pressure, it enters the superheat's, too, by `-dT_sat/dp f_p`.

    Raises
    ------
    ValueError
        For an unknown operating point or an unknown sensor of the superheat.
    """
    readings = pressure_in_readings(point, superheat) * FAULT_UNIT[1] / OUTPUT_UNIT
    plant = linearize(point)
    air_flow = operating_point(point).inputs[2]
    unit_in = np.concatenate([COMMAND_UNIT, [AIR_FLOW_UNIT * air_flow, AIR_TEMPERATURE_UNIT]])
    A, C = plant.A, plant.C / OUTPUT_UNIT[:, None]
    B = plant.B * unit_in
    if np.any(plant.D):
        raise ValueError(f"the linear plant at {point!r} has a direct feedthrough, which the designs do not expect")
    fault_speed = plant.B[:, [0]] * FAULT_UNIT[0]
    system = FaultySystem(
        A=A,
        B=B[:, :2],
        C=C,
        D=np.zeros((3, 2)),
        E1=B[:, [2]],
        E2=np.zeros((3, 1)),
        F1=np.hstack([fault_speed, np.zeros_like(fault_speed)]),
        F2=np.column_stack([np.zeros(3), readings]),
    )
    return DesignModel(point, system, B[:, [3]])


def pressure_in_readings(point: str, superheat: SuperheatSensor) -> Matrix:
    """Return what f_p = 1 Pa adds to the readings of p_e [Pa], SH [K] and T_w [K], shape (3,).

    Raises
    ------
    ValueError
        For an unknown sensor of the superheat.
    """
    if superheat not in get_args(SuperheatSensor):
        raise ValueError(f"superheat sensor {superheat!r}; allowed: {' or '.join(get_args(SuperheatSensor))}")
    slope = saturation_slope(operating_point(point).outputs[0]) if superheat == "derived" else 0.0
    return np.array([1.0, -slope, 0.0])


def sensor_noise(point: str, weights: FdiWeights) -> Matrix:
    """Return a factor S of the covariance `S S'` of the readings' noise, shape (3, 3), SI.

    The noise of p_e also enters a derived superheat.
    """
    noise = np.diag(weights.sensor_noise)
    noise[:, 0] = weights.sensor_noise[0] * pressure_in_readings(point, weights.superheat)
    return noise


def to_si(filter_: control.StateSpace, input_unit: Matrix, output_unit: Matrix) -> control.StateSpace:
    """Return a filter in SI units from one in design units, the units of its inputs and outputs given in SI."""
    return control.ss(
        filter_.A,
        filter_.B / input_unit,
        filter_.C * output_unit[:, None],
        filter_.D * output_unit[:, None] / input_unit,
    )
