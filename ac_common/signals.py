"""Named signals: what is measured, commanded and followed, in place of bare arrays by position.

The names of the fields are the last parts of the topics that carry them: ``Measurement.superheat`` travels on
``measured/superheat``. All values are SI; temperatures of air and wall are in degC.
"""

from typing import NamedTuple


class Measurement(NamedTuple):
    """Readings of the sensors at one tick: ``measured/...``."""

    evaporator_pressure: float
    """Pa"""
    superheat: float
    """K"""
    wall_temperature: float
    """degC"""


class PlantOutput(NamedTuple):
    """The same as they are, and what is not measured: ``plant/...``."""

    evaporator_pressure: float
    """Pa"""
    superheat: float
    """K"""
    wall_temperature: float
    """degC"""
    condenser_pressure: float
    """Pa"""


class Innovation(NamedTuple):
    """The innovation f_e = N~ u - M~ y of each reading: ``fdi/innovation/...``."""

    evaporator_pressure: float
    """Pa"""
    superheat: float
    """K"""
    wall_temperature: float
    """K"""


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
    """Air at the evaporator's inlet: ``scenario/air`` and ``scenario/air_inlet_temperature``."""

    mass_flow: float
    """kg/s"""
    inlet_temperature: float
    """degC"""


Signal = Measurement | PlantOutput | Innovation | Command | Reference | AirSide


def topics_of(prefix: str, signal: type[Signal]) -> tuple[str, ...]:
    """Return the topics that carry the fields of a signal, in their order: ``prefix/field``."""
    return tuple(f"{prefix}/{name}" for name in signal._fields)
