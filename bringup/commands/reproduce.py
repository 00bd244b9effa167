"""`acftc reproduce`: the paper's experiments."""

import json
from pathlib import Path

import click

from bringup.commands.console import digits, print_json, print_table, progress_bar, say, steps_of
from bringup.commands.options import examples, json_option, path_option
from bringup.commands.outcome import make_folder

#: How many experiments there are, E1 to E8.
EXPERIMENTS = 8


@click.command(
    epilog=examples(
        "acftc reproduce --out results/paper # results/paper/index.html shows it",
        "acftc reproduce --cycle sc03.csv --json | jq '.E5.findings[] | {quantity, paper, ours, verdict}'",
    ),
    short_help="Run the paper's experiments E1-E8.",
)
@path_option("--out", metavar="DIR", default=Path("results/paper"), show_default=True)
@path_option(
    "--cycle", metavar="FILE", help="Drive cycle for E8, CSV or EPA's two-column text; without it E8 is left out."
)
@json_option
def reproduce(out: Path, cycle: Path | None, as_json: bool) -> None:
    """Run the paper's experiments E1-E8 in simulation and judge our numbers against the paper's.

    DIR gets a picture for each (e1.svg ... e8.svg), paper.json and index.html. A verdict "differs" is a finding, not a
    failure: the exit code tells whether the experiments could be run.
    """
    make_folder(out)
    from ac_experiments.paper.reproduce import reproduce as run_experiments

    with progress_bar("E1 to E8") as progress:
        experiments = run_experiments(out, cycle, say if progress is None else steps_of(progress, EXPERIMENTS))
    if as_json:
        print_json(json.loads((out / "paper.json").read_text(encoding="utf-8")))
        return
    rows = []
    for experiment in experiments:
        rows.append([experiment.id, experiment.title, "", "", experiment.verdict])
        for item in experiment.findings:
            ours, paper = f"{digits(item.ours)} {item.unit}", digits(item.paper)
            rows.append(["", item.quantity, paper, ours, item.verdict])
    print_table(["", "experiment", "paper", "ours", "verdict"], rows)
    for experiment in experiments:
        if not experiment.findings:
            say(f"{experiment.id}: {experiment.remark}")
    say(f"wrote {out / 'paper.json'} and {out / 'index.html'}")
