"""`acftc calibrate`: the maps of compressor and valve, solved again."""

import click

from bringup.commands.options import examples, json_option
from bringup.console import print_json, print_table


@click.command(
    epilog=examples("acftc calibrate", "acftc calibrate --json"),
    short_help="Solve the plant's maps again from Table I.",
)
@json_option
def calibrate(as_json: bool) -> None:
    """Solve the maps of compressor and valve again from Table I, and show them beside the shipped ones."""
    from ac_plant_node import calibrate as solve
    from ac_plant_node import load_parameters

    shipped = load_parameters()
    solved, points = solve(shipped)
    names = (
        "eta_v_offset",
        "eta_v_pressure_ratio",
        "eta_v_speed",
        "valve_area_0_m2",
        "valve_area_1_m2",
        "valve_area_2_m2",
    )
    content = {name: {"solved": solved[name], "shipped": shipped[name]} for name in names}
    if as_json:
        print_json(content)
        return
    print_table(
        ["parameter", "solved", "shipped"],
        [[name, f"{values['solved']:.9g}", f"{values['shipped']:.9g}"] for name, values in content.items()],
    )
    print_table(
        ["operating point", "volumetric efficiency", "valve area"],
        [[point.row.name, f"{point.eta_v:.4f}", f"{1e6 * point.valve_area_m2:.4f} mm²"] for point in points],
    )
