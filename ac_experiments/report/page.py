"""`report.html`: one run as a page that needs nothing else, with the paper's plots and its numbers beside ours."""

import base64
import gzip
import html
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from string import Template
from typing import Any

import yaml

from ac_common.faults import BY_KIND, UNKNOWN
from ac_common.files import write_whole
from ac_common.health import health_of
from ac_common.topics import BRINGUP
from ac_experiments.metrics import SETTLED_DEVIATIONS, SETTLED_KPA, WINDOW_S, summarise
from ac_experiments.recording import Recording
from ac_experiments.report import matplotlib_charts
from ac_experiments.report.charts import Chart
from ac_experiments.report.narrative import as_html, narrative
from ac_experiments.report.nodes import MOST_EVENTS, Event, Report, events_of, health_charts
from ac_experiments.report.panels import around, charts_of, cut, story_of, subscripted
from ac_experiments.report.paper_figures import figures_for

_METRICS = (
    ("command_change_rpm", "Change of the commanded compressor speed at rest", "rpm", "+.2f"),
    ("peak_pressure_error_kpa", "Peak of actual p<sub>e</sub> off its reference", "kPa", ".3f"),
    ("steady_pressure_error_kpa", "Actual p<sub>e</sub> minus reference at rest", "kPa", "+.3f"),
    ("peak_superheat_error_k", "Peak of actual superheat off its reference", "K", ".3f"),
    ("steady_superheat_error_k", "Actual superheat minus reference at rest", "K", "+.3f"),
)

#: Faults that get plots of their own; the plots of the whole run show all.
MOST_DETAILS = 6

_WIDE_IN = (2 * matplotlib_charts.SIZE_IN[0], matplotlib_charts.SIZE_IN[1])
_PAGE = Path(__file__).with_name("page.html")


def write_report(
    path: Path,
    recording: Recording,
    beside: Recording | None = None,
    note: str = "",
    reports: Sequence[Report] = (),
    first_tick_s: float = 0.0,
) -> None:
    """Write the report of a run, and its plots as still pictures beside it.

    Parameters
    ----------
    path
        The HTML file to write. The pictures get the same name: ``.svg`` and ``.png`` of the whole run,
        ``_fault_1.svg`` and ``_fault_1.png`` of the time around the first fault, and so on.
    recording
        The run.
    beside
        A run of the same scenario with the other kind of control (passive beside active), drawn into the same plots.
    note
        Where `beside` comes from, one sentence for the reader.
    reports
        Health reports of the nodes, when there were any.
    first_tick_s
        Stamp of the first tick, where nodes tell times by stamps.
    """
    write_whole(path, render(recording, beside, note, reports, first_tick_s, path.with_suffix("")))


def render(
    recording: Recording,
    beside: Recording | None = None,
    note: str = "",
    reports: Sequence[Report] = (),
    first_tick_s: float = 0.0,
    pictures: Path | None = None,
) -> str:
    """Text of the report; see `write_report`. With `pictures` the still pictures are written, too."""
    if beside is not None:
        beside = cut(beside, float(recording.time_s[-1]))  # a run that was cut short is compared as far as it goes
    summary = summarise(recording)
    other = None if beside is None else summarise(beside)
    scenario = recording.metadata["scenario"]
    events = _events(recording, reports, first_tick_s)
    plots = _Plots(pictures)
    sections = [
        ("faults", "Faults", _faults_table(summary)),
        ("figures", "Figures", _metrics_table(summary, other, scenario)),
        *_details(summary, recording, beside, note, plots),
        ("run", "The whole run", _whole_run(recording, beside, note, plots)),
        ("nodes", "Timing and health of the nodes", _nodes(recording, reports, plots)),
        ("events", "Events", _events_table(events)),
        ("parameters", "Parameters", _parameters(recording)),
        ("again", "How to run it again", _again(summary, scenario)),
    ]
    sections = [section for section in sections if section[2]]
    return Template(_PAGE.read_text(encoding="utf-8")).substitute(
        title=html.escape(f"{summary['scenario']} ({'passive' if summary['passive'] else 'active'})"),
        description=html.escape(scenario.get("description", "")),
        story=as_html(narrative(summary, other, events or ())),
        contents="".join(f"<a href=#{name}>{heading}</a>" for name, heading, _ in sections),
        facts=_facts(summary, scenario, recording.metadata),
        body="\n".join(f"<h2 id={name}>{heading}</h2>\n{text}" for name, heading, text in sections),
        script=plots.script(),
    )


