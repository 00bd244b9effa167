"""Pictures of the plant as SVG: `python -m docs.tools.plant_pictures FOLDER [CYCLE_FILE]`.

`plant_cycle.svg`: the three operating points on a p-h diagram; `plant_step.svg`: the large step from the high point's
inputs to the low one's, in which the superheated zone of the evaporator vanishes and comes back; with a drive cycle's
file also `plant_drive_cycle.svg`.
"""

import sys
from pathlib import Path

import numpy as np

from ac_common.units import RPM
from ac_experiments.report.charts import Chart, Curve
from ac_experiments.report.matplotlib_charts import draw
from ac_plant_node.drive_cycle import load_drive_cycle, run_drive_cycle
from ac_plant_node.dynamics import balances
from ac_plant_node.equilibrium import operating_point
from ac_plant_node.parameters.file import load_parameters
from ac_plant_node.parameters.values import POINTS
from ac_plant_node.plant import Plant
from ac_plant_node.properties.lookup import saturation
from ac_plant_node.properties.tables import load_tables

_COLOURS = ("#1f6fb4", "#2a9d3a", "#c8452d")


def cycle_picture() -> str:
    """Draw the steady cycles of the three operating points on a p-h diagram."""
    tab = load_tables(load_parameters().refrigerant)
    pressures = np.geomspace(1.0e5, float(tab.grid[8]), 200)
    dome = np.array([saturation(tab, p)[1:3] for p in pressures]) * 1.0e-3
    curves = [
        Curve(dome[:, 0], pressures * 1.0e-3, "saturation", "#777777"),
        Curve(dome[:, 1], pressures * 1.0e-3, "", "#777777"),
    ]
    for name, colour in zip(POINTS, _COLOURS, strict=True):
        at = operating_point(name)
        p_e, p_c = at.outputs[0] * 1.0e-3, at.outputs[3] * 1.0e-3
        h_1, h_2, h_3 = at.state[2] * 1.0e-3, at.discharge_enthalpy_j_kg * 1.0e-3, at.state[8] * 1.0e-3
        curves.append(Curve(np.array([h_3, h_1, h_2, h_3, h_3]), np.array([p_e, p_e, p_c, p_c, p_e]), name, colour))
    title = "The cycle at the three operating points"
    return draw([Chart(title, curves, "p, kPa", "h, kJ/kg", log="y")], 1, title, (7.0, 4.5))


def step_picture() -> str:
    """Draw the step from the inputs of the high point to those of the low one, at 10 s."""
    plant, step = Plant.at("high"), operating_point("low").inputs
    time = np.arange(0.0, 150.0, 0.1)
    rows = []
    for t in time:
        plant.step(step if t >= 10.0 else plant.inputs, 0.1)
        aux, x = plant._aux, plant.state
        rows.append((x[1] * 1e-3, x[7] * 1e-3, aux[balances.SUPERHEAT], x[0], x[5], x[6], 1.0 - x[5] - x[6],
                     aux[balances.M_COMPRESSOR] * 1e3, aux[balances.M_VALVE] * 1e3))  # fmt: skip
    y = np.array(rows).T
    charts = [
        Chart(
            "Pressures",
            [Curve(time, y[0], "p<sub>e</sub>", _COLOURS[0]), Curve(time, y[1], "p<sub>c</sub>", _COLOURS[2])],
            "p, kPa",
        ),
        Chart("Superheat", [Curve(time, y[2], "", _COLOURS[0])], "SH, K"),
        Chart(
            "Zone lengths",
            [
                Curve(time, y[3], "evaporator two-phase", _COLOURS[0]),
                Curve(time, y[4], "condenser superheated", _COLOURS[2]),
                Curve(time, y[5], "two-phase", _COLOURS[2], "dash"),
                Curve(time, y[6], "subcooled", _COLOURS[2], "dot"),
            ],
            "part of the length",
        ),
        Chart(
            "Mass flows",
            [Curve(time, y[7], "compressor", _COLOURS[0]), Curve(time, y[8], "valve", _COLOURS[1])],
            "g/s",
        ),
    ]
    return draw(charts, 2, "Step from the high operating point's inputs to the low one's")


def drive_cycle_picture(path: Path) -> str:
    """Draw the plant open loop through a drive cycle."""
    run = run_drive_cycle(load_drive_cycle(path))
    t = run.time_s
    charts = [
        Chart("Vehicle speed", [Curve(t, run.vehicle_speed_m_s * 3.6, "", _COLOURS[1])], "v, km/h"),
        Chart("Compressor speed", [Curve(t, run.compressor_speed_rad_s / RPM, "", _COLOURS[1])], "N, rpm"),
        Chart("Condenser pressure", [Curve(t, run.outputs[:, 3] * 1e-3, "", _COLOURS[2])], "p<sub>c</sub>, kPa"),
        Chart("Evaporator pressure", [Curve(t, run.outputs[:, 0] * 1e-3, "", _COLOURS[0])], "p<sub>e</sub>, kPa"),
    ]
    return draw(charts, 2, f"Open loop through {path.name}")


def main() -> None:
    """Write the pictures."""
    if not 2 <= len(sys.argv) <= 3:
        raise SystemExit("usage: python -m docs.tools.plant_pictures FOLDER [CYCLE_FILE]")
    folder = Path(sys.argv[1])
    pictures = {"plant_cycle.svg": cycle_picture(), "plant_step.svg": step_picture()}
    try:
        if len(sys.argv) == 3:
            pictures["plant_drive_cycle.svg"] = drive_cycle_picture(Path(sys.argv[2]))
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in pictures.items():
            (folder / name).write_text(text, encoding="utf-8")
            print(folder / name)
    except (OSError, ValueError) as error:
        raise SystemExit(f"pictures: {error}") from error


if __name__ == "__main__":
    main()
