"""Effect of every fault over a moving load: `python -m docs.tools.fault_pictures docs/faults`.

It draws a picture of each fault into the folder, and writes the tables of the page beside it, `docs/faults.md`, anew:
that of the effects, and those of `ac_design.analysis.isolability`.

The load moves as a sawtooth of 200 s: air flow by 20 % and inlet air by 2 K, either way. The fault comes at 300 s, in
the registry's usual size, or, of a sensor, as one that stands still, and stays; the same run without it is drawn
beside. K0 is alone, so that what is seen is the fault and not what the compensator makes of it. The last column is what
the detector of `design: paper` calls the fault in a run with its compensator and without the load, which by itself is
worth some alarms.
"""

import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from numpy.typing import NDArray

from ac_common.fault_profiles import STUCK
from ac_common.faults import FAULTS, STICKING, Fault
from ac_common.units import KPA, RPM
from ac_design.analysis import isolability
from ac_experiments.metrics import fault_summaries
from ac_experiments.recording import Recording
from ac_experiments.report.charts import BLUE, GREY, VERMILION, Chart, Curve, Mark
from ac_experiments.report.matplotlib_charts import draw
from ac_experiments.scenario import check
from ac_experiments.simulate import simulate

ONSET_S, PERIOD_S, END_S = 300.0, 200.0, 900.0
#: What is drawn begins here, s, with so many ticks between two points of a curve.
FROM_S, EVERY = 280.0, 10
#: What matplotlib leaves out of a curve while it stays within so many points (of 0.35 mm) of what is left.
SIMPLER = {"path.simplify": True, "path.simplify_threshold": 0.5}
#: What is drawn and told of a run: its series, and how much of SI is one of the unit.
SERIES = {
    "p_e": ("plant/evaporator_pressure", KPA),
    "SH": ("plant/superheat", 1.0),
    "p_c": ("plant/condenser_pressure", KPA),
    "N": ("actuator/command:compressor", RPM),
    "vents": ("plant/vent_temperature", 1.0),
    "cooling": ("plant/performance:cooling", 1.0),
    "power": ("plant/performance:compressor_power", 1.0),
}
PLOTS = (
    ("Evaporator pressure", "p<sub>e</sub>, kPa", "p_e"),
    ("Superheat", "SH, K", "SH"),
    ("Condenser pressure", "p<sub>c</sub>, kPa", "p_c"),
    ("Compressor speed", "N, rpm", "N"),
    ("Air behind the evaporator", "°C", "vents"),
    ("Compressor power", "W", "power"),
)
HEAD = (
    "| fault | size | p_e, kPa | least SH, K | p_c, kPa | N, rpm | vents, K | cooling, % | power, % "
    "| called (paper) |\n"
    "|---|---|---|---|---|---|---|---|---|---|"
)

Course = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class Case:
    """A fault of its usual size, or a sensor that stands still."""

    fault: Fault
    is_stuck: bool

    @property
    def name(self) -> str:
        """Name of its picture, without the ending."""
        return f"{self.fault.kind}_stuck" if self.is_stuck else self.fault.kind

    @property
    def size(self) -> str:
        """Its size in words."""
        return STUCK if self.is_stuck else f"{self.fault.typical:g} {self.fault.unit}"

    @property
    def scheduled(self) -> dict[str, Any]:
        """It as an entry of a scenario."""
        how = {"profile": STUCK} if self.is_stuck else {self.fault.size_key: self.fault.typical}
        return {"kind": self.fault.kind, "onset_s": ONSET_S, **how}


CASES = (*(Case(fault, is_stuck=False) for fault in FAULTS), *(Case(fault, is_stuck=True) for fault in STICKING))


def load() -> dict[str, Any]:
    """Return the moving load as the key ``air`` of a scenario."""

    def sawtooth(size: float) -> list[dict[str, float]]:
        turns = np.arange(0.0, END_S, PERIOD_S / 2)
        return [
            {"at_s": float(at), "to": size if i % 2 == 0 else -size, "ramp_s": PERIOD_S / 2}
            for i, at in enumerate(turns)
        ]

    return {"mass_flow_percent": sawtooth(20.0), "inlet_temperature_k": sawtooth(2.0)}


