"""`report.html`: one run as a page that needs nothing else, with the paper's plots and its numbers beside ours."""

import html
import math
from collections.abc import Sequence
from pathlib import Path
from string import Template
from typing import Any

import yaml

from bringup.recording import Recording
from bringup.report.panels import between
from bringup.report.paper import figures_for
from bringup.report.plots import time_plots
from bringup.report.svg import charts_of, draw
from bringup.ros.health import NodeHealth
from bringup.summary import WINDOW_S, injected_faults, summarise

_METRICS = (
    ("command_change_rpm", "Change of the commanded compressor speed at rest", "rpm", "+.2f"),
    ("peak_pressure_error_kpa", "Peak of actual p<sub>e</sub> off its reference", "kPa", ".3f"),
    ("steady_pressure_error_kpa", "Actual p<sub>e</sub> minus reference at rest", "kPa", "+.3f"),
    ("peak_superheat_error_k", "Peak of actual superheat off its reference", "K", ".3f"),
    ("steady_superheat_error_k", "Actual superheat minus reference at rest", "K", "+.3f"),
)

#: Panels of the still pictures, and the time that they show around a fault: from before its onset to after it, s.
_PANELS = ("Compressor speed", "Evaporator pressure", "Expansion valve", "Superheat", "Residual")
BEFORE_S, AFTER_S = 20.0, 100.0

_FAULT_NAMES = {
    "compressor_speed": "f<sub>N</sub> compressor speed",
    "evaporator_pressure": "f<sub>p</sub> pressure sensor",
}


def write_report(
    path: Path,
    recording: Recording,
    beside: Recording | None = None,
    note: str = "",
    health: Sequence[NodeHealth] = (),
) -> None:
    """Write the report of a run, and its plots as a still picture beside it.

    Parameters
    ----------
    path
        The HTML file to write; the picture gets the same name with ``.svg``.
    recording
        The run.
    beside
        A run of the same scenario with the other kind of control (passive beside active), drawn into the same plots.
    note
        Where `beside` comes from, one sentence for the reader.
    health
        How the nodes fared, when there were any.
    """
    path.write_text(render(recording, beside, note, health), encoding="utf-8")
    picture = draw(charts_of(recording, beside, _PANELS), 2, str(recording.metadata["scenario"]["name"]))
    path.with_suffix(".svg").write_text(picture, encoding="utf-8")


def render(
    recording: Recording, beside: Recording | None = None, note: str = "", health: Sequence[NodeHealth] = ()
) -> str:
    """Text of the report; see `write_report`."""
    summary = summarise(recording)
    other = None if beside is None else summarise(beside)
    scenario = recording.metadata["scenario"]
    plots = time_plots(recording, beside)
    return _PAGE.substitute(
        title=html.escape(f"{summary['scenario']} ({'passive' if summary['passive'] else 'active'})"),
        description=html.escape(scenario.get("description", "")),
        verdict=_verdict(summary),
        warning=_warning(summary),
        facts=_facts(summary, scenario, recording.metadata.get("started", "unknown")),
        faults=_faults_table(summary),
        metrics=_metrics_table(summary, other, scenario),
        note=f"<p class=note>{html.escape(note)}</p>" if note else "",
        plots=plots.to_html(
            full_html=False,
            include_plotlyjs=True,
            div_id="time-plots",
            config={"responsive": True, "displaylogo": False, "toImageButtonOptions": {"format": "svg"}},
        ),
        still=draw(charts_of(recording, beside, _PANELS), 2, summary["scenario"]),
        details=_details(recording, beside),
        nodes=_nodes_table(health),
        scenario=html.escape(yaml.safe_dump(_without_empty(scenario), sort_keys=False, width=100)),
        command=html.escape(_command(summary)),
    )


def _verdict(summary: dict[str, Any]) -> str:
    """Say in one sentence what happened."""
    parts = [_fault_verdict(fault) for fault in summary["faults"]] or ["No fault was injected"]
    alarms = summary["false_alarms"]
    plural = "s" if alarms > 1 else ""
    parts.append("no false alarm" if alarms == 0 else f"<strong>{alarms} false alarm{plural}</strong>")
    return "; ".join(parts) + "."


