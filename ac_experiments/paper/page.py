"""All experiments of `acftc reproduce` on one page that needs nothing else."""

from pathlib import Path

from ac_experiments.paper.judgement import Experiment
from ac_experiments.report.parts import cell, render_page


def page(experiments: list[Experiment]) -> str:
    """Return the HTML of the page."""
    return render_page(Path(__file__).with_suffix(".html"), experiments=experiments, cell=cell)
