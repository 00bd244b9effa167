"""The page: plots, lamps, controls, for each browser that opens it; the graph's state is the same for all."""

import ctypes
import gc
import math
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from bokeh.document import Document
from bokeh.models import ColumnDataSource, CustomJS
from bokeh.models.widgets import Div, RadioButtonGroup
from jinja2 import Environment, FileSystemLoader

from ac_common.faults import ISOLABLE, UNFILTERED, UNKNOWN, in_unit
from ac_common.health import PlantReport
from ac_common.signals import Performance
from ac_common.units import KPA
from bringup.dash.controls import (
    CHANGES,
    LOADS,
    N_REFERENCES,
    STYLE,
    ChangeControl,
    FaultControl,
    RunControl,
)
from bringup.dash.cycle import corners, subcooled_enthalpy
from bringup.dash.events import Happening, marks
from bringup.dash.link import Link
from bringup.dash.plots import (
    TIME_PLOTS,
    cycle_columns,
    cycle_plot,
    cycle_source,
    event_source,
    keys,
    time_plots,
    zone_columns,
    zone_plot,
    zone_source,
)
from bringup.dash.rows import MOST_ROWS, ROW_PERIOD_S, WINDOW_S, columns_of
from bringup.dash.view import View

#: Time between two updates, ms.
UPDATE_MS = 100
#: A plot is about so many pixels wide: it is drawn anew when it has moved by one, since nobody sees less.
WIDTH_PX = 400
#: Texts with figures change more slowly than plots, or nobody could read them; s.
TEXT_PERIOD_S = 0.5
#: A browser that has drawn nothing for so long, s, gets another update all the same: its answer may be lost.
ANSWER_S = 1.0
#: How long after a page is gone what it held is given back, s.
TIDY_S = 1.0
#: So many of the last events are listed.
SHOWN_EVENTS = 12
#: Choices of how much time the plots show, s.
WINDOWS_S = (30, 120, round(WINDOW_S))

_TEXT = """
:host { font-family: system-ui, sans-serif; font-size: 14px; color: #1a1a1a; }
.bk-clearfix { display: block; width: 100%; }
.lamps { display: flex; flex-wrap: wrap; gap: 6px; }
.lamp { border: 1.5px solid #767676; border-radius: 999px; padding: 3px 12px 3px 9px; background: #fff; }
.lamp::before { content: "\\25CB"; margin-right: 6px; }
.lamp.on { color: #000; font-weight: 600; border-color: #000; }
.lamp.on::before { content: "\\25CF"; }
.lamp.on.good { background: #5fc9a6; }
.lamp.on.warn { background: #E69F00; }
.lamp.on.bad { background: #f08a4b; }
.lamp.on.wait { background: #D9D9D9; }
.readouts { display: grid; grid-template-columns: repeat(auto-fill, minmax(104px, 1fr)); gap: 6px 10px; }
.readouts div { border-left: 3px solid #56B4E9; padding-left: 7px; }
.readouts b { display: block; font-size: 16px; font-variant-numeric: tabular-nums; white-space: nowrap; }
.readouts span { font-size: 12px; color: #444; white-space: nowrap; }
.happenings { font-size: 12px; } .happenings table { border-collapse: collapse; width: 100%; }
.happenings td { padding: 1px 8px 1px 0; vertical-align: top; } .happenings td:first-child { white-space: nowrap; }
.happenings h2 { font-size: 13px; margin: 0 0 3px; } .happenings p { margin: 6px 0 0; color: #444; }
.said { min-height: 1.3em; overflow-wrap: anywhere; }
.said.failed { color: #8a2b00; font-weight: 600; }
.said.failed::before { content: "\\2717\\00A0"; }
"""


_FOLDER = FileSystemLoader(Path(__file__).parent)
_FRAGMENTS: Any = Environment(loader=_FOLDER, autoescape=True).get_template("fragments.html").module


