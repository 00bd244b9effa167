"""Energy of a run, and what a car makes of it: the same functions for `summary.json` and the report."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ac_common.signals import Cabin, Performance
from ac_common.topics import CABIN_SERIES, CAR_SERIES, PERFORMANCE_SERIES
from ac_experiments.recording import Recording

#: What a pull-down is timed to, degC.
COMFORT_C = 27.0


def performance_of(recording: Recording) -> dict[str, NDArray[np.float64]]:
    """Return the fields of `ac_common.signals.Performance` of a run, each (ticks,), SI; {} where nobody has told."""
    values = {
        name: recording.series[key]
        for name, key in zip(Performance._fields, PERFORMANCE_SERIES, strict=True)
        if key in recording.series and np.isfinite(recording.series[key]).any()
    }
    return values if len(values) == len(Performance._fields) else {}


def energies_j(recording: Recording) -> dict[str, float]:
    """Return the integrals of compressor power, cooling and its latent part over a run; {} where nobody has told."""
    values, step_s = performance_of(recording), float(recording.metadata["sample_time_s"])
    powers = {"compressor": "compressor_power", "cooling": "cooling", "latent_cooling": "latent_cooling"}
    return {name: float(np.nansum(values[key])) * step_s for name, key in powers.items()} if values else {}


@dataclass(frozen=True)
class CarFigures:
    """What a run has made of a car.

    Attributes
    ----------
    cabin_c, interior_c, vent_c : float
        Air of the cabin, its interior, and air at the vents, at the end.
    comfort_s : float
        When the cabin's air was first below `COMFORT_C`, having been above; nan: never.
    distance_m : float
    """

    cabin_c: float
    interior_c: float
    vent_c: float
    comfort_s: float
    distance_m: float


def car_figures(recording: Recording) -> CarFigures | None:
    """Return what a run has made of a car; None without one."""
    series = recording.series
    if not all(key in series and np.isfinite(series[key]).any() for key in (*CABIN_SERIES, *CAR_SERIES[:1])):
        return None
    cabin, interior = (series[key] for key in CABIN_SERIES[: Cabin._fields.index("cabin_interior") + 1])
    vents = series["plant/vent_temperature"]
    warm = np.flatnonzero(cabin >= COMFORT_C)
    cool = np.flatnonzero(cabin < COMFORT_C)
    cool = cool[cool > warm[0]] if len(warm) else cool[:0]
    return CarFigures(
        cabin_c=_last(cabin),
        interior_c=_last(interior),
        vent_c=_last(vents),
        comfort_s=float(recording.time_s[cool[0]]) if len(cool) else np.nan,
        distance_m=float(np.nansum(series[CAR_SERIES[0]])) * float(recording.metadata["sample_time_s"]),
    )


def _last(values: NDArray[np.float64]) -> float:
    finite = values[np.isfinite(values)]
    return float(finite[-1]) if len(finite) else np.nan
