"""The car's scenarios: `python -m docs.tools.car_pictures FOLDER [SC03.CSV]` prints their figures and draws them.

A table with a row for each scenario, a picture each of `pull_down` and `city`, and a table of pull-downs in the
conditions of those that others have measured (`docs/plant.md`). Without the EPA's file `sc03` is
left out.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ac_common.units import KPA
from ac_experiments.energy import car_figures
from ac_experiments.metrics import summarise
from ac_experiments.recording import Recording
from ac_experiments.report.matplotlib_charts import draw
from ac_experiments.report.panels import charts_of
from ac_experiments.scenario import load
from ac_experiments.simulate import simulate

SCENARIOS = ("pull_down", "sc03", "city", "idle_in_the_heat")
PICTURED = ("pull_down", "city")
#: From when on the errors count: until then the references move, and the cabin's air with them.
SETTLED_S = 60.0
#: Ticks between two points of a curve.
EVERY = 50
#: Pull-downs that others have measured at a standstill: what is changed in `pull_down` to be alike.
_SUN = ("car.vehicle_speed_km_h=0", "car.sun_w_m2=900", "car.outside_humidity_percent=45", "duration_s=1210")
PUBLISHED = {
    "JAF, recirculated air": ("car.cabin=55", "car.outside_temperature_c=28"),
    "JAF, outside air": ("car.cabin=55", "car.outside_temperature_c=28", "car.recirculation_percent=0"),
    "Miller": ("car.cabin=53", "car.outside_temperature_c=38"),
    "Tata Punch": ("car.cabin=36", "car.outside_temperature_c=41"),
}
HEADS = (
    "scenario", "p_e, rms", "p_e, rms from 0 s", "SH, rms", "p_c, highest", "cooling", "compressor", "COP",
    "cabin, 10 min", "vents, 10 min", "27 degC after", "cabin, end", "vents, end",
)  # fmt: skip


def published(name: str) -> Recording:
    """Return a run of `pull_down` in the conditions of one of `PUBLISHED`, a little longer than 20 minutes."""
    return simulate(load("pull_down", [*_SUN, *PUBLISHED[name]]))


def rms(values: NDArray[np.float64]) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))


def row(run: Recording, has_belt: bool) -> list[str]:
    """Return the row of a run: errors from `SETTLED_S` on, of p_e from 0 s too, energy, and what came of the cabin."""
    series, after = run.series, run.time_s >= SETTLED_S
    p_e = (series["plant/evaporator_pressure"] - series["reference/evaporator_pressure"]) / KPA
    superheat = (series["plant/superheat"] - series["reference/superheat"])[after]
    summary, car = summarise(run), car_figures(run)
    assert car is not None
    at = min(int(np.searchsorted(run.time_s, 600.0)), len(run.time_s) - 1)
    comfort = f"{car.comfort_s / 60.0:.1f} min" if np.isfinite(car.comfort_s) else "–"
    return [
        f"`{summary['scenario']}`",
        *("–" if has_belt else f"{rms(error):.2f} kPa" for error in (p_e[after], p_e)),
        f"{rms(superheat):.2f} K",
        f"{series['plant/condenser_pressure'].max() / 1e6:.2f} MPa",
        f"{summary['energy_kj']['cooling']:.0f} kJ",
        f"{summary['energy_kj']['compressor']:.0f} kJ",
        f"{summary['cop']:.2f}",
        f"{series['plant/car:cabin_air'][at]:.1f} degC",
        f"{series['plant/vent_temperature'][at]:.1f} degC",
        comfort,
        f"{car.cabin_c:.1f} degC",
        f"{car.vent_c:.1f} degC",
    ]


def picture(run: Recording) -> str:
    """Return the picture of a run, as SVG: the cabin, how the car moves, what is controlled and what is commanded."""
    few = Recording(
        run.time_s[::EVERY], {key: values[::EVERY] for key, values in run.series.items()}, [],
        {**run.metadata, "sample_time_s": EVERY * run.metadata["sample_time_s"]},
    )  # fmt: skip
    charts = charts_of(few, keys=("cabin", "vehicle", "p_e", "SH", "N", "valve"))
    return draw(charts, 2, str(run.metadata["scenario"]["name"]))


def main(arguments: Sequence[str]) -> int:
    """Print the table and write the pictures."""
    folder, *cycle = arguments
    print(f"| {' | '.join(HEADS)} |\n|{'---|' * len(HEADS)}")
    for name in SCENARIOS:
        if name == "sc03" and not cycle:
            continue
        scenario = load(name, [f"car.drive_cycle={cycle[0]}"] if name == "sc03" else [])
        run = simulate(scenario)
        print(f"| {' | '.join(row(run, scenario.has_belt))} |", flush=True)
        if name in PICTURED:
            (Path(folder) / f"car_{name}.svg").write_text(picture(run), encoding="utf-8")
    print("\n| at a standstill | cabin after 5, 10, 20 min | vents then |\n|---|---|---|")
    for name in PUBLISHED:
        run = published(name)
        at = np.searchsorted(run.time_s, [300.0, 600.0, 1200.0])
        cells = (run.series[key][at] for key in ("plant/car:cabin_air", "plant/vent_temperature"))
        print(f"| {name} | {' | '.join(', '.join(f'{value:.1f}' for value in cell) + ' degC' for cell in cells)} |")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
