"""The paper's plots of a run: outputs, commands and residuals over a common time axis, as one plotly figure."""

from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from bringup.recording import Recording
from bringup.report.panels import GREEN, GREY, PURPLE, Line, Panel, instants, panels_of, readable_range
from bringup.summary import injected_faults
from bringup.topics import FAULTS

_ROW_PX = 210
_FONT = '"DejaVu Sans", system-ui, sans-serif'


def time_plots(recording: Recording, beside: Recording | None = None) -> Any:
    """All plots of a run over a common time axis.

    Parameters
    ----------
    recording
        The run.
    beside
        A run of the same scenario with the other kind of control, or None.

    Returns
    -------
    plotly.graph_objects.Figure
        One row for each panel, with a legend of its own.
    """
    panels = panels_of(recording, beside is not None)
    figure = make_subplots(
        rows=len(panels),
        cols=1,
        shared_xaxes=True,
        vertical_spacing=0.055 * 6 / len(panels),
        subplot_titles=[panel.title for panel in panels],
    )
    for row, panel in enumerate(panels, start=1):
        # The run beside lies underneath; the legend lists this run first.
        for rank, line in enumerate(panel.beside if beside is not None else ()):
            _draw(figure, row, beside, line, panel, rank=10 + rank)
        for rank, line in enumerate(panel.own):
            _draw(figure, row, recording, line, panel, rank=5 - rank)
        if panel.fault is not None:
            _draw_thresholds(figure, row, recording, panel)
        limits = readable_range(recording, beside, panel)
        if limits is not None:
            figure.update_yaxes(range=limits, row=row, col=1)
    _mark_instants(figure, recording)
    _lay_out(figure, recording, len(panels))
    return figure


def _legend(row: int) -> str:
    return "legend" if row == 1 else f"legend{row}"


def _draw(figure: Any, row: int, run: Recording | None, line: Line, panel: Panel, rank: int) -> None:
    if run is None:
        return
    figure.add_trace(
        go.Scatter(
            **_time_axis(run),
            y=(run.series[line.key] / panel.per_unit).astype(np.float32),
            name=line.name,
            mode="lines",
            line={
                "color": line.colour,
                "dash": line.dash,
                "width": line.width,
                "shape": "hv" if line.step else "linear",
            },
            legend=_legend(row),
            legendrank=rank,
            hovertemplate=f"%{{y:{panel.digits}}}",
        ),
        row=row,
        col=1,
    )


def _time_axis(run: Recording) -> dict[str, Any]:
    """Time by start and step when the ticks are evenly spaced (a third of the page's size), else in full."""
    time_s = run.time_s
    step = float(run.metadata["sample_time_s"])
    if np.allclose(np.diff(time_s), step, rtol=0.0, atol=1e-6):
        return {"x0": float(time_s[0]), "dx": step}
    return {"x": time_s}


def _draw_thresholds(figure: Any, row: int, recording: Recording, panel: Panel) -> None:
    """Draw the detection thresholds, and the instants of detection and isolation on the residual itself."""
    if not recording.status or panel.fault is None:
        return
    index = FAULTS.index(panel.fault)
    times = np.array([status.time_s for status in recording.status])
    threshold = np.array([status.thresholds[index] for status in recording.status]) / panel.per_unit
    keep = np.concatenate([[True], np.diff(threshold) != 0.0])
    keep[-1] = True
    for sign in (1.0, -1.0):
        figure.add_trace(
            go.Scatter(
                x=times[keep],
                y=sign * threshold[keep],
                name="threshold",
                mode="lines",
                line={"color": GREY, "dash": "dot", "width": 1.2, "shape": "hv"},
                legend=_legend(row),
                legendrank=20,
                showlegend=sign > 0,
                hoverinfo="skip",
            ),
            row=row,
            col=1,
        )
    detections, isolations = instants(recording)
    named = [at for at, kind in isolations if kind == panel.fault]
    # A detection belongs to the residual whose fault is named next.
    seen = [at for at in detections if next((kind for when, kind in isolations if when >= at), None) == panel.fault]
    key = panel.own[1].key
    for what, symbol, colour, at in (("detected", "triangle-up", PURPLE, seen), ("isolated", "diamond", GREEN, named)):
        if not at:
            continue
        figure.add_trace(
            go.Scatter(
                x=at,
                y=np.interp(at, recording.time_s, recording.series[key]) / panel.per_unit,
                name=what,
                mode="markers",
                marker={"symbol": symbol, "size": 9, "color": colour, "line": {"color": "white", "width": 1}},
                legend=_legend(row),
                legendrank=30,
                hovertemplate=f"{what} at %{{x:.1f}} s<extra></extra>",
            ),
            row=row,
            col=1,
        )


def _mark_instants(figure: Any, recording: Recording) -> None:
    """Draw vertical lines through every panel: onset of each fault, and the instant of its isolation."""
    for fault in injected_faults(recording):
        for at in (fault.onset_s, fault.end_s):
            if np.isfinite(at):
                figure.add_vline(x=at, line={"color": GREY, "width": 1, "dash": "dash"}, layer="below")
        figure.add_annotation(
            x=fault.onset_s,
            y=1.0,
            yref="y domain",
            xref="x",
            text="fault ",
            showarrow=False,
            xanchor="right",
            yanchor="bottom",
            font={"size": 11, "color": GREY},
        )
    isolations = instants(recording)[1]
    for at, _ in isolations:
        figure.add_vline(x=at, line={"color": GREEN, "width": 1}, layer="below")
    if isolations:
        figure.add_annotation(
            x=isolations[0][0],
            y=1.0,
            yref="y domain",
            xref="x",
            text=" isolated" + ("" if recording.metadata["passive"] else ", Q acts"),
            showarrow=False,
            xanchor="left",
            yanchor="bottom",
            font={"size": 11, "color": GREEN},
        )


def _lay_out(figure: Any, recording: Recording, rows: int) -> None:
    for row in range(1, rows + 1):
        top = figure.layout[f"yaxis{'' if row == 1 else row}"].domain[1]
        figure.update_layout({_legend(row): {"x": 1.01, "xanchor": "left", "y": top, "yanchor": "top"}})
    figure.update_annotations(selector={"xref": "paper"}, x=0.0, xanchor="left", font={"size": 14})
    figure.update_xaxes(
        range=[float(recording.time_s[0]), float(recording.time_s[-1])],
        showline=True,
        linecolor=GREY,
        gridcolor="#ebedef",
        zeroline=False,
        ticks="outside",
    )
    figure.update_yaxes(showline=True, linecolor=GREY, gridcolor="#ebedef", zeroline=False, ticks="outside")
    figure.update_yaxes(tickformat=".6~g")
    figure.update_xaxes(title_text="Time, s", row=rows, col=1)
    figure.update_layout(
        height=_ROW_PX * rows + 80,
        margin={"l": 70, "r": 190, "t": 40, "b": 50},
        font={"family": _FONT, "size": 12, "color": "#1a1a1a"},
        plot_bgcolor="white",
        paper_bgcolor="white",
        hovermode="x unified",
        hoversubplots="axis",
    )
