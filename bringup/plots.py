"""The paper's plots of a run: outputs, commands and residuals over a common time axis, as one plotly figure."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from bringup.recording import Recording
from bringup.summary import injected_faults
from bringup.units import KPA, RPM

# Okabe and Ito's palette, told apart by colour-blind readers too; dashes tell the lines apart without any colour.
BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE, GREY = (
    "#000000",
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#0072B2",
    "#D55E00",
    "#CC79A7",
    "#7F7F7F",
)

_ROW_PX = 210
_FONT = '"DejaVu Sans", system-ui, sans-serif'


@dataclass(frozen=True)
class Line:
    """One line of a plot: where it comes from, how it is scaled, how it looks."""

    key: str
    name: str
    colour: str
    dash: str = "solid"
    width: float = 1.8
    step: bool = False


@dataclass(frozen=True)
class Panel:
    """One plot of the column: title with unit, scale from SI, its lines of the run itself and of the run beside it."""

    title: str
    per_unit: float
    own: tuple[Line, ...]
    beside: tuple[Line, ...] = ()
    digits: str = ".3f"
    fault: str | None = None


def _panels(recording: Recording, both: bool) -> list[Panel]:
    """Panels of the report; the air side only when something happens there."""
    passive = bool(recording.metadata["passive"])
    ours, theirs = ("passive", "active") if passive else ("active", "passive")
    own, soft = (VERMILION, ORANGE) if passive else (BLUE, SKY)
    other = BLUE if passive else VERMILION
    tag = f", {ours}" if both else ""

    def output(quantity: str, title: str, per_unit: float) -> Panel:
        return Panel(
            title,
            per_unit,
            (
                Line(f"measured/{quantity}", f"measured{tag}", soft, width=1.4),
                Line(f"plant/{quantity}", f"actual{tag}", own, width=2.2),
                Line(f"reference/{quantity}", "reference", BLACK, "dash", 1.2),
            ),
            (Line(f"plant/{quantity}", f"actual, {theirs}", other, "dashdot"),),
        )

    def input_(joint: str, title: str, per_unit: float) -> Panel:
        return Panel(
            title,
            per_unit,
            (
                Line(f"actuator/command:{joint}", f"reached the plant{tag}", soft, width=1.4, step=True),
                Line(f"controller/command:{joint}", f"commanded{tag}", own, width=2.2, step=True),
            ),
            (Line(f"controller/command:{joint}", f"commanded, {theirs}", other, "dashdot", step=True),),
        )

    def residual(key: str, kind: str, title: str, per_unit: float) -> Panel:
        return Panel(
            title,
            per_unit,
            (
                Line(f"fault/{key}", "fault injected", BLACK, "dash", 1.4, step=True),
                Line(f"fdi/residual/{key}", "residual", own, width=2.2),
            ),
            fault=kind,
        )

    panels = [
        output("evaporator_pressure", "Evaporator pressure p<sub>e</sub>, kPa", KPA),
        output("superheat", "Superheat SH, K", 1.0),
        input_("compressor", "Compressor speed N, rpm", RPM),
        input_("expansion_valve", "Expansion valve, %", 0.01),
        residual("compressor_speed:compressor", "compressor_speed", "Residual r<sub>N</sub>, rpm", RPM),
        residual("evaporator_pressure", "evaporator_pressure", "Residual r<sub>p</sub>, kPa", KPA),
    ]
    if _varies(recording, "scenario/air:evaporator_air"):
        flow = Line("scenario/air:evaporator_air", "air flow", GREEN, step=True)
        panels.append(Panel("Evaporator air flow, kg/s", 1.0, (flow,), digits=".4f"))
    if _varies(recording, "scenario/air_inlet_temperature"):
        inlet = Line("scenario/air_inlet_temperature", "air inlet", GREEN, step=True)
        panels.append(Panel("Evaporator air inlet, °C", 1.0, (inlet,)))
    return panels


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
    panels = _panels(recording, beside is not None)
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
        _readable_range(figure, row, recording, beside, panel)
    _mark_instants(figure, recording)
    _lay_out(figure, recording, len(panels))
    return figure


def _varies(recording: Recording, key: str) -> bool:
    values = recording.series[key]
    values = values[np.isfinite(values)]
    return bool(len(values)) and bool(values.max() > values.min())


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
    if not recording.status:
        return
    index = 0 if panel.fault == "compressor_speed" else 1
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
    key = panel.own[1].key
    for kind, symbol, colour, at in _instants(recording):
        if not at:
            continue
        figure.add_trace(
            go.Scatter(
                x=at,
                y=np.interp(at, recording.time_s, recording.series[key]) / panel.per_unit,
                name=kind,
                mode="markers",
                marker={"symbol": symbol, "size": 9, "color": colour, "line": {"color": "white", "width": 1}},
                legend=_legend(row),
                legendrank=30,
                hovertemplate=f"{kind} at %{{x:.1f}} s<extra></extra>",
            ),
            row=row,
            col=1,
        )


def _instants(recording: Recording) -> list[tuple[str, str, str, list[float]]]:
    """Instants at which a detection begins and a fault is named: (what, symbol, colour, times)."""
    detections, isolations = [], []
    detected, isolated = False, None
    for row in recording.status:
        if row.detected and not detected:
            detections.append(row.time_s)
        if row.isolated is not None and row.isolated != isolated:
            isolations.append(row.time_s)
        detected, isolated = row.detected, row.isolated
    return [("detected", "triangle-up", PURPLE, detections), ("isolated", "diamond", GREEN, isolations)]


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
            yanchor="top",
            font={"size": 11, "color": GREY},
        )
    for at in _instants(recording)[1][3]:
        figure.add_vline(x=at, line={"color": GREEN, "width": 1}, layer="below")
    if _instants(recording)[1][3]:
        figure.add_annotation(
            x=_instants(recording)[1][3][0],
            y=1.0,
            yref="y domain",
            xref="x",
            text=" isolated" + (", Q acts" if not recording.metadata["passive"] else ""),
            showarrow=False,
            xanchor="left",
            yanchor="top",
            font={"size": 11, "color": GREEN},
        )


def _readable_range(figure: Any, row: int, recording: Recording, beside: Recording | None, panel: Panel) -> None:
    """Keep rounding noise from filling a panel: at least a thousandth of the value, or a tenth of a unit."""
    lines = [recording.series[line.key] for line in panel.own]
    lines += [beside.series[line.key] for line in panel.beside] if beside is not None else []
    values: NDArray[np.float64] = np.concatenate(lines) / panel.per_unit
    values = values[np.isfinite(values)]
    if not len(values):
        return
    low, high = float(values.min()), float(values.max())
    least = max(0.1 if panel.digits == ".3f" else 0.001, 1e-3 * abs(high))
    if panel.fault is not None and recording.status:
        index = 0 if panel.fault == "compressor_speed" else 1
        least = max(least, 3.0 * recording.status[-1].thresholds[index] / panel.per_unit)
    if high - low < least:
        middle = 0.5 * (low + high)
        low, high = middle - 0.5 * least, middle + 0.5 * least
    margin = 0.08 * (high - low)
    figure.update_yaxes(range=[low - margin, high + margin], row=row, col=1)


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
