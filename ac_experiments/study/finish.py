"""What is written at the end of a study, beside its runs: `study.json`, `study.html`, a picture."""

import json
from typing import Any

from ac_common.yaml_file import parsed
from ac_experiments.report import matplotlib_charts
from ac_experiments.study.charts import charts_of
from ac_experiments.study.engine import Timing
from ac_experiments.study.page import study_page
from ac_experiments.study.results import STUDY, TIMING, Store
from ac_experiments.study.schema import check_study
from ac_experiments.study.summary import Runs, runs_of, summarise_study

SUMMARY, PAGE, PICTURE = "study.json", "study.html", "study.svg"


def read_runs(store: Store) -> Runs:
    """Return the study in a folder and all its runs.

    Raises
    ------
    UserError
        One line: what of it is not there.
    """
    return runs_of(check_study(parsed(store.read(STUDY).decode(), STUDY)), store.table())


def finish(store: Store) -> dict[str, Any]:
    """Write what the runs in a folder amount to, and return it.

    Raises
    ------
    RunError
        When it cannot be written: one line.
    """
    runs = read_runs(store)
    summary = summarise_study(runs)
    timing = Timing(**json.loads(store.read(TIMING))) if store.has(TIMING) else None
    store.write(SUMMARY, (json.dumps(summary, indent=2, allow_nan=False) + "\n").encode())
    store.write(PAGE, study_page(runs, summary, store.url, timing).encode())
    if charts := charts_of(runs):
        store.write(PICTURE, matplotlib_charts.draw(charts[:4], 2, f"Study {runs.study.name}").encode())
    return summary
