"""`study.html`: what a study amounts to, as a page that needs nothing else."""

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from ac_common.faults import BY_KIND
from ac_experiments.report.embedded import Plots
from ac_experiments.report.narrative import Sentence
from ac_experiments.report.page import PAGE
from ac_experiments.report.parts import Part, Section, Table, Words, cell, code, render_page
from ac_experiments.study.charts import charts_of
from ac_experiments.study.engine import Timing
from ac_experiments.study.outcomes import CORRECT, FALSE_ALARM, MEANINGS, OUTCOMES
from ac_experiments.study.schema import NO_FAULT, study_yaml
from ac_experiments.study.summary import Runs

_UNITS = {
    "kpa_s": "kPa s",
    "k_s": "K s",
    "kpa": "kPa",
    "k": "K",
    "kj": "kJ",
    "rpm": "rpm",
    "c": "°C",
    "kw": "kW",
    "s": "s",
}


def study_page(runs: Runs, summary: Mapping[str, Any], where: str, timing: Timing | None = None) -> str:
    """Return the text of the page.

    Parameters
    ----------
    runs
        All rows.
    summary
        As `summarise_study` returns it.
    where
        The folder, as commands are to name it.
    timing
        How it went.
    """
    plots = Plots(None)
    charts = charts_of(runs)
    hint = "Drag to zoom, double-click to see all again; a click on a name in a legend hides its line."
    curves: list[Part] = [Words(hint, "hint"), plots.put(charts, "", f"Curves of {runs.study.name}")] if charts else []
    sections = [
        Section("outcomes", "Outcomes", _outcomes(summary)),
        Section("curves", "Curves", curves),
        Section("confusion", "What was there, and what was told first", _confusion(summary)),
        Section("alarms", "False alarms", _alarms(summary)),
        Section("delays", "Delays", _delays(summary)),
        Section("sizes", "Sizes that are found", _sizes(summary)),
        Section("roc", "Scale on the thresholds", _scales(summary)),
        Section("benefit", "What accommodation buys and costs", _benefit(summary)),
        Section("changes", "What a fault changes", _changes(summary)),
        Section("matters", "What matters", _matters(summary, runs)),
        Section("worst", "The worst runs", _worst(summary, where)),
        Section("study", "The study", [Words(study_yaml(runs.study), "code")]),
    ]
    return render_page(
        PAGE,
        title=runs.study.name,
        description=runs.study.description,
        story=_story(summary),
        facts=_facts(runs, timing),
        sections=[section for section in sections if section.parts],
        script=plots.script() if charts else "",
    )


def name_of(kind: str) -> str:
    """Return a kind of fault as tables show it."""
    return "no fault" if kind == NO_FAULT else BY_KIND[kind].name if kind in BY_KIND else kind


def _facts(runs: Runs, timing: Timing | None) -> list[tuple[str, str]]:
    facts = [("Runs", str(len(runs))), ("Seed", str(runs.study.seed)), ("Sampling", runs.study.sampling)]
    seconds = float(runs["duration_s"].sum()) * (2.0 if runs.study.k0_alone else 1.0)
    facts.append(("Simulated", f"{seconds / 3600.0:.1f} h"))
    if timing is not None and timing.runs and timing.wall_s > 0.0:
        busy = timing.busy_s / (timing.wall_s * max(timing.workers, 1))
        facts.append(("Played last", f"{timing.runs} runs in {timing.wall_s:.0f} s on {timing.workers} workers"))
        facts.append(("Workers busy with runs", f"{100.0 * busy:.0f} %"))
    return facts


def _story(summary: Mapping[str, Any]) -> list[Sentence]:
    """Return the study in a few sentences."""
    alarms = summary["false_alarms"]
    rate = alarms["per_hour"]
    told = (
        f"{alarms['count']} false alarms in {alarms['hours']:.1f} fault-free hours: at most "
        f"{_number(rate['high'], '.3g')} an hour (95 %, both sides)."
    )
    sentences = [Sentence("good" if alarms["count"] == 0 else "bad", told)]
    for kind, found in summary["outcomes"].items():
        if kind == NO_FAULT:
            continue
        shares = found["correct_share"]
        words = f"{name_of(kind)}: {found[CORRECT]} of {found['runs']} named right"
        late = summary["delays"].get(kind, {}).get("isolation", {}).get("median_s", {}).get("value")
        words += "" if not isinstance(late, float) else f", half of all runs within {late:.1f} s"
        good = shares["value"] is not None and shares["value"] >= 0.95
        sentences.append(Sentence("good" if good else "plain", words[0].upper() + words[1:] + "."))
    return sentences


def _number(value: Any, digits: str) -> str:
    """Format a number of `study.json`, where infinity is a word."""
    return "∞" if value == "inf" else "−∞" if value == "-inf" else cell(value, digits)


def interval_text(entry: Mapping[str, Any], digits: str) -> str:
    """Return an estimate of `study.json` with its interval."""
    return f"{_number(entry['value'], digits)} ({_number(entry['low'], digits)} to {_number(entry['high'], digits)})"