class _Plots:
    """Puts plots into the page: one to zoom and hover, and a still one for print, which is written to a file, too."""

    def __init__(self, pictures: Path | None) -> None:
        self._pictures = pictures
        self._figures: dict[str, Any] = {}

    def put(self, charts: Sequence[Chart], name: str, title: str, *, wide: bool = False) -> str:
        """HTML of `charts`, two beside each other, or one if `wide`; `name` is added to the picture's file name."""
        from ac_experiments.report.plotly_charts import figure  # takes half a second to import

        columns, size_in = (1, _WIDE_IN) if wide else (2, matplotlib_charts.SIZE_IN)
        moving = figure(charts, columns)
        self._figures[f"plots{name}"] = moving
        if self._pictures is None:
            still = matplotlib_charts.draw(charts, columns, title, size_in)
        else:
            still = matplotlib_charts.save(
                charts, self._pictures.with_name(self._pictures.name + name), columns, title, size_in
            )
        data = base64.b64encode(still.encode()).decode()
        picture = f'<img alt="{html.escape(title)}" src="data:image/svg+xml;base64,{data}">'
        place = f'<div id=plots{name} style="height:{moving.layout.height}px"></div>'
        return f"<div class=screen>{place}</div><div class=print>{picture}</div>"

    def script(self) -> str:
        """The plotting library and all plots as the page unpacks them: gzip in base64, less than half the size."""
        from plotly.offline import get_plotlyjs

        figures = ", ".join(f'"{name}": {moving.to_json()}' for name, moving in self._figures.items())
        config = {"responsive": True, "displaylogo": False, "toImageButtonOptions": {"format": "svg", "scale": 1}}
        text = (
            f"{get_plotlyjs()}\nfor (const [name, plot] of Object.entries({{{figures}}}))\n"
            f"  Plotly.newPlot(name, plot.data, plot.layout, {json.dumps(config)});\n"
        )
        return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode()


# ------------------------------------------------------------------------------------------------------- sections


def _facts(summary: Mapping[str, Any], scenario: Mapping[str, Any], about: Mapping[str, Any]) -> str:
    factor, wall = summary["real_time_factor"], summary["wall_seconds"]
    speed = "unknown" if not factor else f"{wall:.2f} s, {factor:.{0 if factor >= 10 else 1}f} times real time"
    control = "passive: K<sub>0</sub> alone" if summary["passive"] else "active: K<sub>0</sub> with compensator Q"
    seconds = summary["ticks"] * summary["sample_time_s"]
    facts = [
        ("Started", html.escape(str(about.get("started", "unknown")).replace("T", " ").replace("+00:00", " UTC"))),
        ("Mode", {"simulate": "one process, without ROS"}.get(summary["mode"], summary["mode"])),
        ("Control", control),
        ("Operating point", html.escape(str(scenario.get("operating_point", "")))),
        ("Ticks", f"{summary['ticks']} at {summary['sample_time_s']:g} s: {seconds:g} s"),
        ("Wall time", speed),
        ("Missed ticks", str(summary["missed_ticks"])),
    ]
    return "".join(f"<div><dt>{name}</dt><dd>{value}</dd></div>" for name, value in facts)


def _faults_table(summary: Mapping[str, Any]) -> str:
    if not summary["faults"]:
        return ""
    rows = []
    for fault in summary["faults"]:
        isolated = fault["isolated_as"]
        rows.append(
            [
                _name(fault["kind"]),
                f"{_cell(fault['size'], 'g')} {fault['unit']}",
                _span(fault),
                _cell(fault["detected_s"], ".1f"),
                _cell(fault["isolated_s"], ".1f"),
                "–" if isolated is None else _name(isolated),
                "–" if isolated is None else f"{_cell(fault['estimate'], '.2f')} {_unit(isolated)}".rstrip(),
                _cell(fault["peak_pressure_error_kpa"], ".2f"),
                "stayed" if fault["settled_s"] == fault["onset_s"] else _cell(fault["settled_s"], ".1f"),
            ]
        )
    heads = ["Fault", "Size", "Onset, s", "Detected, s", "Isolated, s", "Isolated as", "Estimate"]
    heads += ["p<sub>e</sub> off by, kPa", "p<sub>e</sub> back, s"]
    note = (
        "Times from the start of the run. “p<sub>e</sub> back”: from then on until the next fault the actual "
        f"p<sub>e</sub> stays within {SETTLED_KPA:g} kPa of its reference (with noise: and {SETTLED_DEVIATIONS:g} "
        f"standard deviations of the {WINDOW_S:g} s before the fault)."
    )
    return _table(heads, rows) + f"<p class=note>{note}</p>"


def _span(fault: Mapping[str, Any]) -> str:
    return f"{fault['onset_s']:g}" + ("" if fault["end_s"] is None else f" to {fault['end_s']:g}")


