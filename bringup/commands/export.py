"""`acftc export`: a recorded run as a table for other programs."""

from pathlib import Path

import click

from ac_common.errors import UserError
from bringup.commands.console import say
from bringup.commands.extras import need
from bringup.commands.options import OneOf, bag_argument, examples, path_option
from bringup.commands.outcome import beside_bag, make_folder

#: What a run can be taken along as; the same as `FORMS` of `ac_experiments.bags.export`, which is heavy to import.
FORMS = ("csv", "parquet", "mat")


@click.command(
    epilog=examples(
        "acftc export results/e5 --to csv # results/e5/run.csv",
        "acftc export results/e5 --to mat --out e5.mat # for MATLAB and Octave",
        "acftc export results/e5/bag --to parquet # for pandas, polars, R, DuckDB",
    ),
    short_help="Write a recorded run as a table: csv, parquet or mat.",
)
@bag_argument
@click.option("--to", "form", required=True, type=OneOf(FORMS), help=f"One of {', '.join(FORMS)}.")
@path_option("--out", metavar="FILE", help="Default: run.csv, run.parquet or run.mat beside the bag.")
def export(bag: Path, form: str, out: Path | None) -> None:
    """Write a recorded run, also one that was cut short, as a table: a row for each tick, a column for each signal.

    BAG is the folder of a run, its bag, or an .mcap file. The columns are named after the topics, with the unit at the
    end: plant_evaporator_pressure_pa, controller_command_compressor_rad_s. Values are SI, temperatures of air and wall
    in degrees Celsius.
    """
    if form == "parquet":
        need("export", pyarrow="pyarrow")
    from ac_experiments.bags.export import export as write
    from ac_experiments.bags.reader import read_bag

    target = out or beside_bag(bag, f"run.{form}")
    if target.is_dir():
        msg = f"--out {target}: is a folder; give the name of a file"
        raise UserError(msg)
    recording = read_bag(bag)
    make_folder(target.resolve().parent)
    write(recording, target, form)
    say(f"wrote {target}")