def make_page(link: Link, problem: Callable[[], str]) -> Callable[[Document], None]:
    """Make the function that fills a browser's document.

    Parameters
    ----------
    link : Link
        The page's ROS node.
    problem : callable
        What is wrong with a graph of our own, empty when nothing is.
    """
    template = Environment(loader=_FOLDER, autoescape=False).get_template("page.html")

    def fill(document: Document) -> None:
        document.title = "acftc live"
        document.template = template
        document.template_variables["keys"] = {key.name: key for key in keys()}
        document.template_variables["plots"] = [plot.name for plot in TIME_PLOTS]
        document.template_variables["faults"] = ISOLABLE
        document.template_variables["loads"] = [name for name, *_ in CHANGES[N_REFERENCES:]]
        document.template_variables["references"] = [name for name, *_ in CHANGES[:N_REFERENCES]]
        document.template_variables["moves"] = [f"load_{number}" for number in range(len(LOADS))]
        page = _Page(link, problem, document)
        with document.models.freeze():  # Bokeh would look through all models again with each root: seconds
            for root in page.roots:
                document.add_root(root)
        document.js_on_event("connection_lost", CustomJS(code="document.getElementById('lost').hidden = false"))
        page.update()
        page.updates = document.add_periodic_callback(page.update, UPDATE_MS)
        document.on_session_destroyed(_tidy_up)

    return fill


def _tidy_up(_session: Any) -> None:
    """Give back to the system what a page has held: Bokeh lets go of it, and the C library would keep it for later."""
    from tornado.ioloop import IOLoop

    def give_back() -> None:
        gc.collect()
        if trim := getattr(ctypes.CDLL(None), "malloc_trim", None):  # glibc's
            trim(0)

    IOLoop.current().call_later(TIDY_S, give_back)