def _percent(entry: Mapping[str, Any]) -> str:
    scaled = {key: None if value is None else 100.0 * value for key, value in entry.items()}
    return interval_text(scaled, ".1f")


def _outcomes(summary: Mapping[str, Any]) -> list[Part]:
    heads = ["", "Runs", *(name.capitalize() for name in OUTCOMES), "Correct, % (95 % interval)"]
    rows = [
        [name_of(kind), str(of["runs"]), *(str(of[name]) for name in OUTCOMES), _percent(of["correct_share"])]
        for kind, of in summary["outcomes"].items()
    ]
    words = "; ".join(f"{name}: {meaning}" for name, meaning in MEANINGS.items())
    return [Table(heads, rows), Words(f"{words}. The interval is that of Clopper and Pearson.", "note")]


def _confusion(summary: Mapping[str, Any]) -> list[Part]:
    matrix = summary["confusion"]
    told = sorted({name for row in matrix.values() for name in row}, key=_order)
    heads = ["There was", *map(_told, told)]
    rows: list[list[str | Markup]] = []
    for kind in sorted(matrix, key=_order):
        row, of = matrix[kind], sum(matrix[kind].values())
        rows.append([name_of(kind), *(_shaded(row.get(name, 0), of) for name in told)])
    return [Table(heads, rows)]


_TOLD = ("none", "alarm before", "detected, not named")


def _order(name: str) -> tuple[int, str]:
    kinds = list(BY_KIND)
    if name in _TOLD:
        return _TOLD.index(name), ""
    return (len(_TOLD) + kinds.index(name), "") if name in kinds else (1000, name)


def _told(name: str) -> str:
    return name_of(name) if name in BY_KIND else name


def _shaded(count: int, of: int) -> Markup:
    """Return a cell whose shade is its share of the row."""
    style = f"background:rgba(0,114,178,{0.6 * count / max(of, 1):.2f});padding:0 .6rem"
    return Markup('<span style="{}">{}</span>').format(style, count)


def _alarms(summary: Mapping[str, Any]) -> list[Part]:
    alarms = summary["false_alarms"]
    text = (
        f"{alarms['count']} in {alarms['hours']:.2f} hours without a fault (whole runs without one, and the time "
        f"before the onset): {interval_text(alarms['per_hour'], '.3g')} an hour, the exact interval of a Poisson count."
    )
    return [Words(text)]


def _delays(summary: Mapping[str, Any]) -> list[Part]:
    rows = []
    for kind, both in summary["delays"].items():
        for name, found in both.items():
            row = [name_of(kind), {"detection": "detected", "isolation": "named right"}[name]]
            row += [f"{found['found']} of {found['of']}", interval_text(found["median_s"], ".1f")]
            rows.append([*row, interval_text(found["quantile_95_s"], ".1f")])
    if not rows:
        return []
    note = (
        "Seconds from the onset; intervals at 95 % between order statistics, whatever the distribution. What was not "
        "found counts as later than all that was: ∞ means that too few were. Runs with an alarm before are left out."
    )
    return [Table(["Fault", "", "Found", "Median, s", "95 %, s"], rows), Words(note, "note")]


def _sizes(summary: Mapping[str, Any]) -> list[Part]:
    rows = []
    for kind, pod in summary["pod"].items():
        for name, words in (("detected", "detected"), ("named", "named right")):
            if name in pod:
                rows.append([name_of(kind), "all", words, *_size_cells(pod[name], pod["unit"])])
        classes = summary["smallest_by_load"].get(kind, [])
        if len(classes) > 1:
            rows += [[name_of(kind), one["load"], "detected", *_size_cells(one, one["unit"])] for one in classes]
    if not rows:
        return []
    note = Markup(
        "a<sub>90</sub>: the size found in 90 % of the runs; a<sub>90/95</sub>: at 95 % confidence (MIL-HDBK-1823A, "
        "logit over the logarithm of size, likelihood ratio). A dash: the sizes drawn have no curve, for instance "
        "because all were found."
    )
    heads: list[str | Markup] = ["Fault", "Load", "", "Found", Markup("a<sub>90</sub>"), Markup("a<sub>90/95</sub>")]
    return [Table([*heads, "Largest missed", "Smallest found"], rows), Words(note, "note")]


def _size_cells(found: Mapping[str, Any], unit: str) -> list[str]:
    keys = ("a90", "a90_95", "largest_missed", "smallest_found")
    values = [_number(found[key], ".3g") for key in keys]
    shown = [value if value in ("–", "∞") else f"{value} {unit}" for value in values]
    return [f"{found['found']} of {found['runs']}", *shown]


