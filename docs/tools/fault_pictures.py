"""Effect of every fault over a moving load: `python -m docs.tools.fault_pictures FOLDER` draws it and prints a table.

The load moves as a sawtooth of 200 s: air flow by 20 % and inlet air by 2 K, either way. The fault comes at 300 s, in
the registry's usual size, and stays; the same run without it is drawn beside. K0 is alone, so that what is seen is the
fault and not what the compensator makes of it. The last column is what the detector calls the fault in a run with the
compensator and without the load, which by itself is worth some alarms.
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ac_common.faults import COMPONENT_KINDS, FAULTS, Fault
from ac_common.units import KPA, RPM
from ac_experiments.metrics import fault_summaries
from ac_experiments.recording import Recording
from ac_experiments.report.charts import BLUE, GREY, VERMILION, Chart, Curve, Mark
from ac_experiments.report.matplotlib_charts import draw
from ac_experiments.scenario import check
from ac_experiments.simulate import simulate
from ac_plant_node import Plant
from ac_plant_node.inputs import N_FAULTS

ONSET_S, PERIOD_S, END_S = 300.0, 200.0, 900.0
#: Ticks between two points of a curve.
EVERY = 50

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Course:
    """What is drawn of a run, each (ticks,).

    `vent_c`: air behind the evaporator; `power_w`: of the compressor.
    """

    time_s: Vector
    pressure_kpa: Vector
    superheat_k: Vector
    condenser_kpa: Vector
    speed_rpm: Vector
    vent_c: Vector
    cooling_w: Vector
    power_w: Vector


def load() -> dict[str, Any]:
    """Return the moving load as the key ``air`` of a scenario."""

    def sawtooth(size: float) -> list[dict[str, float]]:
        turns = np.arange(0.0, END_S - PERIOD_S / 2, PERIOD_S / 2)
        return [
            {"at_s": float(at), "to": size if i % 2 == 0 else -size, "ramp_s": PERIOD_S / 2}
            for i, at in enumerate(turns)
        ]

    return {"mass_flow_percent": sawtooth(20.0), "inlet_temperature_k": sawtooth(2.0)}


def run_with(fault: Fault | None, *, at_rest: bool = False) -> Recording:
    """Run the moving load with K0 alone, with a fault of its usual size; or no load, with the compensator."""
    faults = [] if fault is None else [{"kind": fault.kind, fault.size_key: fault.typical, "onset_s": ONSET_S}]
    air = {} if at_rest else load()
    scenario = check({"name": "moving_load", "duration_s": END_S, "air": air, "faults": faults})
    return simulate(scenario, passive=not at_rest)


def course_of(run: Recording) -> Course:
    """Return the course of a run; what no topic carries comes from the plant, driven once more with what drove it.

    Raises
    ------
    RuntimeError
        When that plant does not give the recorded outputs to the last bit.
    """
    series, plant = run.series, Plant.at("med")
    joints = [f"component/faults:{kind}" for kind in COMPONENT_KINDS[:N_FAULTS]]
    keys = ("actuator/command:compressor", "actuator/command:expansion_valve", "scenario/air:evaporator_air")
    inputs = np.column_stack([series[key] for key in (*keys, "scenario/air_inlet_temperature")])
    faults = np.column_stack([series[joint] for joint in joints])
    more, pressure = np.empty((len(inputs), 3)), series["plant/evaporator_pressure"]
    for k, told in enumerate(inputs):
        out = plant.outputs
        if k and out.evaporator_pressure_pa != pressure[k]:  # at rest the point's own outputs are recorded
            msg = f"the plant gives {out.evaporator_pressure_pa} Pa at tick {k}, recorded is {pressure[k]}"
            raise RuntimeError(msg)
        more[k] = out.air_outlet_temperature_c, out.cooling_power_w, out.compressor_power_w
        if k == 0 or (faults[k] != faults[k - 1]).any():
            plant.hold_faults(faults[k])
        plant.step(told, float(run.metadata["sample_time_s"]))
    return Course(
        run.time_s,
        pressure / KPA,
        series["plant/superheat"],
        series["plant/condenser_pressure"] / KPA,
        series["actuator/command:compressor"] / RPM,
        *more.T,
    )


def picture(fault: Fault, faulty: Course, healthy: Course) -> str:
    """Return the SVG of a fault's effect."""
    marks = [Mark(ONSET_S, "fault", VERMILION, "dash")]

    def chart(title: str, unit: str, name: str) -> Chart:
        pairs = ((healthy, "without the fault", GREY), (faulty, "with it", BLUE))
        curves = [Curve(c.time_s[::EVERY], getattr(c, name)[::EVERY], words, colour) for c, words, colour in pairs]
        return Chart(title, curves, unit, marks=marks)

    charts = [
        chart("Evaporator pressure", "p<sub>e</sub>, kPa", "pressure_kpa"),
        chart("Superheat", "SH, K", "superheat_k"),
        chart("Condenser pressure", "p<sub>c</sub>, kPa", "condenser_kpa"),
        chart("Compressor speed", "N, rpm", "speed_rpm"),
        chart("Air behind the evaporator", "°C", "vent_c"),
        chart("Compressor power", "W", "power_w"),
    ]
    return draw(charts, 3, f"A fault of the {fault.name} over a moving load", (4.0, 2.1))


def row(fault: Fault, faulty: Course, healthy: Course, at_rest: Recording) -> str:
    """Return a row of Markdown: changes over the last period of the load, and what the detector calls it."""
    last = faulty.time_s >= END_S - PERIOD_S

    def change(name: str) -> float:
        return float((getattr(faulty, name) - getattr(healthy, name))[last].mean())

    least = float(faulty.superheat_k[faulty.time_s >= ONSET_S].min())
    percent = [100.0 * change(name) / float(getattr(healthy, name)[last].mean()) for name in ("cooling_w", "power_w")]
    (seen,) = fault_summaries(at_rest)
    cells = [
        f"`{fault.kind}`", f"{fault.typical:g} {fault.unit}", f"{change('pressure_kpa'):+.1f}", f"{least:.1f}",
        f"{change('condenser_kpa'):+.0f}", f"{change('speed_rpm'):+.0f}", f"{change('vent_c'):+.2f}",
        f"{percent[0]:+.1f}", f"{percent[1]:+.1f}", seen["isolated_as"] or ("detected" if seen["detected_s"] else "–"),
    ]  # fmt: skip
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Write the pictures and print the table."""
    if len(sys.argv) != 2:
        raise SystemExit("usage: python -m docs.tools.fault_pictures FOLDER")
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    healthy = course_of(run_with(None))
    print("| fault | size | p_e, kPa | least SH, K | p_c, kPa | N, rpm | vents, K | cooling, % | power, % | called |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for fault in FAULTS:
        faulty = course_of(run_with(fault))
        (folder / f"{fault.kind}.svg").write_text(picture(fault, faulty, healthy), encoding="utf-8")
        print(row(fault, faulty, healthy, run_with(fault, at_rest=True)), flush=True)


if __name__ == "__main__":
    main()