class _Page:
    """What one browser sees."""

    def __init__(self, link: Link, problem: Callable[[], str], document: Document) -> None:
        self._link, self._problem, self._document = link, problem, document
        self.updates: Any = None
        self._was_open = False
        self._seen = (0, 0)
        self._texts_s = self._plots_s = -math.inf
        self._zones: dict[str, float] = {}
        self._rest_of = ""
        self._source = ColumnDataSource(columns_of([]), name="rows")
        self._cycle, self._rest, self._zone = cycle_source(), cycle_source(), zone_source()
        self._event_source = event_source()
        plots, self._time = time_plots(self._source, self._event_source)
        window = RadioButtonGroup(
            name="window", labels=[f"{s} s" for s in WINDOWS_S], active=1, margin=0, stylesheets=[STYLE]
        )
        window.on_change("active", lambda _attr, _old, new: self._show_last(WINDOWS_S[new]))
        self._rows = MOST_ROWS  # as many as are shown: the browser draws them all each time
        self._show_last(WINDOWS_S[1])
        # The browser answers each update when it has drawn it; without that, one that is slower than the updates, or in
        # the background, would fall behind more and more, and its clicks with it.
        self._sent = self._drawn = 0
        self._sent_s = -math.inf
        # Marks of the rows themselves, or of their axis, would make it draw all plots each time they change.
        self._mark, answer = ColumnDataSource(), ColumnDataSource()
        code = "requestAnimationFrame(() => { answer.tags = mark.tags })"
        self._mark.js_on_change("tags", CustomJS(args={"mark": self._mark, "answer": answer}, code=code))
        answer.on_change("tags", lambda _attr, _old, new: self._answered(new))
        window.tags = [self._mark]  # so that the browser has it
        self._lamps, self._readouts, self._said, self._happenings = (
            Div(name=name, sizing_mode="stretch_width", margin=0, stylesheets=[_TEXT])
            for name in ("lamps", "readouts", "said", "happenings")
        )
        self._controls: list[FaultControl | ChangeControl | RunControl] = [
            *(FaultControl(fault.symbol, (fault,), link) for fault in ISOLABLE),
            FaultControl("other", UNFILTERED, link),
            ChangeControl(link),
            RunControl(link),
        ]
        widgets = [widget for control in self._controls for widget in control.widgets]
        self.roots = [
            *plots, cycle_plot(self._cycle, self._rest), zone_plot(self._zone), window, self._lamps, self._readouts,
            self._said, self._happenings, *widgets,
        ]  # fmt: skip

    def update(self) -> None:
        """Show what is new, unless the browser is still busy with what was."""
        if self._is_left():
            return
        now = time.monotonic()
        if self._sent - self._drawn > 1 and now - self._sent_s < ANSWER_S:
            return
        self._sent += 1
        self._sent_s = now
        self._mark.tags = [self._sent]
        view = self._link.view()
        if now - self._plots_s >= self._rows * ROW_PERIOD_S / WIDTH_PX:
            self._plots_s = now
            self._show_rows(view)
        for control in self._controls:
            control.show(view)
        _set_text(self._lamps, lamps(view, self._problem()))
        _set_text(self._said, said(view, self._problem()))
        if now - self._texts_s >= TEXT_PERIOD_S:
            self._texts_s = now
            _set_text(self._readouts, readouts(self._link.rows.newest, view))
            events = self._link.events.since(self._link.rows.first_ns)
            _set_text(self._happenings, happenings(events, view))
            if (at := marks(events)) != self._event_source.data["t"]:
                self._event_source.data = {"t": at}

    def _show_rows(self, view: View) -> None:
        generation, count, rows = self._link.rows.since(*self._seen)
        if generation != self._seen[0]:
            self._source.data = columns_of(rows[-self._rows :])
        elif rows:
            self._source.stream(columns_of(rows), rollover=self._rows)
        self._seen = generation, count
        if rows:
            self._show_cycle(view)

    def _is_left(self) -> bool:
        """Return whether the browser has gone; what the server keeps for it then goes, too, and not a minute later."""
        session = getattr(self._document.session_context, "session", None)  # not there yet when the page is filled
        if session is None:
            return False
        is_open = session.connection_count > 0
        if self._was_open and not is_open:
            session.request_expiration()
            self._document.remove_periodic_callback(self.updates)  # Bokeh keeps what is being updated
        self._was_open = self._was_open or is_open
        return self._was_open and not is_open

    def _answered(self, tags: list[Any]) -> None:
        self._drawn = int(tags[0]) if tags else self._drawn

    def _show_last(self, seconds: int) -> None:
        self._time.follow_interval = self._time.default_span = float(seconds)
        self._rows = round(seconds / ROW_PERIOD_S) + 1
        # With the next update all of them come, also those that had been left out.
        self._seen, self._plots_s = (0, 0), -math.inf

    def _show_cycle(self, view: View) -> None:
        newest = self._link.rows.newest
        p_e, superheat, p_c = newest["p_e"] * KPA, newest["superheat"], newest["p_c"] * KPA
        if not all(map(math.isfinite, (p_e, superheat, p_c))) or min(p_e, p_c) <= 0.0:
            return
        state = dict(PlantReport.read(view.plant).internal_state)
        below = subcooled_enthalpy(state["p_c"], state["h_c3"]) if state else 0.0
        self._cycle.data = cycle_columns(corners(p_e, superheat, p_c, below))
        if view.point and view.point != self._rest_of:
            self._rest_of = view.point
            self._rest.data = cycle_columns(rest_corners(view.point))
        if state and state != self._zones:
            self._zones = state
            self._zone.data = zone_columns(state)


def rest_corners(point: str) -> Any:
    """Return the corners of the cycle at rest at an operating point."""
    from ac_plant_node.rest import rest_at

    rest = rest_at(point)
    p_e, superheat, _, p_c = rest["outputs"].tolist()
    return corners(p_e, superheat, p_c, subcooled_enthalpy(p_c, float(rest["state"][8])))


class Lamp(NamedTuple):
    """A lamp of the page: its name, whether it is lit, which colour it then has, and its words."""

    name: str
    on: bool
    kind: str
    words: str


