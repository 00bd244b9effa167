"""`acftc bench`: the benchmarks."""

import click

from ac_common.errors import RunError
from bringup.commands.console import print_json, print_table, say
from bringup.commands.options import examples, json_option


@click.command(
    epilog=examples(
        "acftc bench # three minutes on a machine that does nothing else",
        "acftc bench --realtime 10 --json > bench.json",
    ),
    short_help="Speed, start, latency, memory, measured.",
)
@click.option(
    "--realtime",
    "realtime_s",
    metavar="SECONDS",
    type=click.FloatRange(1.0, 86400.0),
    default=60.0,
    show_default=True,
    help="Length of the run at 100 Hz, s.",
)
@click.option(
    "--ticks",
    metavar="N",
    type=click.IntRange(10, 10**6),
    default=1000,
    show_default=True,
    help="Ticks of each lockstep run.",
)
@json_option
def bench(realtime_s: float, ticks: int, as_json: bool) -> None:
    """Measure the graph beside a bare chain of processes that moves the same messages and computes nothing.

    Takes some three minutes, and wants the machine for itself. Exit code 1 when a limit is missed.
    """
    from bringup.benchmarks.figures import as_dicts
    from bringup.benchmarks.figures import bench as measure

    figures = measure(ticks=ticks, realtime_s=realtime_s, say=say)
    if as_json:
        print_json(as_dicts(figures))
    else:
        rows = []
        for figure in figures:
            limit = "" if figure.limit is None else f"{'>=' if figure.at_least else '<='} {figure.limit:g}"
            beside = "" if figure.reference is None else f"{figure.reference:.4g}"
            verdict = {None: "", True: "ok", False: "missed"}[figure.passed]
            rows.append([figure.name, f"{figure.ours:.4g} {figure.unit}", beside, limit, verdict])
        print_table(["", "ours", "beside", "limit", ""], rows)
    missed = [figure.name.strip() for figure in figures if figure.passed is False]
    if missed:
        msg = f"missed: {', '.join(missed)}"
        raise RunError(msg)
