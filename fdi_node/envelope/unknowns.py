"""What is estimated beside the plant's states: one table of faults, air flows, and what looks like a fault.

Each unknown acts at one place of the model: on one of the plant's inputs, on one reading, or on a parameter. Its row
says how fast it may wander, how uncertain it is when the observer begins, and whether the decision may explain what is
seen by a jump of it. A further unknown is a further row.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ac_common.faults import ISOLABLE_KINDS, UNKNOWN
from ac_common.units import KPA, RPM
from ac_plant_node.inputs import INPUT
from ac_plant_node.parameters.values import INDEX


class Place(IntEnum):
    """Where an unknown acts."""

    FACTOR = 0
    """an input of the plant is ``exp(value)`` times what it is taken for"""
    ADDED = 1
    """it is added to an input of the plant"""
    READING = 2
    """it is added to a reading: p_e, SH, T_w, p_c"""
    PARAMETER = 3
    """a parameter of the plant is ``exp(value)`` times what the design says"""


class Unknown(NamedTuple):
    """One unknown.

    Attributes
    ----------
    name : str
    place : Place
    position : int
        Of the input, reading or parameter.
    scale : float
        Its size, for covariances without units; its unit is that of what it acts on (1 for a factor).
    first : float
        Standard deviation when the observer begins.
    drift : float
        Intensity of its random walk, per sqrt(s).
    limits : tuple of float
        What it can be.
    jump : float
        Standard deviation of its jumps, or `STUCK`.
    reported : str
        What a jump of it is isolated as; `NATURAL`: nothing, jumps of it are no fault; empty: no jump is looked for.
    drift_after : float
        Intensity of its random walk once its fault is isolated.
    rate : float
        Standard deviation, per second, of the rate at which it may grow from some time on; 0: that is not looked for.
    """

    name: str
    place: Place
    position: int
    scale: float
    first: float
    drift: float
    limits: tuple[float, float]
    jump: float = 0.0
    reported: str = ""
    drift_after: float = 0.0
    rate: float = 0.0


NATURAL = "natural"
STUCK = 0.0
"""In place of the size of a jump: since it, the input has stayed where it was."""

_SPEED, _PRESSURE = ISOLABLE_KINDS
_KELVIN, _HEAD = (-30.0, 30.0), (-500.0 * KPA, 500.0 * KPA)
_N = INPUT["compressor_speed"]
_AIR, _FAN, _AIR_C = (INPUT[name] for name in ("air_mass_flow", "condenser_air_mass_flow", "air_inlet_temperature"))

UNKNOWNS = (
    Unknown(
        _SPEED,
        Place.ADDED,
        INPUT["compressor_speed"],
        40.0 * RPM,
        0.3 * RPM,
        0.01 * RPM,
        (-400.0 * RPM, 400.0 * RPM),
        80.0 * RPM,
        _SPEED,
        0.3 * RPM,
        0.5 * RPM,
    ),
    Unknown(
        _PRESSURE,
        Place.READING,
        0,
        KPA,
        0.02 * KPA,
        5.0e-4 * KPA,
        (-60.0 * KPA, 60.0 * KPA),
        1.6 * KPA,  # what jumps by much more has its name in that tick: `filter.READING_JUMP`
        _PRESSURE,
        0.02 * KPA,
        0.05 * KPA,
    ),
    Unknown("evaporator_air_flow", Place.FACTOR, _AIR, 0.1, 0.1, 0.02, (-1.5, 1.0), 0.4, NATURAL),
    Unknown("condenser_air_flow", Place.FACTOR, _FAN, 0.1, 0.1, 0.06, (-1.6, 1.0), 0.4, NATURAL),
    Unknown("superheat_sensor", Place.READING, 1, 1.0, 0.0, 0.0, _KELVIN, 5.0, UNKNOWN, 0.01),
    Unknown("wall_temperature_sensor", Place.READING, 2, 1.0, 0.0, 0.0, _KELVIN, 5.0, UNKNOWN, 0.01),
    Unknown("condenser_pressure_sensor", Place.READING, 3, 10.0 * KPA, 0.0, 0.0, _HEAD, 50.0 * KPA, UNKNOWN, 0.1 * KPA),
    Unknown("air_inlet_sensor", Place.ADDED, _AIR_C, 1.0, 0.0, 0.0, _KELVIN, 5.0, UNKNOWN, 0.01),
    Unknown("valve_stuck", Place.ADDED, INPUT["valve_opening"], 0.01, 0.0, 0.0, (-1.0, 1.0), STUCK, UNKNOWN),
)
"""The faults of `ac_common.faults.ISOLABLE` first, in their order; both air flows; and other faults that must not be
taken for these."""

_UNCERTAIN = (
    ("charge_kg", 0.05), ("evaporator_air_ua_w_k", 0.05), ("evaporator_two_phase_w_m2k", 0.10),
    ("evaporator_superheated_w_m2k", 0.10), ("condenser_air_ua_w_k", 0.05), ("displacement_m3_rev", 0.02),
    ("valve_discharge_coefficient", 0.03), ("isentropic_efficiency", 0.04),
)  # fmt: skip

UNCERTAIN = tuple(
    Unknown(name, Place.PARAMETER, INDEX[name], sigma, sigma, 0.01 * sigma, (-5.0 * sigma, 5.0 * sigma))
    for name, sigma in _UNCERTAIN
)
"""Parameters of the plant that may be off, with the standard deviation of each. They may wander a little: as constants
they would soon be believed more than a linearised filter can know them."""

_TOLD = ("evaporator_superheated_w_m2k", "displacement_m3_rev", "valve_discharge_coefficient")
PARAMETERS = tuple(one for one in UNCERTAIN if one.name in _TOLD)
"""Those that are estimated. The others look like the air flows of the heat exchangers, or like hardly anything: they
need no estimate, and a linearised filter would come to believe in a charge that is two standard deviations off."""


def table(unknowns: tuple[Unknown, ...]) -> NDArray[np.float64]:
    """Return the rows as the compiled code takes them, (m, 5): place, position, scale, lowest, highest."""
    rows = [(u.place, u.position, u.scale, *u.limits) for u in unknowns]
    return np.array(rows, dtype=np.float64)