def _unit(kind: str) -> str:
    return "" if kind == UNKNOWN else BY_KIND[kind].unit


def _name(kind: str) -> str:
    """Return symbol and name of a fault, as a table shows them."""
    return UNKNOWN if kind == UNKNOWN else f"{subscripted(BY_KIND[kind].symbol)} {BY_KIND[kind].name}"


def _metrics_table(summary: Mapping[str, Any], other: Mapping[str, Any] | None, scenario: Mapping[str, Any]) -> str:
    """Metrics of this run and the one beside it; for the paper's experiments its numbers in columns of their own."""
    runs = [run for run in (summary, other) if run is not None]
    runs.sort(key=lambda run: run["passive"])
    paper = figures_for(scenario)
    heads = ["", "Unit"]
    for run in runs:
        kind = "Passive" if run["passive"] else "Active"
        heads += [kind] + ([f"Paper, {kind.lower()}"] if paper else [])
    rows = []
    for key, name, unit, digits in _METRICS:
        row = [name, unit]
        for run in runs:
            row.append(_cell(run["metrics"][key], digits))
            if paper:
                said = (paper.passive if run["passive"] else paper.active).get(key)
                row.append(_cell(said, "+g" if said else "g"))
        rows.append(row)
    remark = "" if paper is None else f"<p class=note>{paper.experiment}: {html.escape(paper.remark)}</p>"
    caption = (
        f"“At rest” is the mean of the last {WINDOW_S:g} s; a change is against the {WINDOW_S:g} s before the last "
        "fault; peaks count from the first fault on. Errors are those of the <em>actual</em> values, not the measured."
    )
    return _table(heads, rows) + f"<p class=note>{caption}</p>" + remark


def _details(
    summary: Mapping[str, Any], recording: Recording, beside: Recording | None, note: str, plots: _Plots
) -> list[tuple[str, str, str]]:
    """Plots of the time around each fault, where the transients can be seen."""
    sections = []
    for number, fault in enumerate(summary["faults"][:MOST_DETAILS], start=1):
        charts = charts_of(recording, beside, story_of(recording), around(fault["onset_s"]))
        title = f"Around the fault {_name(fault['kind'])}, {fault['onset_s']:g} s"
        picture = plots.put(charts, f"_fault_{number}", f"{summary['scenario']}: around {fault['onset_s']:g} s")
        sections.append((f"fault-{number}", title, _note(note) + picture))
    return sections


def _whole_run(recording: Recording, beside: Recording | None, note: str, plots: _Plots) -> str:
    hint = "Drag to zoom, double-click to see all again; a click on a name in a legend hides its line."
    charts = charts_of(recording, beside)
    picture = plots.put(charts, "", f"{recording.metadata['scenario']['name']}: the whole run")
    return f"{_note(note)}<p class='note screen'>{hint}</p>{picture}"


def _nodes(recording: Recording, reports: Sequence[Report], plots: _Plots) -> str:
    """How the nodes fared; empty for a run without nodes."""
    if not reports:
        return ""
    rows = [
        [
            f"<code>{html.escape(node.name)}</code>",
            html.escape(node.state),
            _cell(node.latency_p50_ms, ".2f"),
            _cell(node.latency_max_ms, ".2f"),
            str(node.overruns),
            f"{node.rejected_inputs} {html.escape(node.last_rejected)}",
        ]
        for node in health_of((report.node, report.values) for report in reports if report.node != BRINGUP)
    ]
    heads = [
        "Node",
        "State in its last report",
        "Inputs to outputs, typical, ms",
        "longest, ms",
        "Overruns",
        "Inputs refused",
    ]
    latency = recording.metadata.get("command_latency_ms")
    whole = ""
    if latency and math.isfinite(latency["p50"]):
        whole = (
            "<p>From a measurement's stamp to the command's arrival at the plant: half of the ticks within "
            f"{latency['p50']:.2f} ms, 99 % within {latency['p99']:.2f} ms, the longest {latency['max']:.2f} ms.</p>"
        )
    charts = health_charts(reports)
    return (
        _table(heads, rows) + whole + (plots.put(charts, "_nodes", "Timing of the nodes", wide=True) if charts else "")
    )


def _events(recording: Recording, reports: Sequence[Report], first_tick_s: float) -> list[Event] | None:
    """What was out of the ordinary; None where nobody could tell: a bag without health reports."""
    if reports:
        return events_of(reports, first_tick_s)
    if recording.metadata["mode"] == "simulate":
        return [Event(**event) for event in recording.metadata.get("events", [])]
    return None


