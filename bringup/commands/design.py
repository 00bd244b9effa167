"""`acftc design`: every synthesis and its norms."""

from pathlib import Path

import click

from ac_common.sample_time import DEFAULT_SAMPLE_TIME_S
from bringup.commands.console import digits, print_json, print_table, without_nan
from bringup.commands.options import OneOf, examples, json_option, path_option
from bringup.commands.outcome import make_folder


@click.command(
    epilog=examples(
        "acftc design # all three operating points",
        "acftc design --point med --json | jq '.med[] | {block, achieved}'",
        "acftc design --out designs # files for nodes that are started alone",
    ),
    short_help="Every synthesis: norms, bounds, orders.",
)
@click.option("--point", type=OneOf(["low", "med", "high"]), help="Only this operating point. Default: all.")
@path_option("--out", metavar="DIR", help="Write the designs into DIR, a file for each node.")
@click.option(
    "--sample-time", type=float, default=DEFAULT_SAMPLE_TIME_S, metavar="S", help="Sample time, s. Default: 0.1."
)
@json_option
def design(point: str | None, out: Path | None, sample_time: float, as_json: bool) -> None:
    r"""Show every synthesis: claimed and achieved norm, bound, order, regularisation, stability, time.

    \b
    claimed         H-infinity norm that the Riccati solutions promise
    achieved        that of the closed loop, from a sweep over frequency: within 1 % of claimed
    reduced         the same after the block's order was reduced: what the nodes run; within 5 % of achieved
    bound           no stable block can reach less; a dash: none is known
    order           states before and after the reduction
    slowest pole    the largest real part of the reduced block's poles: negative, or the block is unstable
    time            that the synthesis took when it was made
    regularisation  what was added to make the problem regular, in design units

    Norms are in design units, in which 1 is what the weights allow. K0 below 1 meets its weights. Of H and Q compare
    achieved with bound: what is left is the price of the plant, and no other block does better.

    What has been designed before comes from the cache; a changed parameter designs anew. With --out, DIR holds the
    designs of each operating point, NODE-POINT.npz, and those of the whole envelope for runs that begin there,
    NODE-envelope-POINT.npz.
    """
    from dataclasses import asdict

    from ac_common.design_file import ENVELOPE, PAPER
    from ac_design import all_blocks, write_designs

    points = [point] if point else ["low", "med", "high"]
    if out is not None:
        make_folder(out)
        for name in points:
            for kind in (PAPER, ENVELOPE):
                write_designs(out, name, sample_time, kind)
    blocks = {name: [asdict(block) for block in all_blocks(name, sample_time)] for name in points}
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
