"""Several runs beside each other as a page that needs nothing else: what differs, what came of each, and the curves."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ac_common.faults import BY_KIND, called
from ac_common.files import write_whole
from ac_experiments.decisions import told_sure
from ac_experiments.metrics import summarise
from ac_experiments.recording import Recording
from ac_experiments.report.charts import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    Chart,
    Curve,
    Mark,
    kept_ticks,
    spaced,
)
from ac_experiments.report.embedded import Plots
from ac_experiments.report.moments import ONSET, around
from ac_experiments.report.narrative import BAD, GOOD, Sentence
from ac_experiments.report.page import METRICS, PAGE
from ac_experiments.report.panels import Line, Panel, panels_of, values_of
from ac_experiments.report.parts import Part, Section, Table, Words, cell, render_page
from ac_experiments.report.performance import performance_rows

#: How the curves of the runs look, one after the other.
LOOKS = (
    (BLUE, "solid"),
    (VERMILION, "dashdot"),
    (GREEN, "dash"),
    (PURPLE, "solid"),
    (ORANGE, "dashdot"),
    (SKY, "dash"),
)
MOST_RUNS = len(LOOKS)
#: Stretches around faults that get plots of their own.
MOST_DETAILS = 3
#: Of a panel the line of the run itself; the reference is drawn once.
_REFERENCES = {"p_e": "reference/evaporator_pressure", "SH": "reference/superheat"}
#: What of a scenario differs in any case, or says nothing of the run.
_NOT_COMPARED = ("name", "description")


@dataclass(frozen=True)
class Run:
    """A run under the name that it has on the page."""

    name: str
    recording: Recording
    summary: Mapping[str, Any]


def named(recordings: Sequence[tuple[str, Recording]]) -> list[Run]:
    """Return runs with names that tell them apart: what was given for each, less what all have in common."""
    given = [name for name, _ in recordings]
    short = [Path(name).name for name in given]
    names = short if len(set(short)) == len(short) else given
    if len(set(names)) < len(names):
        names = [f"{name} ({number})" for number, name in enumerate(names, start=1)]
    return [Run(name, run, summarise(run)) for name, (_, run) in zip(names, recordings, strict=True)]


def write_comparison(path: Path, runs: Sequence[Run]) -> None:
    """Write the page of several runs; the plots as still pictures beside it, as `write_report` does."""
    plots = Plots(path.with_suffix(""))
    sections = [
        Section("runs", "Runs", _runs(runs)),
        Section("figures", "Figures", _figures(runs)),
        Section("faults", "Faults", _faults(runs)),
        *_details(runs, plots),
        Section("run", "The whole runs", [plots.put(_charts(runs, None), "", "The whole runs", still_columns=3)]),
    ]
    page = render_page(
        PAGE,
        title=f"{len(runs)} runs compared",
        description=", ".join(run.name for run in runs),
        story=[sentence for run in runs for sentence in _story(run)],
        facts=[],
        sections=[section for section in sections if section.parts],
        script=plots.script(),
    )
    write_whole(path, page)


def _story(run: Run) -> Iterator[Sentence]:
    metrics, alarms = run.summary["metrics"], run.summary["false_alarms"]
    peak = cell(metrics["peak_pressure_error_kpa"], ".2f")
    found = sum(fault["isolated_as"] == fault["kind"] for fault in run.summary["faults"])
    faults = f"{found} of {len(run.summary['faults'])} faults isolated, " if run.summary["faults"] else ""
    false = f"{alarms or 'no'} false alarm{'' if alarms == 1 else 's'}"
    text = f"{run.name}: {faults}{false}, actual p_e off by up to {peak} kPa."
    yield Sentence(BAD if alarms or found < len(run.summary["faults"]) else GOOD, text)


def _runs(runs: Sequence[Run]) -> list[Part]:
    """Return what each run is, and in which keys of their scenarios they differ."""
    rows = [
        [
            run.name,
            run.summary["scenario"],
            {"simulate": "one process"}.get(run.summary["mode"], run.summary["mode"]),
            "K0 alone" if run.summary["passive"] else "accommodated",
            f"{run.summary['ticks'] * run.summary['sample_time_s']:g} s",
        ]
        for run in runs
    ]
    flat = [dict(_flat(run.recording.metadata["scenario"])) for run in runs]
    keys = list(dict.fromkeys(key for one in flat for key in one if key not in _NOT_COMPARED))
    differing = [[key, *(one.get(key, "–") for one in flat)] for key in keys if len({one.get(key) for one in flat}) > 1]
    table = Table(["Run", "Scenario", "Mode", "Control", "Length"], rows)
    if not differing:
        return [table, Words("The scenarios are the same.", "note")]
    heads = ["Scenario key", *(run.name for run in runs)]
    shown = Table(heads, differing[:MOST_KEYS])
    more = len(differing) - MOST_KEYS
    return [
        table,
        Words("Where the scenarios differ", "heading"),
        shown,
        *([Words(f"And {more} more.", "note")] if more > 0 else []),
    ]


#: A drive has hundreds of changes; so many differences are shown.
MOST_KEYS = 30


def _flat(value: Any, above: str = "") -> Iterator[tuple[str, str]]:
    """Give all dotted keys of a scenario with their values as texts."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else None
    if items is None:
        yield above.rstrip("."), str(value)
        return
    for key, item in items:
        yield from _flat(item, f"{above}{key}.")


