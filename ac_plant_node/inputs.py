"""What drives the plant from outside, as two ordered tables: its inputs, and the faults of its components.

The compiled code takes both as one flat array, inputs first, in SI units (temperatures in degC, shares as 0..1). A
further input or fault is a further row here, and its physics in `ac_plant_node.dynamics.drive`.
"""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ac_common.errors import UserError
from ac_common.units import RPM

TO_SI: dict[str, Callable[[float], float]] = {
    "rpm": lambda value: value * RPM,
    "percent": lambda value: value / 100.0,
    "kg_s": lambda value: value,
    "kg_h": lambda value: value / 3600.0,
    "c": lambda value: value,
    "s": lambda value: value,
    "flag": lambda value: value,
}
"""From a unit of the tables below to the one of the arrays."""


class Input(NamedTuple):
    """One input: name, unit of the keyword of `Plant.advance`, range and step for differences in SI, meaning."""

    name: str
    unit: str
    low: float
    high: float
    step: float
    meaning: str

    @property
    def keyword(self) -> str:
        """The keyword of `Plant.advance`."""
        return f"{self.name}_{self.unit}"


class Fault(NamedTuple):
    """One fault of a component: kind, unit of its size, range of its size in SI, step for differences, meaning."""

    kind: str
    unit: str
    low: float
    high: float
    step: float
    meaning: str


INPUTS = (
    Input("compressor_speed", "rpm", 0.0, 6000.0 * math.pi / 30.0, 1.0e-2, "compressor speed, rad/s"),
    Input("valve_opening", "percent", 0.0, 1.0, 1.0e-4, "opening of the expansion valve, 0..1"),
    Input("air_mass_flow", "kg_s", 0.02, 0.3, 1.0e-5, "dry air through the evaporator, kg/s"),
    Input("air_inlet_temperature", "c", 10.0, 65.0, 1.0e-2, "air at the evaporator's inlet, degC"),
    Input("condenser_air_mass_flow", "kg_s", 0.1, 1.5, 1.0e-5, "air through the condenser, kg/s"),
    Input("condenser_air_inlet_temperature", "c", 0.0, 50.0, 1.0e-2, "air at the condenser's inlet, degC"),
    Input("air_humidity", "percent", 0.0, 1.0, 1.0e-4, "relative humidity at the evaporator's inlet, 0..1"),
)
"""The inputs in the order of the arrays; the first four are the paper's."""

FAULTS = (
    Fault("valve_offset", "percent", -1.0, 1.0, 1.0e-4, "opening that the valve has beyond its command"),
    Fault("compressor_displacement", "percent", 0.0, 1.0, 1.0e-4, "share of the displacement that is lost"),
    Fault("isentropic_efficiency", "percent", 0.0, 0.5, 1.0e-4, "share of the isentropic efficiency that is lost"),
    Fault("refrigerant_leak", "kg_h", 0.0, 5.0 / 3600.0, 1.0e-6, "refrigerant that leaves behind the condenser, kg/s"),
    Fault("condenser_fouling", "percent", 0.0, 1.0, 1.0e-4, "share of the condenser's air-side UA that is lost"),
    Fault("condenser_fan", "percent", 0.0, 1.0, 1.0e-4, "share of the condenser's air flow that is lost"),
    Fault("evaporator_fouling", "percent", 0.0, 1.0, 1.0e-4, "share of the evaporator's air-side UA that is lost"),
    Fault("valve_stuck", "flag", 0.0, 1.0, 0.0, "1: the valve stays where it is"),
    Fault("valve_slow", "s", 0.0, 60.0, 0.0, "time constant of a valve that moves slowly"),
)
"""The faults in the order of the arrays, all zero in a healthy plant. `N_PHYSICS` act on the balances, the rest on
the valve's actuator (`ac_plant_node.valve_actuator`)."""

N_INPUTS, N_FAULTS, N_PAPER = len(INPUTS), len(FAULTS), 4
N_PHYSICS = N_FAULTS - 2
N_HELD = N_INPUTS + N_PHYSICS
"""Length of the array that the compiled code holds: inputs, then the faults that act on the balances."""

INPUT_NAMES = tuple(row.name for row in INPUTS)
FAULT_KINDS = tuple(row.kind for row in FAULTS)
INPUT_LOW = np.array([row.low for row in INPUTS])
"""Lowest inputs, (N_INPUTS,)."""
INPUT_HIGH = np.array([row.high for row in INPUTS])
"""Highest inputs, (N_INPUTS,)."""
FAULT_LOW = np.array([row.low for row in FAULTS])
"""Smallest sizes of the faults, (N_FAULTS,)."""
FAULT_HIGH = np.array([row.high for row in FAULTS])
"""Largest sizes of the faults, (N_FAULTS,)."""
HELD_LOW = np.concatenate([INPUT_LOW, FAULT_LOW[:N_PHYSICS]])
HELD_HIGH = np.concatenate([INPUT_HIGH, FAULT_HIGH[:N_PHYSICS]])

INPUT = {name: i for i, name in enumerate(INPUT_NAMES)}
"""Position of each input in the arrays."""
FAULT = {kind: i for i, kind in enumerate(FAULT_KINDS)}
"""Position of each fault in an array of faults."""


def fault_vector(sizes: Mapping[str, float]) -> NDArray[np.float64]:
    """Return the array (N_FAULTS,) of faults, SI, for sizes in the units of `FAULTS`; those left out are zero.

    Raises
    ------
    UserError
        One line: a kind that is not known, or a size outside its range.
    """
    faults = np.zeros(N_FAULTS)
    for kind, size in sizes.items():
        if kind not in FAULT:
            raise UserError(f"unknown fault {kind!r} of the plant: allowed are {', '.join(FAULT_KINDS)}")
        row = FAULTS[FAULT[kind]]
        si = TO_SI[row.unit](float(size))
        if not row.low <= si <= row.high:
            scale = TO_SI[row.unit](1.0)
            raise UserError(
                f"fault {kind}: size {size:g} is outside {row.low / scale:g} to {row.high / scale:g} {row.unit}"
            )
        faults[FAULT[kind]] = si
    return faults
