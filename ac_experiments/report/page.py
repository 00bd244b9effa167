"""`report.html`: one run as a page that needs nothing else, with the paper's plots and its numbers beside ours."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from markupsafe import Markup

from ac_common.faults import BY_KIND, UNKNOWN, called
from ac_common.fdi_status import NO_LONGER, NOT_SURE, SURE
from ac_common.files import write_whole
from ac_common.health import health_of
from ac_common.topics import BRINGUP, FDI
from ac_common.yaml_file import yaml_text
from ac_experiments.decisions import told_sure, unsure_of
from ac_experiments.metrics import SETTLED_DEVIATIONS, SETTLED_KPA, WINDOW_S, summarise
from ac_experiments.recording import Recording
from ac_experiments.report.embedded import Plots
from ac_experiments.report.moments import acting, around, subscripted
from ac_experiments.report.narrative import narrative
from ac_experiments.report.nodes import MOST_EVENTS, Event, Report, events_of, health_charts
from ac_experiments.report.panels import charts_of, cut, story_of
from ac_experiments.report.paper_figures import figures_for
from ac_experiments.report.parts import Part, Section, Table, Words, cell, code, render_page
from ac_experiments.report.performance import performance_table
from ac_experiments.scenario_schema import SENSORS

#: Key of a summary's ``metrics``, name, unit, format.
METRICS = (
    ("command_change_rpm", "Change of the commanded compressor speed at rest", "rpm", "+.2f"),
    ("peak_pressure_error_kpa", Markup("Peak of actual p<sub>e</sub> off its reference"), "kPa", ".3f"),
    ("steady_pressure_error_kpa", Markup("Actual p<sub>e</sub> minus reference at rest"), "kPa", "+.3f"),
    ("peak_superheat_error_k", "Peak of actual superheat off its reference", "K", ".3f"),
    ("steady_superheat_error_k", "Actual superheat minus reference at rest", "K", "+.3f"),
)

#: Faults that get plots of their own; the plots of the whole run show all.
MOST_DETAILS = 6

PAGE = Path(__file__).with_name("page.html")


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
    """Return the text of the report; see `write_report`. With `pictures` the still pictures are written, too."""
    if beside is not None:
        beside = cut(beside, float(recording.time_s[-1]))  # a run that was cut short is compared as far as it goes
    summary = summarise(recording)
    other = None if beside is None else summarise(beside)
    scenario = recording.metadata["scenario"]
    events = _events(recording, reports, first_tick_s)
    plots = Plots(pictures)
    sections = [
        Section("faults", "Faults", _faults_table(summary)),
        Section("figures", "Figures", _metrics_table(summary, other, scenario)),
        Section("performance", "Performance of the plant", performance_table(recording, beside)),
        *_details(summary, recording, beside, note, plots),
        Section("run", "The whole run", _whole_run(recording, beside, note, plots)),
        Section("nodes", "Timing and health of the nodes", _nodes(recording, reports, plots)),
        Section("events", "Events", _events_table(_with_decisions(events, summary, recording))),
        Section("parameters", "Parameters", _parameters(recording), on_paper=False),
        Section("again", "How to run it again", _again(summary, recording.metadata)),
    ]
    return render_page(
        PAGE,
        title=f"{summary['scenario']} ({'passive' if summary['passive'] else 'active'})",
        description=scenario.get("description", ""),
        story=narrative(summary, other, events or ()),
        facts=_facts(summary, scenario, recording.metadata),
        sections=[section for section in sections if section.parts],
        script=plots.script(),
    )


# ------------------------------------------------------------------------------------------------------- sections


def _facts(
    summary: Mapping[str, Any], scenario: Mapping[str, Any], about: Mapping[str, Any]
) -> list[tuple[str, str | Markup]]:
    factor, wall = summary["real_time_factor"], summary["wall_seconds"]
    speed = "unknown" if not factor else f"{wall:.2f} s, {factor:.{0 if factor >= 10 else 1}f} times real time"
    control = Markup(
        "passive: K<sub>0</sub> alone" if summary["passive"] else "active: K<sub>0</sub> with compensator Q"
    )
    seconds = summary["ticks"] * summary["sample_time_s"]
    return [
        ("Started", str(about.get("started", "unknown")).replace("T", " ").replace("+00:00", " UTC")),
        ("Mode", {"simulate": "one process, without ROS"}.get(summary["mode"], summary["mode"])),
        ("Control", control),
        ("Operating point", str(scenario.get("operating_point", ""))),
        ("Ticks", f"{summary['ticks']} at {summary['sample_time_s']:g} s: {seconds:g} s"),
        ("Wall time", speed),
        ("Missed ticks", str(summary["missed_ticks"])),
    ]


def _faults_table(summary: Mapping[str, Any]) -> list[Part]:
    if not summary["faults"]:
        return []
    rows = []
    for fault in summary["faults"]:
        isolated = fault["isolated_as"]
        rows.append(
            [
                _name(fault["kind"]),
                f"{cell(fault['size'], 'g')} {fault['unit']}",
                _span(fault),
                cell(fault["detected_s"], ".1f"),
                cell(fault["isolated_s"], ".1f") + told_sure(fault, fault["isolated_s"], 0.0, ", sure {:.1f}"),
                "–" if isolated is None else _name(isolated),
                "–" if isolated is None else f"{cell(fault['estimate'], '.2f')} {_unit(isolated)}".rstrip(),
                cell(fault["peak_pressure_error_kpa"], ".2f"),
                "stayed" if fault["settled_s"] == fault["onset_s"] else cell(fault["settled_s"], ".1f"),
            ]
        )
    heads: list[str | Markup] = ["Fault", "Size", "Onset, s", "Detected, s", "Isolated, s", "Isolated as", "Estimate"]
    heads += [Markup("p<sub>e</sub> off by, kPa"), Markup("p<sub>e</sub> back, s")]
    note = Markup(
        "Times from the start of the run. “p<sub>e</sub> back”: from then on until the next fault the actual "
        f"p<sub>e</sub> stays within {SETTLED_KPA:g} kPa of its reference (with noise: and {SETTLED_DEVIATIONS:g} "
        f"standard deviations of the {WINDOW_S:g} s before the fault)."
    )
    if any(fault["sure_s"] != fault["isolated_s"] for fault in summary["faults"]):
        note += " “Sure”: until then the name might yet be the other fault's, and nothing is done about it."
    return [Table(heads, rows), Words(note, "note")]


def _span(fault: Mapping[str, Any]) -> str:
    return f"{fault['onset_s']:g}" + ("" if fault["end_s"] is None else f" to {fault['end_s']:g}")


def _unit(kind: str) -> str:
    return "" if kind == UNKNOWN else BY_KIND[kind].unit


def _name(kind: str) -> str | Markup:
    """Return symbol and name of a fault, as a table shows them."""
    if kind == UNKNOWN:
        return UNKNOWN
    return Markup("{} {}").format(Markup(subscripted(BY_KIND[kind].symbol)), BY_KIND[kind].name)


def _metrics_table(
    summary: Mapping[str, Any], other: Mapping[str, Any] | None, scenario: Mapping[str, Any]
) -> list[Part]:
    """Return the metrics of this run and the one beside it, and, in columns of their own, the paper's numbers."""
    runs = [run for run in (summary, other) if run is not None]
    runs.sort(key=lambda run: run["passive"])
    paper = figures_for(scenario)
    heads = ["", "Unit"]
    for run in runs:
        kind = "Passive" if run["passive"] else "Active"
        heads += [kind] + ([f"Paper, {kind.lower()}"] if paper else [])
    rows = []
    for key, name, unit, digits in METRICS:
        row = [name, unit]
        for run in runs:
            row.append(cell(run["metrics"][key], digits))
            if paper:
                said = (paper.passive if run["passive"] else paper.active).get(key)
                row.append(cell(said, "+g" if said else "g"))
        rows.append(row)
    remark = [] if paper is None else [Words(f"{paper.experiment}: {paper.remark}", "note")]
    caption = Markup(
        f"“At rest” is the mean of the last {WINDOW_S:g} s; a change is against the {WINDOW_S:g} s before the last "
        "fault; peaks count from the first fault on. Errors are those of the <em>actual</em> values, not the measured."
    )
    return [Table(heads, rows), Words(caption, "note"), *remark]


