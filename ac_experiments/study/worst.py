"""The worst case within the bounds of a study, searched for by differential evolution.

Storn and Price, Journal of Global Optimization 11 (1997) 341, as scipy has it. A generation is played as one batch of
runs on Dask; the same study, metric and number of runs give the same case on any number of workers.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ac_common.errors import UserError
from ac_common.yaml_file import parsed
from ac_experiments.schema_part import unknown
from ac_experiments.study.cases import Case, Cases
from ac_experiments.study.engine import opened_client
from ac_experiments.study.results import columns_of
from ac_experiments.study.runs import Row, row_of
from ac_experiments.study.sampling import generator
from ac_experiments.study.schema import Study, check_study, study_yaml

#: Metrics beside the columns of numbers, and what they stand for.
NAMED = {
    "near_false_alarm": "peak of the decision's statistic while no fault is there, 1: an alarm",
    "harm": "IAE of the evaporator pressure over that of K0 alone",
}
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Worst:
    """What a search has found.

    Attributes
    ----------
    case : Case
    value : float
        Of the metric.
    row : dict
        All figures of that run.
    tried : int
        Runs.
    """

    case: Case
    value: float
    row: Row
    tried: int


def check_metric(study: Study, metric: str) -> None:
    """Refuse a metric that no run has; raises UserError."""
    numbers = [name for name, kind in columns_of(study).items() if kind != "string" and not name.startswith("drawn.")]
    known = [*NAMED, *numbers]
    if metric not in known:
        raise UserError(f"--metric: {unknown('metric', metric, known)}")
    if not study.vary:
        raise UserError(f"study {study.name}: nothing varies, so nothing can be searched for")


def needs_k0_alone(metric: str) -> bool:
    """Whether K0 alone must run beside each run."""
    return metric == "harm" or metric.startswith("k0_")


def value_of(row: Row, metric: str) -> float:
    """Return the metric of a run; nan where it has none."""
    if metric == "harm":
        alone = row.get("k0_iae_pressure_kpa_s")
        return math.nan if not alone else float(row["iae_pressure_kpa_s"]) / float(alone)
    value = row.get("peak_fault_free" if metric == "near_false_alarm" else metric)
    return math.nan if value is None else float(value)


def place_case(cases: Cases, place: Sequence[float]) -> Case:
    """Return the case at a place in the unit cube of all that varies; of a family of drives the first one.

    The last coordinate picks the drive where the scenario is of the random family.
    """
    distributions = cases.study.distributions
    values = {key: one.at(float(share)) for (key, one), share in zip(distributions.items(), place, strict=False)}
    replicates = -(-cases.study.runs // cases.study.cells)
    chosen = min(int(float(place[-1]) * replicates), replicates - 1) if cases.study.is_family else 0
    return cases.with_values(chosen * cases.study.cells, values)


@lru_cache(maxsize=2)
def _cases(text: str) -> Cases:
    return Cases(check_study(parsed(text, "study")))


def play_place(text: str, place: Sequence[float], k0_alone: bool) -> Row:
    """Play the case at a place: what a worker does."""
    from ac_common.blas_threads import one_blas_thread

    one_blas_thread()
    return row_of(place_case(_cases(text), place), k0_alone)


def search(
    study: Study,
    metric: str,
    runs: int,
    least: bool = False,
    scheduler: str | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Worst:
    """Search for the case with the largest value of a metric (`least`: the smallest) in about so many runs.

    Raises
    ------
    UserError
        For a metric that there is not, or a study in which nothing varies.
    RunError
        When no run had the metric.
    """
    from scipy.optimize import differential_evolution

    check_metric(study, metric)
    dimensions = len(study.distributions) + study.is_family
    members = max(5, min(10 * dimensions, runs // 4))
    text, k0_alone = study_yaml(study), study.k0_alone or needs_k0_alone(metric)
    sign = 1.0 if least else -1.0
    tried = 0

    with opened_client(scheduler, workers) as client:

        def play(_: Any, places: Iterable[NDArray[np.float64]]) -> list[float]:
            nonlocal tried
            futures = [client.submit(play_place, text, place.tolist(), k0_alone, pure=False) for place in places]
            values = [value_of(row, metric) for row in client.gather(futures)]
            tried += len(futures)
            if progress is not None:
                progress(min(tried, runs), runs)
            return [math.inf if math.isnan(value) else sign * value for value in values]

        found = differential_evolution(
            lambda place: math.nan,  # noqa: ARG005  (`play` computes them all)
            [(0.0, 1.0)] * dimensions,
            popsize=1,
            init=np.random.default_rng(study.seed).random((members, dimensions)),
            maxiter=max(1, runs // members - 1),
            tol=0.0,
            polish=False,
            **generator(study.seed),
            updating="deferred",
            workers=play,
        )
        row = client.submit(play_place, text, found.x.tolist(), k0_alone, pure=False).result()
    if not math.isfinite(found.fun):
        raise UserError(f"study {study.name}: no run of {tried} had the metric {metric}")
    return Worst(place_case(Cases(study), found.x.tolist()), value_of(row, metric), row, tried)
