"""What the plant makes of a run: cooling and its parts, water, the air of the vents, compressor power, COP."""

from collections.abc import Mapping, Sequence

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from ac_experiments.energy import COMFORT_C, car_figures, energies_j, performance_of
from ac_experiments.metrics import WINDOW_S
from ac_experiments.recording import Recording
from ac_experiments.report.parts import Part, Table, Words, cell

#: Rows of the table: key of `figures`, name, unit, SI of one unit, format.
_ROWS = (
    ("cooling", "Cooling", "kW", 1e3, ".3f"),
    ("sensible_cooling", "Sensible cooling", "kW", 1e3, ".3f"),
    ("latent_cooling", "Latent cooling: heat of the water that condenses", "kW", 1e3, ".3f"),
    ("condensed_water", "Water that condenses", "kg/h", 1.0 / 3600.0, ".3f"),
    ("frost", "Water that freezes on the evaporator", "kg/h", 1.0 / 3600.0, ".3f"),
    ("vent_temperature", "Air behind the evaporator, at the vents", "°C", 1.0, ".2f"),
    ("compressor_power", "Compressor power", "kW", 1e3, ".3f"),
    ("cop", "COP: cooling over compressor power", "", 1.0, ".2f"),
    ("subcooling", "Subcooling", "K", 1.0, ".2f"),
)
#: Rows that say nothing in dry air.
_OF_WATER = ("sensible_cooling", "latent_cooling", "condensed_water", "frost")


def figures(values: Mapping[str, NDArray[np.float64]]) -> dict[str, float]:
    """Return the means of what `performance_of` returns, the sensible cooling, and the COP of the means."""
    means = {name: float(np.nanmean(series)) for name, series in values.items()}
    power = means["compressor_power"]
    return means | {
        "sensible_cooling": means["cooling"] - means["latent_cooling"],
        "cop": means["cooling"] / power if power > 0.0 else np.nan,
    }


def performance_table(recording: Recording, beside: Recording | None = None) -> list[Part]:
    """Return the plant's performance over a run and at its end, beside that of another one.

    Nothing for a plant that does not tell it.
    """
    values = performance_of(recording)
    if not values:
        return []
    heads: list[str | Markup] = ["Means", "Unit"]
    columns: list[dict[str, float]] = []
    runs = [run for run in (recording, beside) if run is not None]
    for run in runs:
        kind = f", {'passive' if run.metadata['passive'] else 'active'}" if len(runs) > 1 else ""
        heads += [f"Whole run{kind}", f"Last {WINDOW_S:g} s{kind}"]
        series, last = performance_of(run), round(WINDOW_S / run.metadata["sample_time_s"])
        columns += [figures(series), figures({name: one[-last:] for name, one in series.items()})]
    rows = [
        [name, unit, *(cell(column[key] / si, digits) for column in columns)]
        for key, name, unit, si, digits in _ROWS
        if key not in _OF_WATER or any(column["latent_cooling"] for column in columns)
    ]
    joules = energies_j(recording)
    work, cooling = joules["compressor"], joules["cooling"]
    energy = Words(
        f"Energy over the run: {cooling / 3.6e6:.3f} kWh ({cooling / 1e3:.0f} kJ) of cooling for "
        f"{work / 3.6e6:.3f} kWh ({work / 1e3:.0f} kJ) of compressor work.",
        "note",
    )
    return [Table(heads, rows), energy, *_frost(values["frost"], recording), *_car(recording)]


def performance_rows(recordings: Sequence[Recording]) -> list[list[str]]:
    """Return rows of a table: name, unit, and the mean over each run, a dash for a plant that does not tell it."""
    means = [figures(values) if (values := performance_of(run)) else {} for run in recordings]
    if not any(means):
        return []
    return [
        [name, unit, *(cell(one[key] / si if one else None, digits) for one in means)]
        for key, name, unit, si, digits in _ROWS
        if key not in _OF_WATER or any(one.get("latent_cooling") for one in means)
    ]


def _frost(frost: NDArray[np.float64], recording: Recording) -> list[Part]:
    """Return a word of warning when water froze, with the time for which it did."""
    seconds = np.count_nonzero(frost > 0.0) * recording.metadata["sample_time_s"]
    return [Words(f"Frost: for {seconds:g} s water froze on the evaporator.", "note")] if seconds else []


def _car(recording: Recording) -> list[Part]:
    """Return what a run has made of a car; nothing without one."""
    car = car_figures(recording)
    if car is None:
        return []
    rows = [
        ["Air of the cabin", "°C", cell(car.cabin_c, ".2f")],
        ["Interior of the cabin", "°C", cell(car.interior_c, ".2f")],
        ["Air at the vents", "°C", cell(car.vent_c, ".2f")],
        [f"Cabin cooled to {COMFORT_C:g} °C after", "min", cell(car.comfort_s / 60.0, ".1f")],
        ["Distance", "km", cell(car.distance_m / 1e3, ".2f")],
    ]
    return [Table(["The car at the end", "Unit", ""], rows)]