def _details(
    summary: Mapping[str, Any], recording: Recording, beside: Recording | None, note: str, plots: Plots
) -> list[Section]:
    """Return the plots of the time around each fault, where the transients can be seen."""
    sections = []
    for number, fault in enumerate(summary["faults"][:MOST_DETAILS], start=1):
        charts = charts_of(recording, beside, story_of(recording), around(fault["onset_s"]))
        title = Markup("Around the fault {}, {:g} s").format(_name(fault["kind"]), fault["onset_s"])
        picture = plots.put(charts, f"_fault_{number}", f"{summary['scenario']}: around {fault['onset_s']:g} s")
        sections.append(Section(f"fault-{number}", title, [*_note(note), picture]))
    return sections


def _whole_run(recording: Recording, beside: Recording | None, note: str, plots: Plots) -> list[Part]:
    hint = "Drag to zoom, double-click to see all again; a click on a name in a legend hides its line."
    charts = charts_of(recording, beside)
    name = recording.metadata["scenario"]["name"]
    picture = plots.put(charts, "", f"{name}: the whole run", still_columns=3)
    return [*_note(note), Words(hint, "hint"), picture]


def _nodes(recording: Recording, reports: Sequence[Report], plots: Plots) -> list[Part]:
    """Return how the nodes fared; nothing for a run without nodes."""
    if not reports:
        return []
    rows = [
        [
            code(node.name),
            node.state,
            cell(node.latency_p50_ms, ".2f"),
            cell(node.latency_max_ms, ".2f"),
            str(node.overruns),
            f"{node.rejected_inputs} {node.last_rejected}",
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
    parts: list[Part] = [Table(heads, rows)]
    if latency and math.isfinite(latency["p50"]):
        text = (
            "From a measurement's stamp to the command's arrival at the plant: half of the ticks within "
            f"{latency['p50']:.2f} ms, 99 % within {latency['p99']:.2f} ms, the longest {latency['max']:.2f} ms."
        )
        parts.append(Words(text))
    charts = health_charts(reports)
    if charts:
        parts.append(plots.put(charts, "_nodes", "Timing of the nodes", columns=1))
    return parts


def _events(recording: Recording, reports: Sequence[Report], first_tick_s: float) -> list[Event] | None:
    """Return what was out of the ordinary; None where nobody could tell: a bag without health reports."""
    if reports:
        return events_of(reports, first_tick_s)
    if recording.metadata["mode"] == "simulate":
        return [Event(**event) for event in recording.metadata.get("events", [])]
    return None


def _with_decisions(
    events: Sequence[Event] | None, summary: Mapping[str, Any], recording: Recording
) -> list[Event] | None:
    """Return the events with their lengths, and among them what `fdi` detected and named."""
    lasting = {
        (event["node"], event["what"], round(event["time_s"], 3)): event["length_s"] for event in summary["events"]
    }
    told = [
        replace(event, length_s=_or_nan(lasting.get((event.node, event.what, round(event.time_s, 3)))))
        for event in events or ()
    ]
    isolated = [(named["time_s"], named["kind"]) for named in summary["isolations"]]
    for unsure in unsure_of(recording.status):
        kind = str(unsure.kind)
        if (unsure.start_s, kind) not in isolated:
            told.append(Event(unsure.start_s, FDI, f"{called(kind)} {NO_LONGER}"))
        if not math.isnan(unsure.end_s) and (acts := acting(recording, kind, unsure.end_s)) != NOT_SURE:
            told.append(Event(unsure.end_s, FDI, ": ".join(filter(None, (f"{called(kind)} {SURE}", acts)))))
    alarms = {alarm["time_s"]: alarm["kind"] for alarm in summary["false_alarm_list"]}
    for spell in (*summary["detections"], *summary["isolations"]):
        kind = spell["kind"]
        what = "fault detected" if kind is None else f"{called(kind)} isolated"
        if kind is not None and (acts := acting(recording, kind, spell["time_s"])):
            what += f": {acts}"
        if spell["time_s"] in alarms and kind in (None, alarms[spell["time_s"]]):
            what += ": a false alarm"
        told.append(Event(spell["time_s"], FDI, what, _or_nan(spell["length_s"])))
    return None if events is None and not told else sorted(told, key=lambda event: event.time_s)


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value


def _events_table(events: Sequence[Event] | None) -> list[Part]:
    """Return the events in order of time; nothing where nobody could tell."""
    if events is None:
        return []
    if not events:
        return [Words("None: no node refused an input, missed a tick, changed what it does or was started again.")]
    rows = [
        [cell(event.time_s, ".1f"), code(event.node), event.what, cell(event.length_s, ".1f")]
        for event in events[:MOST_EVENTS]
    ]
    more = len(events) - MOST_EVENTS
    table = Table(["Time, s", "Node", "What it reported", "For, s"], rows)
    return [table, Words(f"And {more} more.", "note")] if more > 0 else [table]


def _parameters(recording: Recording) -> list[Part]:
    """Return with what the run was made: versions, and the parameters that each node was given."""
    versions: Mapping[str, Any] = recording.metadata.get("software", {})
    nodes: Mapping[str, Any] = recording.metadata.get("parameters", {})
    scenario: Mapping[str, Any] = recording.metadata["scenario"]
    given = {
        "sample time": f"{recording.metadata['sample_time_s']:g} s",
        "design": scenario.get("design", "paper"),
        "sensors": _sensors(scenario.get("sensors", 3)),
        "superheat": f"{scenario.get('superheat_sensor', 'direct')} sensor",
        "controller": f"K0 {scenario.get('controller', 'tracking')}",
        "noise (standard deviation)": _noise(scenario.get("noise", {})),
    }
    parts: list[Part] = [Table(["", ""], [[key, str(value)] for key, value in {**given, **versions}.items()])]
    if nodes:
        rows = [
            [code(node), ", ".join(f"{key}: {value}" for key, value in values.items())]
            for node, values in nodes.items()
            if values
        ]
        heads = ["Node", "Parameters; the others have their defaults"]
        parts += [Words("Given to the nodes", "heading"), Table(heads, rows)]
    return parts


def _sensors(sensors: int | list[str]) -> str:
    return ", ".join(sensors if isinstance(sensors, list) else SENSORS[:sensors])


def _noise(noise: Mapping[str, Any]) -> str:
    units = {
        "evaporator_pressure_kpa": "kPa",
        "superheat_k": "K",
        "wall_temperature_k": "K",
        "condenser_pressure_kpa": "kPa",
    }
    names = {key: key.rpartition("_")[0].replace("_", " ") for key in units}
    parts = [f"{names[key]} {noise[key]:g} {units[key]}" for key in units if noise.get(key)]
    return ", ".join([*parts, f"seed {noise.get('seed', 0)}"]) if parts else "none"


def _again(summary: Mapping[str, Any], about: Mapping[str, Any]) -> list[Part]:
    """Return the command that repeats the run, and the scenario in full."""
    scenario = about["scenario"]
    text = Words(yaml_text(_without_empty(scenario), width=100), "listing")
    if about.get("command"):
        return [Words(f"{about['command']} --out results/again", "code"), Words("The scenario in full:", "hint"), text]
    from ac_experiments.drives import name_of
    from ac_experiments.scenario import built_in_scenarios, load

    name = name_of(summary["scenario"])
    is_known = name != summary["scenario"] or name in built_in_scenarios()
    known = load(name, whole=False).model_dump(mode="json") if is_known else {}
    built_in = {**known, "passive": None} == {**scenario, "passive": None}
    passive = " --passive" if summary["passive"] else ""
    source = name if built_in else "scenario.yaml"
    if summary["mode"] == "simulate":
        command = f"acftc simulate {source} --out results{passive}"
    else:
        command = f"acftc run {source} --out results --mode {summary['mode']}{passive}"
    if built_in:
        return [Words(command, "code"), Words("The built-in scenario in full:", "hint"), text]
    saved = Markup("Save the scenario as <code>scenario.yaml</code>, then:")
    return [Words(saved, "note"), Words(command, "code"), text]


# -------------------------------------------------------------------------------------------------------- details


def _note(text: str) -> list[Part]:
    return [Words(text, "note")] if text else []


def _without_empty(value: Any) -> Any:
    """Leave out what a scenario file would not say: None, and empty lists and mappings."""
    if isinstance(value, dict):
        kept = {key: _without_empty(item) for key, item in value.items()}
        return {key: item for key, item in kept.items() if item not in (None, [], {}, "")}
    if isinstance(value, list):
        return [_without_empty(item) for item in value]
    return value
