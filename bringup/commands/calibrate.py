"""`acftc calibrate`: the maps of compressor and valve, solved from a table of operating points."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bringup.commands.console import print_json, print_table, say
from bringup.commands.options import examples, json_option, path_option
from bringup.commands.outcome import make_folder

if TYPE_CHECKING:
    from ac_plant_node import OperatingPoint, Parameters
    from ac_plant_node.calibration import CalibratedPoint


@click.command(
    epilog=examples(
        "acftc calibrate # from Table I, beside the built-in maps",
        "acftc calibrate --points points.yaml --parameters car.yaml --out mycar.yaml",
        "acftc --plant mycar.yaml equilibria # what the calibrated plant does",
    ),
    short_help="Fit the plant's maps to a table of operating points.",
)
@path_option(
    "--points",
    "table",
    metavar="FILE",
    help="Operating points, three or more: YAML, see docs/plant.md. Default: those of the parameters, or Table I.",
)
@path_option(
    "--parameters",
    "given",
    metavar="FILE",
    help="Refrigerant, charge, geometry, ...: what is not in the file is as in the built-in plant.",
)
@path_option("--out", metavar="FILE", help="Write the calibrated plant here, for `acftc --plant FILE`.")
@json_option
def calibrate(table: Path | None, given: Path | None, out: Path | None, as_json: bool) -> None:
    """Fit the maps of compressor and valve to operating points, and show them beside the parameters' own.

    At each point the evaporator pressure and the superheat are given. Volumetric efficiency and valve area are solved
    for; three points fix the two maps exactly, more are fitted by least squares. The table shows the equilibria that
    the calibrated plant then has. A coefficient with a sign that no such plant has is warned of.
    """
    from ac_plant_node import calibrate as solve
    from ac_plant_node import load_parameters, load_points
    from ac_plant_node.calibration import doubtful, row_inputs
    from ac_plant_node.equilibrium import equilibrium
    from ac_plant_node.parameters.values import SOLVED

    if out is not None:
        make_folder(out.resolve().parent)
    before = load_parameters(given)
    rows = load_points(table) if table is not None else before.points
    solved, points = solve(before, rows=rows)
    reached = [
        equilibrium(row_inputs(point.row, solved), solved, start=point.state, name=point.row.name) for point in points
    ]
    if out is not None:
        _write(out, solved, f"the {len(rows)} operating points below")
    warnings = doubtful(solved)
    maps = {name: {"solved": solved[name], "before": before[name]} for name in SOLVED}
    shown = {point.row.name: _point(point, rest) for point, rest in zip(points, reached, strict=True)}
    for warning in warnings:
        say(f"warning: {warning}")
    if as_json:
        print_json({"parameters": maps, "points": shown, "warnings": warnings})
        return
    print_table(
        ["parameter", "solved", "before"],
        [[name, f"{values['solved']:.9g}", f"{values['before']:.9g}"] for name, values in maps.items()],
    )
    print_table(
        ["operating point", "p_e given", "p_e reached", "SH given", "SH reached", "p_c", "eta_v", "valve area"],
        [
            [
                name,
                f"{values['evaporator_pressure_kpa']:.2f} kPa",
                f"{values['reached_evaporator_pressure_kpa']:.2f} kPa",
                f"{values['superheat_k']:.2f} K",
                f"{values['reached_superheat_k']:.2f} K",
                f"{values['condenser_pressure_kpa']:.1f} kPa",
                f"{values['volumetric_efficiency']:.4f}",
                f"{values['valve_area_mm2']:.4f} mm²",
            ]
            for name, values in shown.items()
        ],
    )
    if out is not None:
        say(f"wrote {out}")


def _point(point: "CalibratedPoint", rest: "OperatingPoint") -> dict[str, Any]:
    return {
        "evaporator_pressure_kpa": point.row.evaporator_pressure_kpa,
        "reached_evaporator_pressure_kpa": float(rest.outputs[0]) * 1e-3,
        "superheat_k": point.row.superheat_k,
        "reached_superheat_k": float(rest.outputs[1]),
        "condenser_pressure_kpa": float(rest.outputs[3]) * 1e-3,
        "volumetric_efficiency": point.eta_v,
        "valve_area_mm2": point.valve_area_m2 * 1e6,
    }


def _write(out: Path, solved: "Parameters", source: str) -> None:
    from ac_common.files import write_whole
    from ac_plant_node.parameters.file import parameter_text
    from ac_plant_node.parameters.values import SOLVED

    text = parameter_text(solved, dict.fromkeys(SOLVED, f"solved by acftc calibrate from {source}"))
    write_whole(out, text)
