"""`acftc report`: the report of a recorded run."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from ac_common.errors import UserError
from bringup.commands.console import print_json, say
from bringup.commands.options import bag_argument, examples, json_option, path_option
from bringup.commands.outcome import companion, make_folder, write_page

if TYPE_CHECKING:
    from ac_experiments.recording import Recording


@click.command(
    epilog=examples(
        "acftc report results/e5 # also when the run was cut short",
        "acftc report results/e5/bag --beside results/e5_passive/bag --out e5.html",
        "acftc report results/e5 --alone --json | jq .metrics",
    ),
    short_help="Write the report of a recorded run.",
)
@bag_argument
@path_option("--out", metavar="FILE", help="Default: report.html beside the bag.")
@path_option(
    "--beside",
    metavar="BAG",
    help="A passive (or active) run to draw beside this one. Default: a simulation of the same scenario.",
)
@click.option("--alone", is_flag=True, help="Draw no other run beside this one.")
@json_option
def report(bag: Path, out: Path | None, beside: Path | None, alone: bool, as_json: bool) -> None:
    """Write the report of a recorded run, also of one that was cut short.

    BAG is the folder of a run, its bag, or an .mcap file. FILE gets the report; pictures of the plots get its name with
    .svg and .png. With --json the key figures are printed as in summary.json.
    """
    from ac_experiments.bags.reader import read_bag
    from ac_experiments.metrics import summarise

    if alone and beside:
        msg = "--alone and --beside exclude each other"
        raise UserError(msg)
    target = out or _default(bag)
    if target.suffix != ".html":
        msg = f"--out {target}: the report's name must end in .html; its pictures get the same name with .svg and .png"
        raise UserError(msg)
    recording = read_bag(bag)
    if len(recording.time_s) == 0:
        msg = f"{bag}: holds no tick; the run was cut short before its first"
        raise UserError(msg)
    summary = summarise(recording)
    if beside:
        other: Recording | None = _other(recording, beside)
        note = f"Beside it: {beside}."
    else:
        other, note = (None, "") if alone else companion(recording)
    make_folder(target.resolve().parent)
    write_page(target, recording, bag, other, note)
    if as_json:
        print_json(summary)
    say(f"wrote {target}")


def _default(bag: Path) -> Path:
    """Put the report beside the bag: into the folder of the run."""
    folder = bag.resolve()
    return (folder if (folder / "bag").is_dir() else folder.parent) / "report.html"


def _other(recording: "Recording", beside: Path) -> "Recording":
    from ac_experiments.bags.reader import read_bag

    other = read_bag(beside)
    if bool(other.metadata["passive"]) == bool(recording.metadata["passive"]):
        kind = "passive" if other.metadata["passive"] else "active"
        msg = f"--beside {beside}: is a run with {kind} control as well; allowed: the other kind"
        raise UserError(msg)
    return other
