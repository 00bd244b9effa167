"""All experiments of `acftc reproduce` on one page that needs nothing else."""

import html
import math

from ac_common.errors import one_line
from ac_experiments.paper.judgement import Experiment, Finding


def page(experiments: list[Experiment]) -> str:
    """All experiments on one page that needs nothing else."""
    parts = [_HEAD, "<h1>The paper's experiments</h1>", _overview(experiments)]
    for experiment in experiments:
        parts.append(f"<h2 id={experiment.id}>{experiment.id} {html.escape(experiment.title)}</h2>")
        if experiment.findings:
            parts.append(_findings_table(experiment.findings))
        parts.append(f"<p class=note>{html.escape(experiment.remark)}</p>")
        parts.append(f"<div class=scroll>{experiment.picture}</div>")
    return "\n".join([*parts, "</body></html>\n"])


def _overview(experiments: list[Experiment]) -> str:
    rows = [
        f"<tr><td><a href=#{item.id}>{item.id}</a></td><td>{html.escape(item.title)}</td>"
        f"<td class='{item.verdict.replace(' ', '-')}'>{item.verdict}</td></tr>"
        for item in experiments
    ]
    return f"<table><tbody>{''.join(rows)}</tbody></table>"


def _findings_table(findings: list[Finding]) -> str:
    rows = [
        f"<tr><td>{html.escape(item.quantity)}</td><td>{html.escape(item.unit)}</td><td>{_number(item.paper)}</td>"
        f"<td>{_number(item.ours)}</td><td class='{item.verdict}'>{item.verdict}</td>"
        f"<td class=note>{html.escape(one_line(item.rule))}</td></tr>"
        for item in findings
    ]
    head = "<tr><th></th><th>Unit</th><th>Paper</th><th>Ours</th><th>Verdict</th><th>Rule</th></tr>"
    return f"<table><thead>{head}</thead><tbody>{''.join(rows)}</tbody></table>"


def _number(value: float | None) -> str:
    return "–" if value is None or not math.isfinite(value) else f"{value:.4g}".replace("-", "\N{MINUS SIGN}")


_HEAD = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>acftc: the paper's experiments</title><style>
body { font: 16px/1.5 system-ui, "DejaVu Sans", sans-serif; color: #1a1a1a; margin: 0 auto; max-width: 1180px;
       padding: 1.5rem; }
h2 { font-size: 1.15rem; margin: 2.2rem 0 .5rem; break-after: avoid; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th { text-align: left; border-bottom: 2px solid #d8dbdf; } td { border-bottom: 1px solid #d8dbdf; }
th, td { padding: .2rem .9rem .2rem 0; vertical-align: top; }
.note { font-size: .9rem; color: #5a5f66; } .scroll { overflow-x: auto; } svg { max-width: 100%; height: auto; }
.agrees, .better { color: #00694e; font-weight: 600; } .differs { color: #b04a00; font-weight: 600; }
</style></head><body>"""
