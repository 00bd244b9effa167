"""What the page draws: time plots, the cycle on the p-h diagram, the heat exchangers' zones."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from bokeh.core.properties import value
from bokeh.models import (
    ColumnDataSource,
    CrosshairTool,
    DataRange1d,
    FixedTicker,
    HoverTool,
    LogTickFormatter,
    PrintfTickFormatter,
    Range1d,
)
from bokeh.models.annotations import LabelSet
from bokeh.plotting import figure

from ac_common.faults import ISOLABLE, UNFILTERED, Fault
from ac_common.units import KPA
from ac_experiments.report.charts import BLACK, BLUE, GREEN, GREY, ORANGE, SKY, VERMILION
from ac_experiments.report.panels import Line
from bringup.dash.cycle import Corners, dome
from bringup.dash.rows import WINDOW_S, threshold_column

PALE = "#D9D9D9"
FONT = "system-ui, sans-serif"
KILO = 1.0e-3
#: Labels of a time plot's axis, about: to write one takes the browser as long as to draw a hundred points.
MOST_TICKS = 4


@dataclass(frozen=True)
class TimePlot:
    """A time plot: its name on the page, what it shows, its lines, and the least height of its axis in their unit."""

    name: str
    title: str
    lines: tuple[Line, ...]
    least: float
    digits: str = "0.00"


def _controlled(stem: str) -> tuple[Line, ...]:
    return (
        Line(f"{stem}_measured", "measured", ORANGE, width=3.0),
        Line(stem, "actual", BLUE),
        Line(f"{stem}_reference", "reference", BLACK, "dashed", 1.4),
    )


def _fault(fault: Fault) -> TimePlot:
    """Return the plot of a fault that a filter estimates: what is injected, and the estimate with its thresholds."""
    lines = [Line(fault.symbol, "injected", VERMILION, "dashed")]
    least, digits = fault.typical / 5.0, "0.0" if fault.typical > 10.0 else "0.00"
    threshold = threshold_column(fault)
    lines += [
        Line(fault.residual_symbol, "residual", BLUE),
        Line(threshold, "threshold", GREY, "dotdash", 1.2),
        Line(f"{threshold}_low", "threshold", GREY, "dotdash", 1.2),
    ]
    return TimePlot(fault.kind, f"Residual {fault.symbol}, {fault.unit}", tuple(lines), least, digits)


_FAULTS = {fault.kind: _fault(fault) for fault in ISOLABLE}
_COLOURS = (VERMILION, BLUE, GREEN, ORANGE, SKY, BLACK)
_OTHERS = tuple(
    Line(fault.symbol, fault.symbol, _COLOURS[i % len(_COLOURS)], ("solid", "dashed")[i // len(_COLOURS) % 2])
    for i, fault in enumerate(UNFILTERED)
)
"""Faults that are only known to have been injected: in one plot, since most of them are zero most of the time."""
_FIRST = ("evaporator_pressure", "compressor_speed")
"""Faults whose plots stand beside those of pressure and superheat; those of the others come at the end."""

#: In the order in which the page shows them, two in a row.
TIME_PLOTS = (
    TimePlot("p_e", "Pressure p_e, kPa", _controlled("p_e"), 4.0),
    _FAULTS[_FIRST[0]],
    TimePlot("superheat", "Superheat SH, K", _controlled("superheat"), 2.0),
    _FAULTS[_FIRST[1]],
    TimePlot(
        "speed",
        "Compressor speed, rpm",
        (Line("speed_actual", "actual", ORANGE, width=3.0), Line("speed", "command", BLUE)),
        20.0,
        "0.0",
    ),
    TimePlot("valve", "Expansion valve, %", (Line("valve", "command", BLUE),), 1.0),
    TimePlot("q_speed", "Compensator q, rpm", (Line("q_speed", "q", BLUE),), 5.0, "0.0"),
    TimePlot("q_valve", "Compensator q, valve, %", (Line("q_valve", "q", BLUE),), 0.5),
    TimePlot(
        "wall",
        "Wall temperature T_w, °C",
        (Line("wall_measured", "measured", ORANGE, width=3.0), Line("wall", "actual", BLUE)),
        1.0,
    ),
    TimePlot(
        "air",
        "Load: air mass flow, g/s",
        (Line("air_flow", "evaporator", GREEN), Line("condenser_flow", "condenser", ORANGE)),
        5.0,
        "0.0",
    ),
    TimePlot(
        "inlets",
        "Load: air inlets, °C",
        (Line("air_inlet", "evaporator", GREEN), Line("condenser_inlet", "condenser", ORANGE)),
        2.0,
        "0.0",
    ),
    TimePlot(
        "vents",
        "Vents and cabin, °C",
        (Line("vents", "vents", BLUE), Line("cabin", "cabin air, in a car", ORANGE)),
        2.0,
        "0.0",
    ),
    *(plot for kind, plot in _FAULTS.items() if kind not in _FIRST),
    TimePlot("other_faults", "Other faults injected, % of the largest", _OTHERS, 5.0, "0.0"),
)


#: Zones of the heat exchangers: name, colour.
ZONES = (("two-phase", SKY), ("superheated", ORANGE), ("subcooled", BLUE))


@dataclass(frozen=True)
class Key:
    """The line above a plot: what it shows, and which line is what (name, colour, dashes as in SVG, width)."""

    name: str
    title: str
    lines: tuple[tuple[str, str, str, float], ...]


_DASHES = {"solid": "", "dashed": "6 4", "dotdash": "2 4 6 4"}


def keys() -> tuple[Key, ...]:
    """Return the keys of all plots, for the page to write above them: the same for as long as the page is there."""
    times = [
        Key(
            plot.name,
            plot.title,
            tuple(dict.fromkeys((line.name, line.colour, _DASHES[line.dash], line.width) for line in plot.lines)),
        )
        for plot in TIME_PLOTS
    ]
    cycle = (("saturation", GREY, "", 1.4), ("at rest", PALE, "", 5.0), ("now", BLUE, "", 2.0))
    zones = tuple((zone, colour, "", 10.0) for zone, colour in ZONES)
    return (*times, Key("cycle", "Cycle: pressure, kPa", cycle), Key("zones", "Zones", zones))


def event_source() -> ColumnDataSource:
    """Return the source of the marks of events: their times `t`."""
    return ColumnDataSource({"t": []})


def time_plots(source: ColumnDataSource, events: ColumnDataSource) -> tuple[list[figure], DataRange1d]:
    """Make all time plots over one source; they share their time axis, and the marks of events."""
    time = DataRange1d(follow="end", follow_interval=WINDOW_S, default_span=WINDOW_S, range_padding=0.0)
    crosshair = CrosshairTool(dimensions="height", line_alpha=0.4)
    return [_time_plot(plot, source, events, time, crosshair) for plot in TIME_PLOTS], time


def _time_plot(
    plot: TimePlot, source: ColumnDataSource, events: ColumnDataSource, time: DataRange1d, crosshair: CrosshairTool
) -> figure:
    y_range = DataRange1d(min_interval=plot.least, range_padding=0.12)
    drawn = _figure(
        name=plot.name,
        x_range=time,
        y_range=y_range,
    )
    drawn.vspan(x="t", source=events, line_color=VERMILION, line_alpha=0.6, line_width=1.0)
    lines = [
        drawn.line("t", line.key, source=source, color=line.colour, line_dash=line.dash, line_width=line.width)
        for line in plot.lines
    ]
    y_range.renderers = list(lines)
    tips = [(line.name, f"@{line.key}{{{plot.digits}}}") for line in plot.lines if not line.key.endswith("_low")]
    drawn.xaxis.formatter = PrintfTickFormatter(format="%g s")
    for axis in (*drawn.xaxis, *drawn.yaxis):
        axis.ticker.desired_num_ticks = MOST_TICKS
    drawn.add_tools(
        HoverTool(renderers=[lines[-1]], mode="vline", line_policy="nearest", tooltips=[("time", "@t{0.0} s"), *tips]),
        crosshair,
    )
    return drawn


def cycle_source() -> ColumnDataSource:
    """Return the source of the cycle's line, and of its corners."""
    return ColumnDataSource({"h": [], "p": [], "corner": []})


