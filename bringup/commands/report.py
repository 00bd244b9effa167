"""`acftc report`: the report of a recorded run."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from ac_common import collector
from ac_common.errors import UserError
from bringup.commands.console import print_json, say
from bringup.commands.options import SomePath, examples, json_option, path_option
from bringup.commands.outcome import beside_bag, companion, make_folder, write_page

if TYPE_CHECKING:
    from ac_experiments.bags.reader import RawBag
    from ac_experiments.recording import Recording


@click.command(
    epilog=examples(
        "acftc report results/e5 # also when the run was cut short",
        "acftc report results/e5/bag --beside results/e5_passive/bag --out e5.html",
        "acftc report results/e5 results/e5_passive results/weak # any runs beside each other",
        "acftc report results/e5 --alone --json | jq .metrics",
    ),
    short_help="Write the report of a recorded run.",
)
@click.argument("bags", metavar="BAG [BAG ...]", nargs=-1, required=True, type=SomePath(path_type=Path))
@path_option("--out", metavar="FILE", help="Default: report.html beside the bag, of several comparison.html.")
@path_option(
    "--beside",
    metavar="BAG",
    help="A passive (or active) run to draw beside this one. Default: a simulation of the same scenario.",
)
@click.option("--alone", is_flag=True, help="Draw no other run beside this one.")
@json_option
def report(bags: tuple[Path, ...], out: Path | None, beside: Path | None, alone: bool, as_json: bool) -> None:
    """Write the report of a recorded run, also of one that was cut short, or of several beside each other.

    BAG is the folder of a run, its bag, or an .mcap file. FILE gets the report; pictures of the plots get its name with
    .svg and .png. With --json the key figures are printed as in summary.json, those of several runs as a list.
    """
    from ac_experiments.metrics import summarise

    if alone and beside:
        msg = "--alone and --beside exclude each other"
        raise UserError(msg)
    bag, *others = bags
    target = out or beside_bag(bag, "comparison.html" if others else "report.html")
    if target.suffix != ".html":
        msg = f"--out {target}: the report's name must end in .html; its pictures get the same name with .svg and .png"
        raise UserError(msg)
    if others:
        if alone or beside:
            msg = "--alone and --beside: only with one BAG; several are drawn beside each other"
            raise UserError(msg)
        _compare(bags, target, as_json)
        return
    with collector.paused():
        raw, recording = _whole(bag)
        summary = summarise(recording)
        if beside:
            other: Recording | None = _other(recording, beside)
            note = f"Beside it: {beside}."
        else:
            other, note = (None, "") if alone else companion(recording)
        make_folder(target.resolve().parent)
        write_page(target, recording, raw, other, note)
    if as_json:
        print_json(summary)
    say(f"wrote {target}")


def _compare(bags: tuple[Path, ...], target: Path, as_json: bool) -> None:
    from ac_experiments.report.comparison import MOST_RUNS, named, write_comparison

    if len(bags) > MOST_RUNS:
        msg = f"{len(bags)} runs given; allowed: {MOST_RUNS} at most"
        raise UserError(msg)
    runs = named([(str(bag), _whole(bag)[1]) for bag in bags])
    make_folder(target.resolve().parent)
    write_comparison(target, runs)
    if as_json:
        print_json([{"run": run.name, **run.summary} for run in runs])
    say(f"wrote {target}")


def _whole(bag: Path) -> "tuple[RawBag, Recording]":
    from ac_experiments.bags.reader import read_raw, recording_of

    raw = read_raw(bag)
    recording = recording_of(raw, bag)
    if len(recording.time_s) == 0:
        msg = f"{bag}: holds no tick; the run was cut short before its first"
        raise UserError(msg)
    return raw, recording


def _other(recording: "Recording", beside: Path) -> "Recording":
    from ac_experiments.bags.reader import read_bag

    other = read_bag(beside)
    if bool(other.metadata["passive"]) == bool(recording.metadata["passive"]):
        kind = "passive" if other.metadata["passive"] else "active"
        msg = f"--beside {beside}: is a run with {kind} control as well; allowed: the other kind"
        raise UserError(msg)
    return other