def _scales(summary: Mapping[str, Any]) -> list[Part]:
    curve = summary["roc"]
    if not curve:
        return []
    rows = [
        [f"{float(scale):g}", f"{100.0 * at['false_alarms']:.1f}", f"{100.0 * at['detections']:.1f}"]
        for scale, at in curve["scales"].items()
    ]
    note = (
        "From the peak of the decision's statistic in each run, without running anything again. Area under the curve: "
        f"{interval_text(curve['area'], '.4f')}. With `design: envelope` it is about the estimates' thresholds alone; "
        "its decision goes by likelihoods, too."
    )
    heads = ["Thresholds times", "Fault-free stretches alarmed, %", "Faults detected, %"]
    return [Table(heads, rows), Words(note, "note")]


def _benefit(summary: Mapping[str, Any]) -> list[Part]:
    rows = []
    for kind, figures in summary["benefit"].items():
        for name, found in figures.items():
            text, unit = _figure(name)
            ratio, worse = found.get("ratio_median"), found.get("worse_share")
            row = [name_of(kind), f"{text}, {unit}", str(found["pairs"]), interval_text(found["difference"], ".3g")]
            row += ["–", "–", "–"] if ratio is None or worse is None else [
                interval_text(ratio, ".3g"), cell(found["ratio_worst"], ".3g"), _percent(worse)
            ]  # fmt: skip
            rows.append(row)
    if not rows:
        return []
    heads = ["Fault", "Figure, from the onset on", "Pairs", "Mean difference", "Ratio, median", "Worst", "Worse, %"]
    note = "With accommodation against K0 alone in the same run: difference, and ratio; intervals at 95 %."
    return [Table(heads, rows), Words(note, "note")]


def _changes(summary: Mapping[str, Any]) -> list[Part]:
    rows = []
    for kind, figures in summary["changes"].items():
        for name, found in figures.items():
            text, unit = _figure(name)
            levels = [interval_text(found[level], ".3g") for level in ("median", "quantile_95")]
            rows.append([name_of(kind), f"{text}, {unit}", *levels, cell(found["largest"], ".3g")])
    if not rows:
        return []
    note = (
        "Against the same run without the fault, magnitudes: from the onset on, and (late) from 60 s after it on; the "
        "speed is the mean of the command. Intervals at 95 %."
    )
    return [Table(["Fault", "Figure", "Median", "95 %", "Largest"], rows), Words(note, "note")]


def _figure(name: str) -> tuple[str, str]:
    """Return name and unit of a column, for people."""
    for suffix in sorted(_UNITS, key=len, reverse=True):
        if name.endswith(f"_{suffix}"):
            return name.removesuffix(f"_{suffix}").replace("_", " ").replace("iae", "IAE of"), _UNITS[suffix]
    return name.replace("_", " "), "1"


def _matters(summary: Mapping[str, Any], runs: Runs) -> list[Part]:
    rows: list[list[str | Markup]] = []
    sobol = runs.study.sampling == "saltelli"
    for name, found in summary["what_matters"].items():
        text, _ = _figure(name)
        ordered = sorted(found, key=lambda one: -abs(_size(one["total"] if sobol else one["first"])))
        for one in ordered[:6]:
            first = f"{cell(one['first'], '.2f')} ± {cell(one['first_error'], '.2f')}"
            total = f"{cell(one['total'], '.2f')} ± {cell(one['total_error'], '.2f')}" if sobol else "–"
            rows.append([text, code(one["name"]), first, total, _bar(_size(one["total"] if sobol else one["first"]))])
    if not rows:
        return []
    heads = ["Figure", "Varied", "First order" if sobol else "Rank correlation", "Total", ""]
    note = "Sobol's indices: shares of the variance." if sobol else "Spearman's rank correlation; intervals at 95 %."
    return [Table(heads, rows), Words(note, "note")]


def _size(value: float | None) -> float:
    return 0.0 if value is None else value


def _bar(value: float) -> Markup:
    colour = "#0072b2" if value >= 0.0 else "#d55e00"
    style = f"display:inline-block;height:.7rem;width:{8.0 * min(abs(value), 1.0):.2f}rem;background:{colour}"
    return Markup('<span style="{}"></span>').format(style)


def _worst(summary: Mapping[str, Any], where: str) -> list[Part]:
    rows: list[Sequence[str | Markup]] = []
    for run in summary["worst"]:
        size = "" if run["fault_size"] is None else f" {run['fault_size']:.3g} {BY_KIND[run['fault_kind']].unit}"
        outcome = run["outcome"] + (f" as {run['isolated_as']}" if run["isolated_as"] else "")
        outcome = f"{run['false_alarms']} false alarms" if run["outcome"] == FALSE_ALARM else outcome
        command = code(f"acftc study rerun {where} {run['run']}")
        told = run["problem"] or outcome
        rows.append([str(run["run"]), name_of(run["fault_kind"]) + size, told, _number(run["harm"], ".3g"), command])
    if not rows:
        return []
    note = "By outcome, then by the error of the evaporator pressure: its IAE over K0 alone's, or itself."
    return [Table(["Run", "Fault", "Outcome", "Error", "Again"], rows), Words(note, "note")]