def cycle_columns(at: Corners) -> dict[str, list[Any]]:
    """Return the content of `cycle_source`: the corners, closed."""
    h, p = (at.enthalpy_j_kg * KILO).tolist(), (at.pressure_pa / KPA).tolist()
    return {"h": [*h, h[0]], "p": [*p, p[0]], "corner": ["1", "2", "3", "4", ""]}


def cycle_plot(live: ColumnDataSource, rest: ColumnDataSource) -> figure:
    """Make the p-h diagram: saturation line, the cycle at rest at the operating point, and the cycle now."""
    h, p = dome()
    drawn = _figure(
        name="cycle",
        y_axis_type="log",
        x_range=Range1d(start=190.0, end=505.0),
        y_range=Range1d(start=100.0, end=3200.0),
        x_axis_label="enthalpy, kJ/kg",
    )
    drawn.yaxis.ticker = FixedTicker(ticks=[100, 200, 300, 500, 1000, 2000, 3000])
    drawn.yaxis.formatter = LogTickFormatter(min_exponent=5)
    drawn.line(h * KILO, p / KPA, color=GREY, line_width=1.4)
    drawn.line("h", "p", source=rest, color=PALE, line_width=5.0)
    now = drawn.line("h", "p", source=live, color=BLUE, line_width=2.0)
    drawn.scatter("h", "p", source=live, color=BLUE, size=7)
    drawn.add_layout(
        LabelSet(
            x="h", y="p", text="corner", source=live, x_offset=6, y_offset=5, text_font=value(FONT),
            text_font_size="13px", text_font_style="bold", text_color=BLACK,
        )
    )  # fmt: skip
    drawn.add_tools(HoverTool(renderers=[now], tooltips=[("h", "$x{0.0} kJ/kg"), ("p", "$y{0} kPa")]))
    return drawn


