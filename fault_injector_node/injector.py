"""Faults and noise between plant and loop: sensor faults and noise on the readings, actuator faults on the command.

    actual  -> [+ noise] -> [+ sensor faults] -> [unless it stands still] -> [derived superheat] -> measured
    command -> [+ actuator faults] -> [not below zero] -> actuator
    components' faults -> [within their limits] -> plant

The superheat is measured by itself (the paper), or, as in a car, derived from an outlet thermocouple and the pressure
that is *measured*: `SH = T_out - T_sat(p_e)`, so what is wrong with the pressure is wrong with the superheat as well.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ac_common.faults import FAULTS, STICKING, Place, faults_at
from ac_common.signals import READINGS, Command, Inlets, Measurement

Vector = NDArray[np.float64]

_TICKS_AT_ONCE = 200
_COMPONENTS = tuple(
    (number, fault.lowest_si, fault.largest_si) for number, fault in enumerate(FAULTS) if fault.place is Place.PLANT
)
#: Of each of `STICKING`: its number in `FAULTS`, and its place among the readings, of which those of air come last.
STICKING_FAULTS = tuple((FAULTS.index(fault), fault.index) for fault in STICKING)
_N_MEASURED = len(Measurement._fields)
_NOTHING_HELD = (math.nan,) * len(READINGS)
ACTUATOR_FAULTS = faults_at(Place.ACTUATOR)
SENSOR_FAULTS = tuple((fault, reading) for fault, reading in faults_at(Place.SENSOR) if reading < _N_MEASURED)
INLET_FAULTS = tuple(fault for fault, reading in faults_at(Place.SENSOR) if reading >= _N_MEASURED)


class FaultInjector:
    """Adds what goes wrong; without faults and noise it passes every number on bit for bit.

    Parameters
    ----------
    noise_std : sequence of float, length 3 or 4
        Standard deviations of the Gaussian noise on evaporator pressure [Pa], superheat [K], wall temperature [K] and
        condenser pressure [Pa], which has a random sequence of its own. With a derived superheat, the second one is
        that of the thermocouple.
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
        self, noise_std: Sequence[float] | Vector = (0.0, 0.0, 0.0, 0.0), seed: int = 0, superheat: str = "direct"
    ) -> None:
        if superheat not in ("direct", "derived"):
            msg = f"superheat sensor {superheat!r}; allowed: direct or derived"
            raise ValueError(msg)
        self.is_derived = superheat == "derived"
        if self.is_derived:
            from ac_plant_node.saturation import saturation_temperature  # loads the property tables

            self._saturation_temperature = saturation_temperature
        std = np.asarray(noise_std, dtype=np.float64)
        self._std, self._seed = std, seed
        if std.shape not in ((3,), (4,)) or not np.all(std >= 0.0):
            msg = f"noise_std is {list(noise_std)}; allowed: three or four numbers, none negative"
            raise ValueError(msg)
        self._noise = _noise(std[:3], [seed]) if np.any(std[:3] > 0.0) else None
        self._high_side_noise = _noise(std[3:], [seed, 1]) if np.any(std[3:] > 0.0) else None
        self._held: Sequence[float] = _NOTHING_HELD  # readings that stand still; nan: it does not
        self._last = list(_NOTHING_HELD)  # readings of the tick before, of a derived superheat the thermocouple's

    def noise(self, ticks: int) -> Vector:
        """Return the noise that `measure` adds in the first ticks, all at once: (ticks, 4) [Pa, K, K, Pa]."""
        drawn = np.zeros((ticks, _N_MEASURED))
        parts = (self._std[:3], [self._seed], drawn[:, :3]), (self._std[3:], [self._seed, 1], drawn[:, 3:])
        for std, seed, to in parts:
            if np.any(std > 0.0):
                to[:] = std * np.random.default_rng(seed).standard_normal((ticks, len(std)))
        return drawn

    def stick(
        self, actual: Sequence[float], inlets: Sequence[float], faults: Sequence[float], stuck: Sequence[float]
    ) -> Sequence[float]:
        """Return the faults of this tick with what the readings that stand still are off by; to be called first.

        Such a reading stays what it was in the tick before, noise and other faults included: `measure` and
        `measure_inlets` give it again bit for bit.

        Parameters
        ----------
        actual, inlets, faults : sequence of float
            As in `measure` and `measure_inlets`.
        stuck : sequence of float
            Of each of `ac_common.faults.STICKING`: above zero while its reading stands still.
        """
        if not any(stuck):
            self._held = _NOTHING_HELD
            return faults
        given, held = list(faults), list(_NOTHING_HELD)
        for (number, reading), is_stuck in zip(STICKING_FAULTS, stuck, strict=True):
            if is_stuck:
                air = reading - _N_MEASURED
                now = inlets[air] if air >= 0 else actual[reading] + self._saturation_c(actual, reading)
                for before in (self._held[reading], self._last[reading], now):
                    if not math.isnan(before):
                        held[reading] = before
                        break
                given[number] = held[reading] - now
        self._held = held
        return tuple(given)

    @property
    def read_before(self) -> list[float]:
        """What each sensor read in the tick before, or stands still at: of a derived superheat the thermocouple."""
        return [last if math.isnan(held) else held for held, last in zip(self._held, self._last, strict=True)]

    def _saturation_c(self, actual: Sequence[float], reading: int) -> float:
        """Return what the sensor of the superheat reads more than that: nothing, unless it is a thermocouple."""
        return float(self._saturation_temperature(actual[0])) if self.is_derived and reading == 1 else 0.0

    def measure(self, actual: Sequence[float], faults: Sequence[float]) -> Measurement:
        """Return the readings of this tick.

        Parameters
        ----------
        actual : sequence of float
            The fields of `Measurement` as they are.
        faults : sequence of float
            Size of each fault of `ac_common.faults.FAULTS` [SI].

        Returns
        -------
        Measurement
            As `actual`, with the sensors' faults and noise.
        """
        measured = list(actual)
        if self._noise is not None:
            for i, noise in enumerate(next(self._noise)):
                measured[i] += noise
        if self._high_side_noise is not None:
            measured[3] += next(self._high_side_noise)[0]
        for fault, reading in SENSOR_FAULTS:
            measured[reading] += faults[fault]
        if self._held is not _NOTHING_HELD:
            for reading, held in enumerate(self._held[:_N_MEASURED]):
                if not math.isnan(held):
                    measured[reading] = held - self._saturation_c(actual, reading)
        self._last[:_N_MEASURED] = measured
        if self.is_derived:
            own_c = self._saturation_c(actual, 1)
            self._last[1] += own_c
            measured[1] += own_c - self._saturation_temperature(measured[0])
        return Measurement(*measured)

    def measure_inlets(self, inlets: Sequence[float], faults: Sequence[float]) -> Inlets:
        """Return the readings of the air at both inlets.

        Parameters
        ----------
        inlets : sequence of float
            The fields of `Inlets` as they are.
        faults : sequence of float
            As in `measure`.
        """
        read = [air_c + faults[fault] for air_c, fault in zip(inlets, INLET_FAULTS, strict=True)]
        if self._held is not _NOTHING_HELD:
            held = self._held[_N_MEASURED:]
            read = [now if math.isnan(before) else before for now, before in zip(read, held, strict=True)]
        self._last[_N_MEASURED:] = read
        return Inlets(*read)

    def actuate(self, command: Sequence[float], faults: Sequence[float]) -> Command:
        """Return the command that reaches the plant: with the actuators' faults, and never below standstill.

        Parameters
        ----------
        command : sequence of float, length 2
            Compressor speed [rad/s], valve opening [0..1].
        faults : sequence of float
            As in `measure`.
        """
        actuator = list(command)
        for fault, joint in ACTUATOR_FAULTS:
            actuator[joint] = max(actuator[joint] + faults[fault], 0.0)
        return Command(*actuator)


def components(faults: Sequence[float]) -> tuple[float, ...]:
    """Return the sizes [SI] that the plant is to have of `ac_common.faults.COMPONENTS`, within their limits.

    Parameters
    ----------
    faults : sequence of float
        Size of each fault of `ac_common.faults.FAULTS` [SI].
    """
    return tuple([min(max(faults[number], low), high) for number, low, high in _COMPONENTS])


def components_of_all(faults: Vector) -> Vector:
    """Return what `components` does for each row of `faults` (K, F), (K, n)."""
    numbers, low, high = (np.array(column) for column in zip(*_COMPONENTS, strict=True))
    within: Vector = np.clip(faults[:, numbers], low, high)
    return within


def _noise(std: Vector, seed: list[int]) -> Iterator[list[float]]:
    """Yield the noise of one tick after the other; drawn for many at once, which is the same noise for less time."""
    random = np.random.default_rng(seed)
    while True:
        yield from (std * random.standard_normal((_TICKS_AT_ONCE, len(std)))).tolist()