def lamps(view: View, problem: str) -> str:
    """Return what is lit: the graph's phase, detection, isolation, accommodation; words say what the colour says."""
    phases = {
        "running": ("good", "running"),
        "paused": ("wait", "paused"),
        "setting up": ("wait", "setting up"),
        "over": ("wait", "the run is over"),
        "absent": ("bad", "no graph to be seen"),
    }
    kind, word = phases[view.phase]
    if view.restarting and view.phase == "running":
        kind, word = "warn", f"restarting {', '.join(view.restarting)}"
    if problem:
        kind, word = "bad", "a node has failed"
    parts = [Lamp("phase", True, kind, word)]
    status = view.status if view.phase in ("running", "paused", "over") else None
    detected = status is not None and status.detected
    parts.append(Lamp("detected", detected, "warn", "fault detected" if detected else "no fault detected"))
    isolated = {status.isolated, status.also_isolated} if status is not None else set()
    for fault in ISOLABLE:
        words = f"{fault.symbol} {fault.name}"
        if status is not None and status.isolated == fault.kind:
            words += f": {in_unit(fault.kind, status.size):+.1f} {fault.unit}"
        is_unsure = status is not None and status.unsure == fault.kind
        words += ", not sure" if is_unsure else ""
        parts.append(Lamp(f"isolated_{fault.symbol}", fault.kind in isolated, "warn" if is_unsure else "bad", words))
    parts.append(Lamp("isolated_unknown", UNKNOWN in isolated, "bad", "another fault"))
    waits = bool(isolated - {None}) and status is not None and not any(status.acted_on)
    words = "accommodation on" if view.accommodate else "accommodation off"
    if view.accommodate and waits:
        words = "accommodation waits: K0 alone"
    parts.append(Lamp("accommodating", view.accommodate, "wait" if waits else "good", words))
    return str(_FRAGMENTS.lamps(parts))


def readouts(newest: Mapping[str, float], view: View) -> str:
    """Return the figures of this moment, with their units."""
    said = PlantReport.read(view.plant)
    told = {name: said.performance.get(name, math.nan) for name in Performance._fields}
    cooling, latent, power = (told[name] / 1e3 for name in ("cooling", "latent_cooling", "compressor_power"))
    figures = (
        ("evaporator", f"{newest.get('p_e', math.nan):.1f} kPa"),
        ("condenser", f"{newest.get('p_c', math.nan):.0f} kPa"),
        ("superheat", f"{newest.get('superheat', math.nan):.2f} K"),
        ("wall", f"{newest.get('wall', math.nan):.2f} °C"),
        ("compressor", f"{newest.get('speed_actual', math.nan):.0f} rpm"),
        ("valve", f"{newest.get('valve', math.nan):.1f} %"),
        ("air flow", f"{newest.get('air_flow', math.nan):.0f} g/s"),
        ("air inlet", f"{newest.get('air_inlet', math.nan):.1f} °C"),
        ("humidity", f"{newest.get('humidity', math.nan):.0f} %"),
        ("vents", f"{told['vent_temperature']:.1f} °C"),
        ("cooling", f"{cooling:.2f} kW"),
        ("sensible", f"{cooling - latent:.2f} kW"),
        ("latent", f"{latent:.2f} kW"),
        ("water", f"{3600.0 * told['condensed_water']:.2f} kg/h"),
        ("frost", f"{3600.0 * told['frost']:.2f} kg/h"),
        ("power", f"{power:.2f} kW"),
        ("COP", f"{cooling / power if power > 0.0 else math.nan:.2f}"),
        ("subcooling", f"{told['subcooling']:.1f} K"),
        ("missed ticks", "–" if said.missed_ticks is None else str(said.missed_ticks)),
    )
    return str(_FRAGMENTS.readouts([(name, figure.replace("nan", "–")) for name, figure in figures]))


def happenings(events: Sequence[tuple[float, Happening]], view: View) -> str:
    """Return the list of the last events, the newest first, and which process each node is."""
    rows = [(f"{time_s:.1f} s", one.node, one.what) for time_s, one in reversed(events[-SHOWN_EVENTS:])]
    return str(_FRAGMENTS.happenings(rows, sorted(view.pids.items())))


def said(view: View, problem: str) -> str:
    """Return the line of what has come of the last control."""
    failed = bool(problem) or view.failed
    words = problem or view.message
    if not words and view.recorded:
        words = "A run that is recorded cannot be reset."
    return str(_FRAGMENTS.said(words, failed))


def _set_text(div: Div, text: str) -> None:
    if div.text != text:
        div.text = text