def zone_source() -> ColumnDataSource:
    """Return the source of the zones' bars."""
    return ColumnDataSource({key: [] for key in ("side", "left", "right", "zone", "colour")})


def zone_columns(state: Mapping[str, float]) -> dict[str, list[Any]]:
    """Return the content of `zone_source` from the paper's state; in the order in which the refrigerant flows."""
    colours = dict(ZONES)
    z_e, z_1, z_2 = state["zeta_e1"], state["zeta_c1"], state["zeta_c2"]
    bars = [
        ("evaporator", 0.0, z_e, "two-phase"),
        ("evaporator", z_e, 1.0, "superheated"),
        ("condenser", 0.0, z_1, "superheated"),
        ("condenser", z_1, z_1 + z_2, "two-phase"),
        ("condenser", z_1 + z_2, 1.0, "subcooled"),
    ]
    side, left, right, zone = (list(column) for column in zip(*bars, strict=True))
    percent = [[100.0 * value for value in ends] for ends in (left, right)]
    return {
        "side": side,
        "left": percent[0],
        "right": percent[1],
        "zone": zone,
        "colour": [colours[name] for name in zone],
    }


def zone_plot(source: ColumnDataSource) -> figure:
    """Make the bars of the zones' lengths."""
    drawn = _figure(
        name="zones",
        y_range=["condenser", "evaporator"],
        x_range=Range1d(start=0.0, end=100.0),
        x_axis_label="length, %",
    )
    bars = drawn.hbar(
        y="side", left="left", right="right", height=0.62, color="colour", line_color="white", source=source
    )
    drawn.ygrid.visible = False
    drawn.add_tools(HoverTool(renderers=[bars], tooltips=[("@side, @zone", "@left{0.0} to @right{0.0} %")]))
    return drawn


def _figure(**options: Any) -> figure:
    drawn = figure(
        tools="xwheel_zoom,xbox_zoom,reset,save",
        toolbar_location="above",
        toolbar_inner=True,
        sizing_mode="stretch_both",
        min_border_left=52,
        min_border_right=8,
        outline_line_color=None,
        output_backend="canvas",
        **options,
    )
    drawn.toolbar.logo = None
    drawn.toolbar.autohide = True
    drawn.grid.grid_line_color = "#E4E4E4"
    for axis in (*drawn.xaxis, *drawn.yaxis):
        axis.axis_line_color = GREY
        axis.minor_tick_line_color = None
        axis.major_tick_line_color = GREY
        axis.axis_label_text_font = axis.major_label_text_font = FONT
        axis.major_label_text_font_size = axis.axis_label_text_font_size = "12px"
        axis.axis_label_text_font_style = "normal"
        axis.axis_label_standoff = 2
        axis.axis_label_text_color = axis.major_label_text_color = "#222222"
    return drawn