def _figures(runs: Sequence[Run]) -> list[Part]:
    rows: list[list[Any]] = [
        [name, unit, *(cell(run.summary["metrics"][key], digits) for run in runs)]
        for key, name, unit, digits in METRICS
    ]
    rows.append(["False alarms", "", *(str(run.summary["false_alarms"]) for run in runs)])
    rows += performance_rows([run.recording for run in runs])
    note = "Performance: means over the whole run. The other figures are those of each run's own report."
    return [Table(["", "Unit", *(run.name for run in runs)], rows), Words(note, "note")]


def _faults(runs: Sequence[Run]) -> list[Part]:
    rows = [
        [
            run.name,
            f"{BY_KIND[fault['kind']].name}, {cell(fault['size'], 'g')} {fault['unit']}",
            f"{fault['onset_s']:g}",
            _after(fault, "detected_s"),
            _after(fault, "isolated_s") + told_sure(fault, fault["isolated_s"], fault["onset_s"], ", sure {:.1f}"),
            "–" if fault["isolated_as"] is None else called(fault["isolated_as"]),
            cell(fault["peak_pressure_error_kpa"], ".2f"),
            "stayed" if fault["settled_s"] == fault["onset_s"] else _after(fault, "settled_s"),
        ]
        for run in runs
        for fault in run.summary["faults"]
    ]
    heads = [
        "Run",
        "Fault",
        "Onset, s",
        "Detected after, s",
        "Isolated after, s",
        "As",
        "p_e off by, kPa",
        "Back after, s",
    ]
    return [Table(heads, rows)] if rows else []


def _after(fault: Mapping[str, Any], key: str) -> str:
    return "–" if fault[key] is None else cell(fault[key] - fault["onset_s"], ".1f")


def _details(runs: Sequence[Run], plots: Plots) -> list[Section]:
    onsets = sorted({fault["onset_s"] for run in runs for fault in run.summary["faults"]})[:MOST_DETAILS]
    sections = []
    for number, onset_s in enumerate(onsets, start=1):
        title = f"Around {onset_s:g} s"
        picture = plots.put(_charts(runs, around(onset_s)), f"_fault_{number}", title)
        sections.append(Section(f"fault-{number}", title, [picture]))
    return sections


def _charts(runs: Sequence[Run], window_s: tuple[float, float] | None) -> list[Chart]:
    """Return a plot for each signal that any of the runs has, with a curve for each run."""
    panels: dict[str, Panel] = {}
    lines: dict[str, list[tuple[Run, Line]]] = {}
    for run in runs:
        for panel in panels_of(run.recording, both=False):
            panels.setdefault(panel.key, panel)
            lines.setdefault(panel.key, []).append((run, panel.main))
    return [chart for key, panel in panels.items() if (chart := _chart(runs, panel, lines[key], window_s)) is not None]


def _chart(
    runs: Sequence[Run], panel: Panel, lines: Sequence[tuple[Run, Line]], window_s: tuple[float, float] | None
) -> Chart | None:
    end_s = max(float(run.recording.time_s[-1]) + run.summary["sample_time_s"] for run in runs)
    start_s, stop_s = window_s or (0.0, end_s)
    start_s, stop_s = max(start_s, 0.0), min(stop_s, end_s)
    curves = []
    for run, line in lines:
        colour, dash = LOOKS[next(number for number, one in enumerate(runs) if one is run)]
        curves.append(_curve(run.recording, line.key, panel, (run.name, colour, dash, 2.0), line.step, start_s, stop_s))
    if panel.key in _REFERENCES:
        look = ("reference", BLACK, "dash", 1.2)
        curves.append(_curve(runs[0].recording, _REFERENCES[panel.key], panel, look, False, start_s, stop_s))
    values = np.concatenate([curve.y for curve in curves])
    values = values[np.isfinite(values)]
    if not len(values):
        return None
    onsets = sorted({fault["onset_s"] for run in runs for fault in run.summary["faults"]})
    return Chart(
        title=panel.title,
        y_title=panel.y_title,
        curves=curves,
        x_range=(start_s, stop_s),
        y_range=spaced(
            float(values.min()), float(values.max()), max(panel.least_range, 1e-3 * abs(float(values.max())))
        ),
        marks=[Mark(at, ONSET, BLACK, "dash") for at in onsets if start_s <= at <= stop_s],
    )


def _curve(
    recording: Recording,
    key: str,
    panel: Panel,
    look: tuple[str, str, str, float],
    step: bool,
    start_s: float,
    stop_s: float,
) -> Curve:
    inside = np.flatnonzero((recording.time_s >= start_s) & (recording.time_s <= stop_s))
    values = values_of(recording, key)
    if len(inside):
        inside = inside[kept_ticks(recording.time_s[inside], [(values[inside], step)])]
    return Curve(
        recording.time_s[inside],
        values[inside] / panel.per_unit,
        *look,
        step=step,
        digits=panel.digits,
        unit=panel.unit,
    )