def _fault_verdict(fault: dict[str, Any]) -> str:
    what = f"{fault['size']:g} {fault['unit']} on {fault['kind'].replace('_', ' ')} at {fault['onset_s']:g} s"
    named = fault["isolated_as"]
    if named is None:
        return f"{what}: not isolated"
    wrongly = "" if named == fault["kind"] else "<strong>wrongly</strong> "
    after = fault["isolated_s"] - fault["onset_s"]
    size = "" if fault["estimate"] is None else f", size {fault['estimate']:.2f} {_unit(named)}"
    return f"{what}: {wrongly}isolated as {named.replace('_', ' ')} after {after:.1f} s{size}"


def _unit(kind: str) -> str:
    return "rpm" if kind == "compressor_speed" else "kPa"


def _warning(summary: dict[str, Any]) -> str:
    if summary["complete"]:
        return ""
    return "<p class=warning>This recording was cut short; the figures cover what is there.</p>"


def _facts(summary: dict[str, Any], scenario: dict[str, Any], started: str) -> str:
    factor, wall = summary["real_time_factor"], summary["wall_seconds"]
    speed = "unknown" if not factor else f"{wall:.2f} s, {factor:.0f} times real time"
    control = "passive: K<sub>0</sub> alone" if summary["passive"] else "active: K<sub>0</sub> with compensator Q"
    facts = [
        ("Mode", {"simulate": "one process, without ROS"}.get(summary["mode"], summary["mode"])),
        ("Control", control),
        ("Operating point", html.escape(str(scenario.get("operating_point", "")))),
        ("Ticks", f"{summary['ticks']} at {summary['sample_time_s']:g} s"),
        ("Wall time", speed),
        ("Missed ticks", str(summary["missed_ticks"])),
        ("Started", html.escape(str(started))),
    ]
    return "".join(f"<div><dt>{name}</dt><dd>{value}</dd></div>" for name, value in facts)


def _faults_table(summary: dict[str, Any]) -> str:
    if not summary["faults"]:
        return ""
    rows = []
    for fault in summary["faults"]:
        isolated = fault["isolated_as"]
        rows.append(
            [
                _FAULT_NAMES[fault["kind"]],
                f"{fault['size']:g} {fault['unit']}",
                f"{fault['onset_s']:g}",
                _cell(fault["detected_s"], ".1f"),
                _cell(fault["isolated_s"], ".1f"),
                "–" if isolated is None else _FAULT_NAMES[isolated],
                "–" if isolated is None else f"{_cell(fault['estimate'], '.2f')} {_unit(isolated)}",
            ]
        )
    heads = ["Fault", "Size", "Onset, s", "Detected, s", "Isolated, s", "Isolated as", "Estimate"]
    return "<h2>Faults</h2>" + _table(heads, rows)


def _details(recording: Recording, beside: Recording | None) -> str:
    """Still pictures of the time around each fault, where the transients can be seen."""
    parts = []
    for fault in injected_faults(recording):
        start, stop = fault.onset_s - BEFORE_S, fault.onset_s + AFTER_S
        cut = between(recording, start, stop)
        other = None if beside is None else between(beside, start, stop)
        name = _FAULT_NAMES[fault.kind]
        parts.append(f"<h2>Around the fault {name}, {fault.onset_s:g} s</h2>")
        parts.append(
            f"<div class=scroll>{draw(charts_of(cut, other, _PANELS), 2, f'Around {fault.onset_s:g} s')}</div>"
        )
    return "\n".join(parts)


def _nodes_table(health: Sequence[NodeHealth]) -> str:
    """How the nodes fared; empty for a run without nodes."""
    if not health:
        return ""
    rows = [
        [
            f"<code>{html.escape(node.name)}</code>",
            html.escape(node.state),
            _cell(node.latency_p50_ms, ".2f"),
            _cell(node.latency_max_ms, ".2f"),
            f"{node.rejected_inputs} {html.escape(node.last_rejected)}",
        ]
        for node in health
    ]
    heads = ["Node", "State at the end", "Latency, typical, ms", "longest, ms", "Inputs refused"]
    return "<h2>Nodes</h2>" + _table(heads, rows)