def run_with(case: Case | None, *, at_rest: bool = False) -> Recording:
    """Run the moving load with K0 alone; or no load, with the compensator."""
    faults = [] if case is None else [case.scheduled]
    air = {} if at_rest else load()
    scenario = check({"name": "moving_load", "design": "paper", "duration_s": END_S, "air": air, "faults": faults})
    return simulate(scenario, passive=not at_rest)


def course_of(run: Recording) -> Course:
    """Return what is drawn of a run, each (ticks,), with its times as ``t``."""
    return {"t": run.time_s, **{name: run.series[key] / unit for name, (key, unit) in SERIES.items()}}


def picture(case: Case, faulty: Course, healthy: Course) -> str:
    """Return the SVG of a fault's effect."""
    marks = [Mark(ONSET_S, "fault", VERMILION, "dash")]
    keep = slice(int(np.searchsorted(faulty["t"], FROM_S)), None, EVERY)
    runs = ((healthy, "without the fault", GREY), (faulty, "with it", BLUE))
    charts = [
        Chart(
            title,
            [
                Curve(course["t"][keep], course[name][keep], words if number == 0 else "", colour)
                for course, words, colour in runs
            ],
            unit,
            marks=marks,
        )
        for number, (title, unit, name) in enumerate(PLOTS)
    ]
    begins = f"The {case.fault.name} stands still" if case.is_stuck else f"A fault of the {case.fault.name}"
    with rc_context(SIMPLER):
        text = draw(charts, 3, f"{begins} over a moving load", (4.0, 2.1))
    return re.sub(r"\n(?=[L\"z])", " ", text)


def row(case: Case, faulty: Course, healthy: Course, at_rest: Recording) -> str:
    """Return a row of Markdown: changes over the last period of the load, and what the paper's detector calls it."""
    last = faulty["t"] >= END_S - PERIOD_S

    def change(name: str) -> float:
        return float((faulty[name] - healthy[name])[last].mean())

    least = float(faulty["SH"][faulty["t"] >= ONSET_S].min())
    percent = [100.0 * change(name) / float(healthy[name][last].mean()) for name in ("cooling", "power")]
    (seen,) = fault_summaries(at_rest)
    cells = [
        f"`{case.fault.kind}`", case.size, f"{change('p_e'):+.1f}", f"{least:.1f}", f"{change('p_c'):+.0f}",
        f"{change('N'):+.0f}", f"{change('vents'):+.2f}", f"{percent[0]:+.1f}", f"{percent[1]:+.1f}",
        seen["isolated_as"] or ("detected" if seen["detected_s"] else "–"),
    ]  # fmt: skip
    return f"| {' | '.join(cells)} |"


def with_table(page: str, name: str, table: str) -> str:
    """Return a page with the table between its two comments of that name exchanged.

    Raises
    ------
    ValueError
        When the page does not have them once.
    """
    begin, end = f"<!-- {name}: written by docs.tools.fault_pictures -->", f"<!-- end of {name} -->"
    before, found, rest = page.partition(begin)
    _, ended, after = rest.partition(end)
    if not found or not ended or begin in after:
        msg = f"the page must have {begin!r} and {end!r} once"
        raise ValueError(msg)
    return f"{before}{begin}\n\n{table}\n\n{end}{after}"


def main() -> None:
    """Draw the pictures and write the tables."""
    if len(sys.argv) != 2:
        raise SystemExit("usage: python -m docs.tools.fault_pictures FOLDER")
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    page, rows = folder.with_suffix(".md"), [HEAD]
    healthy = course_of(run_with(None))
    for case in CASES:
        faulty = course_of(run_with(case))
        (folder / f"{case.name}.svg").write_text(picture(case, faulty, healthy), encoding="utf-8")
        rows.append(row(case, faulty, healthy, run_with(case, at_rest=True)))
        print(rows[-1], flush=True)
    text = with_table(page.read_text(encoding="utf-8"), "effects", "\n".join(rows))
    for name, table in isolability.tables().items():
        text = with_table(text, name, table)
    page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
