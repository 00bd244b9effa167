"""`acftc equilibria`: the operating points beside the paper's Table I."""

import click

from bringup.commands.console import print_json, print_table
from bringup.commands.options import examples, json_option


@click.command(
    epilog=examples("acftc equilibria", "acftc equilibria --json | jq .med.cop"),
    short_help="The three operating points beside the paper's Table I.",
)
@json_option
def equilibria(as_json: bool) -> None:
    """Show the operating points that the solver finds, beside the paper's Table I.

    With --plant FILE they are the points of that file.
    """
    from ac_common.units import KPA, RPM
    from ac_plant_node import TABLE_I, load_parameters, operating_point

    table = load_parameters().points
    given = "table_i" if table == TABLE_I else "given"
    points = [(row, operating_point(row.name)) for row in table]
    content = {
        row.name: {
            "compressor_speed_rpm": float(point.inputs[0]) / RPM,
            "valve_opening_percent": 100.0 * float(point.inputs[1]),
            "air_mass_flow_kg_s": float(point.inputs[2]),
            "air_inlet_temperature_c": float(point.inputs[3]),
            "evaporator_pressure_kpa": float(point.outputs[0]) / KPA,
            f"{given}_evaporator_pressure_kpa": row.evaporator_pressure_kpa,
            "superheat_k": float(point.outputs[1]),
            f"{given}_superheat_k": row.superheat_k,
            "wall_temperature_c": float(point.outputs[2]),
            "condenser_pressure_kpa": float(point.outputs[3]) / KPA,
            "subcooling_k": float(point.subcooling_k),
            "mass_flow_kg_s": float(point.mass_flow_kg_s),
            "cooling_power_kw": float(point.cooling_power_w) / 1e3,
            "compressor_power_kw": float(point.compressor_power_w) / 1e3,
            "cop": float(point.cop),
        }
        for row, point in points
    }
    if as_json:
        print_json(content)
        return
    units = {"rpm": "rpm", "percent": "%", "kg_s": "kg/s", "c": "°C", "kpa": "kPa", "k": "K", "kw": "kW"}
    rows = []
    for key in next(iter(content.values())):
        unit = next((name for end, name in units.items() if key.endswith(f"_{end}")), "")
        name = key.replace("table_i_", "Table I: ").replace("_", " ")
        for end in units:
            name = name.removesuffix(f" {end.replace('_', ' ')}")
        rows.append([name, unit, *(f"{content[row.name][key]:.6g}" for row, _ in points)])
    print_table(["quantity", "unit", *content], rows)