def _metrics_table(summary: dict[str, Any], other: dict[str, Any] | None, scenario: dict[str, Any]) -> str:
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


def _cell(value: float | None, digits: str) -> str:
    """Format a number for a table: a dash where there is none, a true minus, and no sign on what rounds to zero."""
    if value is None or math.isnan(value):
        return "–"
    text = format(value, digits)
    return (text if float(text) else text.lstrip("+-")).replace("-", "\N{MINUS SIGN}")


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{text}</th>" for text in heads)
    body = "".join("<tr>" + "".join(f"<td>{text}</td>" for text in row) + "</tr>" for row in rows)
    return f"<div class=scroll><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"


def _without_empty(value: Any) -> Any:
    """Leave out what a scenario file would not say: None, and empty lists and mappings."""
    if isinstance(value, dict):
        kept = {key: _without_empty(item) for key, item in value.items()}
        return {key: item for key, item in kept.items() if item not in (None, [], {}, "")}
    if isinstance(value, list):
        return [_without_empty(item) for item in value]
    return value


def _command(summary: dict[str, Any]) -> str:
    passive = " --passive" if summary["passive"] else ""
    scenario = "scenario.yaml"
    if summary["mode"] == "simulate":
        return f"acftc simulate {scenario} --out results{passive}"
    return f"acftc run {scenario} --out results --mode {summary['mode']}{passive}"


_PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>acftc: $title</title>
<style>
  :root { --ink: #1a1a1a; --soft: #5a5f66; --line: #d8dbdf; --blue: #0072b2; }
  body { font: 16px/1.5 system-ui, "DejaVu Sans", sans-serif; color: var(--ink); margin: 0 auto; max-width: 1180px;
         padding: 1.5rem; }
  h1 { font-size: 1.6rem; margin: 0; } h2 { font-size: 1.15rem; margin: 2rem 0 .5rem; }
  .description { color: var(--soft); margin: .2rem 0 1rem; }
  .verdict { border-left: 4px solid var(--blue); padding: .3rem .9rem; background: #f2f7fb; }
  .warning { border-left: 4px solid #d55e00; padding: .3rem .9rem; background: #fdf3ec; }
  dl { display: flex; flex-wrap: wrap; gap: .4rem 2rem; margin: 1rem 0; }
  dt { font-size: .8rem; color: var(--soft); } dd { margin: 0; }
  table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
  th { text-align: left; font-weight: 600; border-bottom: 2px solid var(--line); }
  th, td { padding: .25rem .9rem .25rem 0; vertical-align: top; } td { border-bottom: 1px solid var(--line); }
  .scroll { overflow-x: auto; } .note { font-size: .9rem; color: var(--soft); max-width: 60rem; }
  pre { background: #f6f7f8; padding: .8rem 1rem; overflow-x: auto; font-size: .88rem; }
  svg[role=img] { max-width: 100%; height: auto; } .print { display: none; }
  /* Still pictures for print: the plots above are laid out for a screen. */
  @media print { body { max-width: none; padding: 0; font-size: 12px; } h2 { break-after: avoid; }
                 .scroll { overflow: visible; } .screen { display: none; } .print { display: block; }
                 pre { white-space: pre-wrap; } table, .verdict, svg { break-inside: avoid; } }
</style>
</head>
<body>
<h1>$title</h1>
<p class="description">$description</p>
<p class="verdict">$verdict</p>
$warning
<dl>$facts</dl>
$faults
<h2>Figures</h2>
$metrics
<h2>Course of the run</h2>
$note
<div class="screen">$plots</div>
<div class="print">$still</div>
$details
$nodes
<h2>How to run it again</h2>
<p class="note">Save the scenario as <code>scenario.yaml</code>, then:</p>
<pre>$command</pre>
<pre>$scenario</pre>
</body>
</html>
""")
