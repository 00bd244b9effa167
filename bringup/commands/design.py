"""`acftc design`: every synthesis and its norms."""

import click

from bringup.commands.options import OneOf, examples, json_option
from bringup.console import digits, print_json, print_table, without_nan


@click.command(
    epilog=examples(
        "acftc design # all three operating points", "acftc design --point med --json | jq '.med[] | {block, achieved}'"
    ),
    short_help="Every synthesis: norms, bounds, orders.",
)
@click.option("--point", type=OneOf(["low", "med", "high"]), help="Only this operating point. Default: all.")
@json_option
def design(point: str | None, as_json: bool) -> None:
    """Show every synthesis: claimed and achieved norm, bound, order, regularisation, stability, time.

    What has been designed before comes from the cache; a changed parameter designs anew.
    """
    from dataclasses import asdict

    from ac_design.overview import all_blocks

    points = [point] if point else ["low", "med", "high"]
    blocks = {name: [asdict(block) for block in all_blocks(name)] for name in points}
    if as_json:
        print_json(without_nan(blocks))
        return
    heads = [
        "point",
        "block",
        "claimed",
        "achieved",
        "reduced",
        "bound",
        "order",
        "slowest pole",
        "time",
        "regularisation",
    ]
    rows = [
        [
            name,
            block["block"],
            digits(block["claimed"]),
            digits(block["achieved"]),
            digits(block["achieved_reduced"]),
            digits(block["lower_bound"]),
            f"{block['order']} → {block['order_reduced']}",
            f"{digits(block['slowest_pole_rad_s'])} rad/s",
            f"{block['seconds']:.1f} s",
            block["regularisation"],
        ]
        for name in points
        for block in blocks[name]
    ]
    print_table(heads, rows)
