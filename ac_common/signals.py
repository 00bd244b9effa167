"""Named signals: what is measured, commanded and followed, in place of bare arrays by position.

The names of the fields are the last parts of the topics that carry them: ``Measurement.superheat`` travels on
``measured/superheat``. All values are SI; temperatures of air and wall are in degC.
"""

import math
from typing import NamedTuple


class Measurement(NamedTuple):
    """Readings of the sensors at one tick: ``measured/...``; the designs use those that have an `Innovation`."""

    evaporator_pressure: float
    """Pa"""
    superheat: float
    """K"""
    wall_temperature: float
    """degC"""
    condenser_pressure: float = math.nan
    """Pa"""


class PlantOutput(NamedTuple):
    """The same as they are: ``plant/...``."""

    evaporator_pressure: float
    """Pa"""
    superheat: float
    """K"""
    wall_temperature: float
    """degC"""
    condenser_pressure: float
    """Pa"""


class Performance(NamedTuple):
    """What the plant makes of it, for evaluation only: its series are `ac_common.topics.PERFORMANCE_SERIES`."""

    cooling: float
    """all the heat that the air gives to the evaporator, W"""
    latent_cooling: float
    """the part of it that water brings which condenses, W"""
    condensed_water: float
    """kg/s"""
    frost: float
    """the part of that water which falls on walls below 0 degC, kg/s"""
    compressor_power: float
    """W"""
    vent_temperature: float
    """of the air behind the evaporator, degC"""
    subcooling: float
    """K"""


class Innovation(NamedTuple):
    """The innovation f_e = N~ u - M~ y of each reading: ``fdi/innovation/...``."""

    evaporator_pressure: float
    """Pa"""
    superheat: float
    """K"""
    wall_temperature: float
    """K"""


class Inlets(NamedTuple):
    """Air into both heat exchangers, measured disturbances: on ``plant/...`` as it is, on ``measured/...`` as read."""

    air_inlet_temperature: float
    """degC"""
    condenser_air_inlet_temperature: float
    """degC"""


class Command(NamedTuple):
    """What the actuators are told: the joints of ``controller/command``."""

    compressor: float
    """rad/s"""
    expansion_valve: float
    """0..1"""


class Reference(NamedTuple):
    """What the controlled outputs are to be: ``reference/...``."""

    evaporator_pressure: float
    """Pa"""
    superheat: float
    """K"""


class AirSide(NamedTuple):
    """Air at the inlets of both heat exchangers, on the topics `ac_common.topics.AIR_SIDE`; inputs of the plant."""

    mass_flow: float
    """through the evaporator, kg/s"""
    inlet_temperature: float
    """degC"""
    condenser_mass_flow: float
    """kg/s"""
    condenser_inlet_temperature: float
    """degC"""
    humidity: float
    """relative, at the evaporator's inlet, 0..1"""


class CarSide(NamedTuple):
    """What a car does to the air conditioner beside the air of `AirSide`: the joints of ``scenario/car``."""

    vehicle_speed: float
    """m/s"""
    sun: float
    """W/m2"""
    people: float
    recirculation: float
    """share of cabin air in what the evaporator breathes, 0..1"""
    belt_speed: float
    """of the compressor on the belt, rad/s; 0 when it is electric"""


class Cabin(NamedTuple):
    """What comes of it, for evaluation only: the joints of ``plant/car``."""

    cabin_air: float
    """degC"""
    cabin_interior: float
    """degC"""
    evaporator_humidity: float
    """relative, of the air into the evaporator, 0..1"""
    condenser_air: float
    """air flow through the condenser, kg/s"""


READINGS: tuple[str, ...] = (*Measurement._fields, *Inlets._fields)
"""All that sensors read: signals of ``measured/...``, in the order of every array of them."""

Signal = Measurement | Inlets | PlantOutput | Innovation | Command | Reference | AirSide


def topics_of(prefix: str, signal: type[Signal]) -> tuple[str, ...]:
    """Return the topics that carry the fields of a signal, in their order: ``prefix/field``."""
    return tuple(f"{prefix}/{name}" for name in signal._fields)
