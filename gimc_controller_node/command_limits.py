"""What compressor and valve can do, in the units of the people."""

from dataclasses import dataclass


@dataclass(frozen=True)
class CommandLimits:
    """What compressor and valve can do.

    Attributes
    ----------
    low, high : tuple of float
        Least and largest compressor speed [rpm] and valve opening [%].
    rate : tuple of float
        Fastest change, up and down: compressor [rpm/s], valve [%/s]. The defaults are those of an electric scroll
        compressor, which its inverter takes from standstill to full speed in six seconds, and of a stepper-motor
        valve with a stroke of four seconds (some 500 steps at 125 a second).
    """

    low: tuple[float, float] = (0.0, 0.0)
    high: tuple[float, float] = (6000.0, 100.0)
    rate: tuple[float, float] = (1000.0, 25.0)
