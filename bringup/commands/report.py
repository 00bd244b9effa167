"""`acftc report`: the report of a recorded run."""

from pathlib import Path

import click

from bringup.commands.options import bag_argument, examples
from bringup.commands.outcome import companion, make_folder, node_health
from bringup.console import say
from bringup.errors import BringupError


@click.command(
    epilog=examples("acftc report results/e5/bag --out e5.html"), short_help="Write the report of a recorded run."
)
@bag_argument
@click.option("--out", metavar="FILE", type=click.Path(path_type=Path), help="Default: report.html beside the bag.")
@click.option(
    "--beside",
    metavar="BAG",
    type=click.Path(path_type=Path),
    help="A passive (or active) run to draw beside this one. Default: a simulation of the same scenario.",
)
def report(bag: Path, out: Path | None, beside: Path | None) -> None:
    """Write the report of a recorded run, also of one that was cut short."""
    from bringup.bags.reader import read_bag
    from bringup.report.page import write_report

    recording = read_bag(bag)
    other, note = (read_bag(beside), f"Beside it: {beside}.") if beside else companion(recording)
    target = out or bag.resolve().parent / "report.html"
    if target.suffix != ".html":
        msg = f"--out {target}: the report's name must end in .html; its picture gets the same name with .svg"
        raise BringupError(msg)
    make_folder(target.resolve().parent)
    write_report(target, recording, other, note, node_health(bag))
    say(f"wrote {target}")
