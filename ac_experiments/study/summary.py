"""What all runs of a study amount to: `study.json`."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ac_common.faults import BY_KIND
from ac_experiments.study import intervals
from ac_experiments.study.importance import Importance, rank_correlations, sobol_indices
from ac_experiments.study.outcomes import CORRECT, FALSE_ALARM, OUTCOMES
from ac_experiments.study.pod import FOUND, Pod, fit_pod
from ac_experiments.study.results import CHANGES
from ac_experiments.study.roc import Roc, roc
from ac_experiments.study.schema import FAULT, NO_FAULT, Study

Vector = NDArray[np.float64]
#: Figures that are compared with K0 alone.
BENEFITS = (
    *("iae_pressure_kpa_s", "iae_superheat_k_s", "peak_pressure_error_kpa", "peak_superheat_error_k"),
    *("compressor_kj", "cooling_kj", "cabin_c"),
)
#: What is asked what matters to it.
EXPLAINED = (
    *("isolation_delay_s", "iae_pressure_kpa_s", "iae_superheat_k_s", "peak_pressure_error_kpa"),
    *("peak_fault_free", "compressor_kj"),
)
#: Loads are told apart in so many classes with as many runs each.
LOADS = 3
WORST = 10


@dataclass(frozen=True)
class Runs:
    """All rows of a study, by column.

    Attributes
    ----------
    study : Study
    columns : dict of ndarray
        Numbers as floats with nan where there is none, texts as objects with None.
    """

    study: Study
    columns: Mapping[str, NDArray[Any]]

    def __len__(self) -> int:
        return len(self.columns["run"])

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.columns[name]

    def where(self, chosen: NDArray[np.bool_]) -> "Runs":
        """Return some of them."""
        return Runs(self.study, {name: values[chosen] for name, values in self.columns.items()})

    @property
    def kinds(self) -> list[str]:
        """Kinds of fault in them, in the order of `ac_common.faults`."""
        there = set(self["fault_kind"].tolist())
        return [kind for kind in BY_KIND if kind in there]

    def of_kind(self, kind: str) -> "Runs":
        """Return those with this kind of fault that could go on."""
        return self.where((self["fault_kind"] == kind) & (self["problem"] == ""))


def runs_of(study: Study, table: Any) -> Runs:
    """Return the rows of a pyarrow table."""
    columns: dict[str, NDArray[Any]] = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        if str(column.type) == "string":
            columns[name] = np.array(column.to_pylist(), dtype=object)
        else:
            columns[name] = column.to_numpy(zero_copy_only=False).astype(np.float64)
    return Runs(study, columns)


def summarise_study(runs: Runs) -> dict[str, Any]:
    """Return what a study amounts to, ready for JSON; the keys are those of docs/studies.md."""
    found: dict[str, Any] = clean(
        {
            "study": runs.study.name,
            "runs": len(runs),
            "seed": runs.study.seed,
            "outcomes": outcomes(runs),
            "confusion": confusion(runs),
            "false_alarms": false_alarms(runs),
            "delays": {kind: delays(runs.of_kind(kind)) for kind in runs.kinds},
            "roc": roc_summary(roc_of(runs)),
            "pod": {kind: pod_summary(runs.of_kind(kind)) for kind in runs.kinds},
            "smallest_by_load": {kind: by_load(runs.of_kind(kind)) for kind in runs.kinds},
            "benefit": {kind: benefit(_with(runs, kind)) for kind in (NO_FAULT, *runs.kinds)}
            if runs.study.k0_alone
            else {},
            "changes": {kind: changes(runs.of_kind(kind)) for kind in runs.kinds} if runs.study.fault_free else {},
            "what_matters": {name: [one._asdict() for one in rows] for name, rows in importance(runs).items()},
            "worst": worst(runs) if len(runs) else [],
        }
    )
    return found


def clean(value: Any) -> Any:
    """Return plain data for JSON: None in place of nan, "inf" of infinity, lists for tuples."""
    if isinstance(value, Mapping):
        return {str(key): clean(item) for key, item in value.items()}
    if isinstance(value, intervals.Interval):
        return {key: clean(item) for key, item in value._asdict().items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [clean(item) for item in value]
    if isinstance(value, float | np.floating):
        number = float(value)
        return None if math.isnan(number) else ("inf" if number > 0 else "-inf") if math.isinf(number) else number
    return value.item() if isinstance(value, np.generic) else value


def _with(runs: Runs, kind: str) -> Runs:
    return runs.where((runs["fault_kind"] == kind) & (runs["problem"] == ""))


def outcomes(runs: Runs) -> dict[str, dict[str, Any]]:
    """Return for runs without a fault, and with each kind, how many had each outcome, and their share."""
    found = {}
    for kind in (NO_FAULT, *runs.kinds):
        of = runs["outcome"][runs["fault_kind"] == kind]
        counts = {name: int((of == name).sum()) for name in OUTCOMES}
        if len(of):
            found[kind] = {"runs": len(of), **counts, "correct_share": intervals.share(counts[CORRECT], len(of))}
    return found


def confusion(runs: Runs) -> dict[str, dict[str, int]]:
    """Return for each fault that was there, how often each was told first.

    Returns
    -------
    dict
        By what was there; its columns: "alarm before", "none", "detected, not named", names of faults, "stopped".
    """
    found: dict[str, dict[str, int]] = {}
    for there, told in zip(runs["fault_kind"].tolist(), _told(runs), strict=True):
        row = found.setdefault(there, {})
        row[told] = row.get(told, 0) + 1
    return found


def _told(runs: Runs) -> list[str]:
    """Return what was told first in each run."""
    columns = (runs["problem"], runs["outcome"], runs["isolated_as"], runs["detection_delay_s"])
    told = []
    for problem, outcome, named, delay in zip(*(column.tolist() for column in columns), strict=True):
        if problem:
            told.append("stopped")
        elif outcome == FALSE_ALARM:
            told.append("alarm before")
        else:
            told.append(named or ("none" if math.isnan(delay) else "detected, not named"))
    return told


def apart(runs: Runs) -> Runs:
    """Return the runs whose time without a fault is not that of another one, too.

    Runs of one pass through the grids that differ in the fault alone are the same until it begins: of these the one in
    which that is the latest.
    """
    drawn = [name for name in runs.columns if name.startswith("drawn.") and name.split(".")[1] != FAULT]
    same = list(zip(runs["run"] // runs.study.cells, *(runs[name].tolist() for name in drawn), strict=True))
    latest: dict[tuple[Any, ...], int] = {}
    for at in np.argsort(runs["fault_free_s"], kind="stable"):
        latest[same[at]] = int(at)
    chosen = np.zeros(len(runs), dtype=np.bool_)
    chosen[list(latest.values())] = True
    return runs.where(chosen)


def false_alarms(runs: Runs) -> dict[str, Any]:
    """Return false alarms per hour without a fault, with the exact Poisson interval; no time counts twice."""
    going = apart(runs.where(runs["problem"] == ""))
    count, hours = int(going["false_alarms"].sum()), float(going["fault_free_s"].sum()) / 3600.0
    return {"count": count, "hours": hours, "per_hour": intervals.rate(count, hours)}


def delays(runs: Runs) -> dict[str, Any]:
    """Return median and 95 % quantile of both delays, s; what was not found counts as later than all that was."""
    runs = runs.where(runs["outcome"] != FALSE_ALARM)
    right = runs["outcome"] == CORRECT
    found = {}
    for name, counts in (("detection", np.full(len(runs), True)), ("isolation", right)):
        seconds = np.where(counts, runs[f"{name}_delay_s"], np.nan)
        late = np.where(np.isnan(seconds), np.inf, seconds)
        found[name] = {
            "of": len(late),
            "found": int(np.isfinite(late).sum()),
            "median_s": intervals.quantile(late, 0.5),
            "quantile_95_s": intervals.quantile(late, 0.95),
        }
    return found


def roc_of(runs: Runs, kind: str | None = None) -> Roc | None:
    """Return the characteristic over a scale on the thresholds, of all faults or one kind of them."""
    faulty = runs["fault_kind"] != NO_FAULT if kind is None else runs["fault_kind"] == kind
    return roc(apart(runs)["peak_fault_free"], runs["peak_faulty"][faulty])


def roc_summary(curve: Roc | None) -> dict[str, Any]:
    """Return the area, and the rates at some scales."""
    if curve is None:
        return {}
    points = {}
    for scale in (0.5, 0.75, 1.0, 1.5, 2.0):
        at = int(np.searchsorted(curve.scale, scale, side="right")) - 1
        points[f"{scale:g}"] = {"false_alarms": curve.false_alarms[at], "detections": curve.detections[at]}
    return {"area": curve.area, "scales": points}


def _sizes_and_hits(runs: Runs, named: bool) -> tuple[Vector, NDArray[np.bool_]]:
    """Return sizes and which were found: detected, or named right; runs with an alarm before tell nothing of it."""
    runs = runs.where((runs["outcome"] != FALSE_ALARM) & (np.abs(runs["fault_size"]) > 0.0))
    hit = runs["outcome"] == CORRECT if named else np.isfinite(runs["detection_delay_s"])
    return np.abs(runs["fault_size"]), hit


def pod_of(runs: Runs, named: bool = False) -> Pod | None:
    """Return the probability of detection over size (`named`: of the right name first)."""
    return fit_pod(*_sizes_and_hits(runs, named))


def pod_summary(runs: Runs) -> dict[str, Any]:
    """Return the size found in 90 % of the runs, and at 95 % confidence, detected and named right."""
    found: dict[str, Any] = {"unit": BY_KIND[runs["fault_kind"][0]].unit} if len(runs) else {}
    for name, named in (("detected", False), ("named", True)):
        sizes, hit = _sizes_and_hits(runs, named)
        fitted = fit_pod(sizes, hit)
        found[name] = {
            "runs": len(hit),
            "found": int(hit.sum()),
            "a90": None if fitted is None else fitted.size(FOUND),
            "a90_95": None if fitted is None else fitted.size_at(FOUND),
            "largest_missed": float(sizes[~hit].max(initial=0.0)) or None,
            "smallest_found": float(sizes[hit].min()) if hit.any() else None,
        }
    return found


def by_load(runs: Runs) -> list[dict[str, Any]]:
    """Return the smallest size found by load: by operating point, or where they drive, by cooling in classes."""
    found = []
    for name, chosen in load_classes(runs):
        pod = pod_summary(runs.where(chosen))
        if pod:
            found.append({"load": name, "unit": pod["unit"], **pod["detected"]})
    return found


def load_classes(runs: Runs) -> list[tuple[str, NDArray[np.bool_]]]:
    """Return names and members of the classes of load."""
    points, load = runs["operating_point"], runs["load_kw"]
    if "operating_point" in runs.study.distributions:
        return [(point, points == point) for point in ("low", "med", "high") if (points == point).any()]
    known = load[np.isfinite(load)]
    if not len(known) or np.ptp(known) < 1e-3:
        return [("all", np.full(len(runs), True))] if len(runs) else []
    edges = np.quantile(known, np.arange(LOADS + 1) / LOADS)
    number = np.clip(np.searchsorted(edges, load, side="right") - 1, 0, LOADS - 1)
    classes = [(f"{edges[k]:.2f} to {edges[k + 1]:.2f} kW", number == k) for k in range(LOADS)]
    return [(name, chosen) for name, chosen in classes if chosen.any()]


def benefit(runs: Runs) -> dict[str, Any]:
    """Return pairwise what accommodation changes against K0 alone: the mean difference, and the ratio."""
    found = {}
    for name in BENEFITS:
        if name not in runs.columns or f"k0_{name}" not in runs.columns:
            continue
        with_it, alone = runs[name], runs[f"k0_{name}"]
        known = np.isfinite(with_it) & np.isfinite(alone)
        if not known.any():
            continue
        with_it, alone = with_it[known], alone[known]
        entry: dict[str, Any] = {"pairs": int(known.sum()), "difference": intervals.mean(with_it - alone)}
        if (alone > 0.0).all():
            ratio = with_it / alone
            worse = int((ratio > 1.0 + 1e-9).sum())
            entry |= {
                "ratio_median": intervals.quantile(ratio, 0.5),
                "ratio_worst": float(ratio.max()),
                "worse_share": intervals.share(worse, len(ratio)),
            }
        found[name] = entry
    return found


def changes(runs: Runs) -> dict[str, Any]:
    """Return what faults change against the same runs without them: median, 95 % quantile, largest."""
    found = {}
    for name in CHANGES:
        known = np.abs(runs[name][np.isfinite(runs[name])])
        if len(known):
            levels = {"median": intervals.quantile(known, 0.5), "quantile_95": intervals.quantile(known, 0.95)}
            found[name] = {**levels, "largest": float(known.max())}
    return found


def importance(runs: Runs) -> dict[str, list[Importance]]:
    """Return what matters to each figure that differs between runs."""
    study = runs.study
    drawn = {key: runs[f"drawn.{key}"] for key, one in study.distributions.items() if one.is_number}
    found = {}
    for name in EXPLAINED:
        figure = runs[name].astype(np.float64)
        if study.sampling == "saltelli":
            if np.isfinite(figure).all() and np.ptp(figure) > 0.0:
                found[name] = sobol_indices(list(study.drawn), figure, study.seed)
        elif rows := rank_correlations(drawn, figure):
            found[name] = rows
    return found


def worst(runs: Runs, many: int = WORST) -> list[dict[str, Any]]:
    """Return the worst runs: by outcome, then by what accommodation costs, or the errors of the loop."""
    iae = runs["iae_pressure_kpa_s"]
    harm = iae / runs["k0_iae_pressure_kpa_s"] if runs.study.k0_alone else iae
    rank = np.array([OUTCOMES.index(outcome) for outcome in runs["outcome"].tolist()])
    order = np.lexsort((runs["run"], -np.nan_to_num(harm, nan=np.inf), -rank))[:many]
    names = ("fault_kind", "fault_size", "outcome", "isolated_as", "false_alarms", "iae_pressure_kpa_s", "problem")
    return [{"run": int(runs["run"][i]), **{name: runs[name][i] for name in names}, "harm": harm[i]} for i in order]