def _events_table(events: Sequence[Event] | None) -> str:
    """The events in order of time; empty where nobody could tell."""
    if events is None:
        return ""
    if not events:
        return "<p>None: no node refused an input, missed a tick, changed what it does or was started again.</p>"
    rows = [
        [_cell(event.time_s, ".1f"), f"<code>{html.escape(event.node)}</code>", html.escape(event.what)]
        for event in events[:MOST_EVENTS]
    ]
    table = _table(["Time, s", "Node", "What it reported"], rows)
    more = len(events) - MOST_EVENTS
    if more <= 0:
        return table
    return f"{table}<p class=note>And {more} more.</p>"


def _parameters(recording: Recording) -> str:
    """With what the run was made: versions, and the parameters that each node was given."""
    versions: Mapping[str, Any] = recording.metadata.get("software", {})
    nodes: Mapping[str, Any] = recording.metadata.get("parameters", {})
    scenario: Mapping[str, Any] = recording.metadata["scenario"]
    given = {
        "sample time": f"{recording.metadata['sample_time_s']:g} s",
        "sensors": "p_e, SH and wall thermocouple" if scenario.get("sensors", 3) == 3 else "p_e and SH",
        "superheat": f"{scenario.get('superheat_sensor', 'direct')} sensor",
        "controller": f"K0 {scenario.get('controller', 'tracking')}",
        "noise (standard deviation)": _noise(scenario.get("noise", {})),
    }
    rows = [[html.escape(key), html.escape(str(value))] for key, value in {**given, **versions}.items()]
    text = _table(["", ""], rows)
    if nodes:
        rows = [
            [f"<code>{html.escape(node)}</code>", ", ".join(html.escape(f"{key}: {own[key]}") for key in own)]
            for node, own in nodes.items()
            if own
        ]
        text += "<h3>Given to the nodes</h3>" + _table(["Node", "Parameters; the others have their defaults"], rows)
    return text


def _noise(noise: Mapping[str, Any]) -> str:
    units = {"evaporator_pressure_kpa": "kPa", "superheat_k": "K", "wall_temperature_k": "K"}
    names = {key: key.rpartition("_")[0].replace("_", " ") for key in units}
    parts = [f"{names[key]} {noise[key]:g} {units[key]}" for key in units if noise.get(key)]
    return ", ".join([*parts, f"seed {noise.get('seed', 0)}"]) if parts else "none"


def _again(summary: Mapping[str, Any], scenario: Mapping[str, Any]) -> str:
    """The command that repeats the run, and the scenario when it is not a built-in one as it is."""
    from ac_experiments.scenario import built_in_scenarios, load

    name = summary["scenario"]
    known = load(name, whole=False).model_dump(mode="json") if name in built_in_scenarios() else {}
    built_in = {**known, "passive": None} == {**scenario, "passive": None}
    passive = " --passive" if summary["passive"] else ""
    source = name if built_in else "scenario.yaml"
    if summary["mode"] == "simulate":
        command = f"acftc simulate {source} --out results{passive}"
    else:
        command = f"acftc run {source} --out results --mode {summary['mode']}{passive}"
    text = html.escape(yaml.safe_dump(_without_empty(scenario), sort_keys=False, width=100))
    if built_in:
        return f"<pre>{html.escape(command)}</pre><p class=note>The built-in scenario in full:</p><pre>{text}</pre>"
    saved = "<p class=note>Save the scenario as <code>scenario.yaml</code>, then:</p>"
    return f"{saved}<pre>{html.escape(command)}</pre><pre>{text}</pre>"


# -------------------------------------------------------------------------------------------------------- details


def _note(text: str) -> str:
    return f"<p class=note>{html.escape(text)}</p>" if text else ""


def _cell(value: float | None, digits: str) -> str:
    """Format a number for a table: a dash where there is none, a true minus, and no sign on what rounds to zero."""
    if value is None or math.isnan(value):
        return "–"
    text = format(value, digits)
    return (text if float(text) else text.lstrip("+-")).replace("-", "\N{MINUS SIGN}")


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{text}</th>" for text in heads)
    head = f"<thead><tr>{head}</tr></thead>" if any(heads) else ""
    body = "".join("<tr>" + "".join(f"<td>{text}</td>" for text in row) + "</tr>" for row in rows)
    return f"<div class=scroll><table>{head}<tbody>{body}</tbody></table></div>"


def _without_empty(value: Any) -> Any:
    """Leave out what a scenario file would not say: None, and empty lists and mappings."""
    if isinstance(value, dict):
        kept = {key: _without_empty(item) for key, item in value.items()}
        return {key: item for key, item in kept.items() if item not in (None, [], {}, "")}
    if isinstance(value, list):
        return [_without_empty(item) for item in value]
    return value
