"""`acftc reproduce`: the paper's experiments."""

from pathlib import Path

import click

from bringup.commands.options import examples
from bringup.commands.outcome import make_folder
from bringup.console import digits, print_table, say


@click.command(
    epilog=examples("acftc reproduce --out results/paper --cycle sc03.csv"),
    short_help="Run the paper's experiments E1-E8.",
)
@click.option("--out", metavar="DIR", type=click.Path(path_type=Path), default=Path("results/paper"), show_default=True)
@click.option(
    "--cycle",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Drive cycle for E8, CSV or EPA's two-column text; without it E8 is left out.",
)
def reproduce(out: Path, cycle: Path | None) -> None:
    """Run the paper's experiments E1-E8 in simulation and judge our numbers against the paper's.

    DIR gets a picture for each (e1.svg ... e8.svg), paper.json and index.html.
    """
    make_folder(out)
    from bringup.report.reproduce import reproduce as run_experiments

    experiments = run_experiments(out, cycle, say)
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
