"""Faults and noise between plant and loop: f_p and noise on the measurements, f_N on the command.

The superheat is measured by itself (the paper), or, as in a car, derived from an outlet thermocouple and the pressure
that is *measured*: `SH = T_out - T_sat(p_e)`, so what is wrong with the pressure is wrong with the superheat as well.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

_TICKS_AT_ONCE = 200


class FaultInjector:
    """Adds what goes wrong; without faults and noise it passes every number on bit for bit.

    Parameters
    ----------
    noise_std : sequence of float, length 3
        Standard deviations of the Gaussian noise on evaporator pressure [Pa], superheat [K], wall temperature [K].
        With a derived superheat, the second one is that of the thermocouple.
    seed : int
        Of the noise; the same seed gives the same noise.
    superheat : str
        "direct" or "derived".

    Raises
    ------
    ValueError
        For a negative noise, or another sensor of the superheat.
    """

    def __init__(
        self, noise_std: Sequence[float] | Vector = (0.0, 0.0, 0.0), seed: int = 0, superheat: str = "direct"
    ) -> None:
        if superheat not in ("direct", "derived"):
            msg = f"superheat sensor {superheat!r}; allowed: direct or derived"
            raise ValueError(msg)
        self._derived = superheat == "derived"
        if self._derived:
            from ac_plant_node.saturation import saturation_temperature  # loads the property tables

            self._saturation_temperature = saturation_temperature
        std = np.asarray(noise_std, dtype=np.float64)
        if std.shape != (3,) or not np.all(std >= 0.0):
            msg = f"noise_std is {list(noise_std)}; allowed: three numbers, none negative"
            raise ValueError(msg)
        self._noise = _noise(std, seed) if np.any(std > 0.0) else None

    def measure(self, actual: Vector, f_p: float) -> Vector:
        """Measurement of this tick.

        Parameters
        ----------
        actual : ndarray, shape (3,)
            Evaporator pressure [Pa], superheat [K], wall temperature [degC] as they are.
        f_p : float
            Fault of the pressure sensor [Pa].

        Returns
        -------
        ndarray, shape (3,)
            As `actual`, with f_p on the pressure and noise on all three.
        """
        measured: Vector = actual.copy() if self._noise is None else actual + next(self._noise)
        measured[0] += f_p
        if self._derived:
            measured[1] += self._saturation_temperature(actual[0]) - self._saturation_temperature(measured[0])
        return measured

    def actuate(self, command: Vector, f_n: float) -> Vector:
        """Command that reaches the plant: f_N [rad/s] added to the compressor speed, never below standstill.

        Parameters
        ----------
        command : ndarray, shape (2,)
            Compressor speed [rad/s], valve opening [0..1].
        f_n : float

        Returns
        -------
        ndarray, shape (2,)
        """
        actuator: Vector = command.copy()
        actuator[0] = max(actuator[0] + f_n, 0.0)
        return actuator


def _noise(std: Vector, seed: int) -> Iterator[Vector]:
    """Noise of one tick after the other; drawn for many at once, which is the same noise for less time."""
    random = np.random.default_rng(seed)
    while True:
        yield from std * random.standard_normal((_TICKS_AT_ONCE, 3))
