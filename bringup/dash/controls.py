"""The page's controls: every widget knows its unit and its limits, which are those of the nodes' parameters."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Literal

from bokeh.models.widgets import Button, Select, Spinner

from ac_common.fault_profiles import PROFILE_KEYS, PROFILES, SENSOR_PROFILES, STUCK
from ac_common.faults import BY_KIND, Fault
from ac_common.topics import COMPENSATOR, SCENARIO
from ac_common.units import KPA
from bringup.dash.link import Link
from bringup.dash.view import View
from bringup.nodes.scenario import OFFSETS

#: Look of all widgets: they live in shadow roots, where the page's own style does not reach.
STYLE = """
:host { font-family: system-ui, sans-serif; font-size: 14px; color: #1a1a1a; margin: 0; }
label { font-size: 13px; color: #1a1a1a; }
input, select { min-height: 30px; font-size: 14px; color: #1a1a1a; border-color: #767676; }
.bk-btn { font-size: 14px; min-height: 32px; }
.bk-btn-default { color: #1a1a1a; border-color: #767676; background: #fff; }
.bk-btn-primary, .bk-btn-group .bk-btn.bk-active { background: #0072B2; border-color: #0072B2; color: #fff; }
.bk-btn-warning { background: #D55E00; border-color: #8a3d00; color: #000; font-weight: 600; }
.bk-btn:focus-visible, input:focus-visible, select:focus-visible { outline: 3px solid #56B4E9; outline-offset: 1px; }
.bk-btn[disabled] { opacity: 0.55; cursor: not-allowed; }
"""


#: Live changes as the page offers them, in the order of `OFFSETS`: name, unit, SI of one unit, step.
CHANGES = (
    ("change_p_e", "p_e reference, kPa", KPA, 1.0),
    ("change_superheat", "SH reference, K", 1.0, 0.5),
    ("change_air_flow", "blower, %", 1.0, 5.0),
    ("change_air_inlet", "air inlet, K", 1.0, 1.0),
    ("change_condenser_flow", "condenser flow, %", 1.0, 5.0),
    ("change_condenser_inlet", "condenser inlet, K", 1.0, 1.0),
    ("change_humidity", "humidity, %", 1.0, 5.0),
)
#: How many of these are references; the others are the load.
N_REFERENCES = 2
#: Loads of one click, in the units of `CHANGES`: blower, air inlet, condenser's flow and inlet; the rest stays.
LOADS = (
    ("traffic", (30.0, 5.0, -30.0, 8.0)),
    ("motorway", (-20.0, -2.0, 100.0, -2.0)),
    ("rain", (-30.0, -6.0, 20.0, -8.0)),
)
#: How long a change takes unless something else is typed, s.
USUAL_RAMP_S = 20.0


def _spinner(name: str, title: str, value: float, low: float, high: float, step: float, link: Link) -> Spinner:
    """Make a field for a number. Its limits are in its tags: those of Bokeh's put back what is beyond, in silence."""
    spinner = Spinner(
        name=name, title=title, value=value, tags=[low, high], step=step, format="0[.]0[00]",
        sizing_mode="stretch_width", margin=0, stylesheets=[STYLE],
    )  # fmt: skip

    def told(_attr: str, _old: float | None, _new: float | None) -> None:
        if problem := _complaint(spinner):
            link.say(problem, failed=True)

    spinner.on_change("value", told)
    return spinner


def _select(name: str, title: str, value: str, options: list[Any]) -> Select:
    return Select(
        name=name, title=title, value=value, options=options,
        sizing_mode="stretch_width", margin=0, stylesheets=[STYLE],
    )  # fmt: skip


def _button(name: str, label: str, act: Callable[[], None], kind: Literal["default", "primary"] = "default") -> Button:
    button = Button(
        name=name, label=label, button_type=kind, sizing_mode="stretch_width", margin=0, stylesheets=[STYLE]
    )
    button.on_click(act)
    return button


class FaultControl:
    """Size, shape, and the button that starts and stops one fault.

    Parameters
    ----------
    name : str
        Last part of the widgets' names.
    faults : sequence of Fault
        Of several one is chosen first; each keeps running when another one is chosen.
    link : Link
    """

    def __init__(self, name: str, faults: Sequence[Fault], link: Link) -> None:
        self._fault, self._link = faults[0], link
        self._active = False
        self._size = _spinner(f"size_{name}", "size", 0.0, 0.0, 1.0, 1.0, link)
        self._profile = _select(f"profile_{name}", "shape", PROFILES[0], list(PROFILES))
        self._time = _spinner(f"time_{name}", "time, s", 60.0, 0.1, 86400.0, 10.0, link)
        self._time.visible = False
        self._profile.on_change("value", lambda _attr, _old, _new: self._show_time())
        self._button = _button(f"inject_{name}", "", self._clicked, "primary")
        self.widgets: list[Any] = [self._size, self._profile, self._time, self._button]
        if len(faults) > 1:
            options = [(fault.kind, f"{fault.symbol}: {fault.name}") for fault in faults]
            kind = _select(f"kind_{name}", "", self._fault.kind, options)
            kind.on_change("value", lambda _attr, _old, new: self._choose(BY_KIND[new]))
            self.widgets.append(kind)
        self._choose(self._fault)
        for widget in (self._size, self._profile, self._time):
            widget.on_change("value", lambda _attr, _old, _new: self._follow())

    def show(self, view: View) -> None:
        """Look as the graph is."""
        self._active = self._fault.kind in view.live_faults
        symbol = self._fault.symbol
        _set(self._button, label=f"Stop {symbol}" if self._active else f"Inject {symbol}")
        _set(self._button, button_type="warning" if self._active else "primary")
        _set(self._button, disabled=view.phase not in ("running", "paused"))

    def _choose(self, fault: Fault) -> None:
        """Offer another fault, in its usual size; one that is running goes on as it is."""
        self._active = False  # until the next look at the graph: what is set here is not typed
        self._fault = fault
        self._size.update(
            title=f"size, {fault.unit}",
            tags=[_round(fault.lowest_live_si / fault.si), _round(fault.largest_live_si / fault.si)],
            value=fault.typical,
            step=1.0 if fault.typical > 1.0 else 0.1,
        )
        profiles: list[Any] = list(SENSOR_PROFILES if fault.can_stick else PROFILES)
        if self._profile.value not in profiles:
            self._profile.value = PROFILES[0]
        self._profile.options = profiles
        self._button.label = f"Inject {fault.symbol}"

    def _show_time(self) -> None:
        keys = [key for key in PROFILE_KEYS[self._profile.value] if key.endswith("_s")]
        titles = {"rise_s": "rise time, s", "period_s": "period, s", "time_constant_s": "time constant, s"}
        self._time.visible = bool(keys)
        self._size.visible = self._profile.value != STUCK
        if keys:
            self._time.title = titles[keys[0]]

    def _clicked(self) -> None:
        if self._active:
            self._link.stop_fault(self._fault.kind)
        else:
            self._inject()

    def _follow(self) -> None:
        """Let a fault that is there follow what has been typed."""
        if self._active:
            self._inject()

    def _inject(self) -> None:
        problem = _complaint(self._size) or _complaint(self._time)
        if problem or self._size.value is None or self._time.value is None:
            self._link.say(f"{self._fault.symbol} {problem}", failed=True)
            return
        values: dict[str, Any] = {
            "profile": self._profile.value,
            self._fault.size_parameter: float(self._size.value) * self._fault.si,
        }
        for key in PROFILE_KEYS[self._profile.value]:
            if key.endswith("_s"):
                values[key] = float(self._time.value)
        self._link.inject(self._fault.kind, values, self._in_words())

    def _in_words(self) -> str:
        """Return what is injected, in the units that were typed."""
        if self._profile.value == STUCK:
            return f"{self._fault.symbol}: stuck"
        return f"{self._fault.symbol}: {self._profile.value} of {self._size.value:g} {self._fault.unit}"


class ChangeControl:
    """Steps and ramps of load and references."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._known: dict[str, Any] = {}
        #: What was last sent from each spinner, or put into it: where it holds something else, that was typed since.
        self._ours = dict.fromkeys((limits.name for limits in OFFSETS), 0.0)
        self._spinners = [
            _spinner(name, title, 0.0, _round((limits.low or 0.0) / si), _round((limits.high or 0.0) / si), step, link)
            for (name, title, si, step), limits in zip(CHANGES, OFFSETS, strict=True)
        ]
        self._ramp = _spinner("change_ramp", "within, s", USUAL_RAMP_S, 0.0, 86400.0, 10.0, link)
        self._apply = _button("apply_changes", "Apply", self._clicked, "primary")
        self._back = _button("undo_changes", "Back to zero", self._undo)
        self._loads = [
            _button(f"load_{number}", name, partial(self._move, load)) for number, (name, load) in enumerate(LOADS)
        ]
        self.widgets: list[Any] = [*self._spinners, self._ramp, self._apply, self._back, *self._loads]

    def show(self, view: View) -> None:
        """Look as the graph is, whoever has changed it; but leave alone what was typed and not applied yet."""
        set_now = view.parameters.get(SCENARIO, {})
        for spinner, limits, (_, _, si, _) in zip(self._spinners, OFFSETS, CHANGES, strict=True):
            value = set_now.get(limits.name)
            if value is None or value == self._known.get(limits.name):
                continue
            is_typed = spinner.value != self._ours[limits.name]
            self._known[limits.name] = value
            self._ours[limits.name] = round(value / si, 6)
            if not is_typed:
                _set(spinner, value=self._ours[limits.name])
        for button in (self._apply, self._back, *self._loads):
            _set(button, disabled=view.phase not in ("running", "paused"))

    def _clicked(self) -> None:
        widgets = (*self._spinners, self._ramp)
        problems = [problem for widget in widgets if (problem := _complaint(widget))]
        if problems:
            self._link.say(problems[0], failed=True)
            return
        given = [float(widget.value) for widget in widgets if widget.value is not None]
        # Only what is new: a ramp that is under way must not begin again.
        values = {
            limits.name: value * si
            for limits, value, (_, _, si, _) in zip(OFFSETS, given[:-1], CHANGES, strict=True)
            if value * si != self._known.get(limits.name) or value != self._ours[limits.name]
        }
        self._ours = dict(zip(self._ours, given, strict=False))
        said = [
            title.replace(", ", f" {value:+g} ")
            for (_, title, _, _), value in zip(CHANGES, given, strict=False)
            if value
        ]
        self._link.change(
            SCENARIO, {"ramp_s": given[-1], **values}, "; ".join(said) or "load and references as the scenario says"
        )

    def _move(self, load: Sequence[float]) -> None:
        for spinner, value in zip(self._spinners[N_REFERENCES:], load, strict=False):
            spinner.value = value
        self._clicked()

    def _undo(self) -> None:
        for spinner in self._spinners:
            spinner.value = 0.0
        self._clicked()


class RunControl:
    """Accommodation, pause, reset."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._view: View | None = None
        self._accommodation = _button("accommodation", "Switch accommodation off", self._switch)
        self._pause = _button("pause", "Pause", self._toggle_pause)
        self._reset = _button("reset", "Reset", self._link.start_anew)
        self.widgets: list[Any] = [self._accommodation, self._pause, self._reset]

    def show(self, view: View) -> None:
        """Look as the graph is."""
        self._view = view
        _set(self._accommodation, label=f"Switch accommodation {'off' if view.accommodate else 'on'}")
        _set(self._accommodation, disabled=view.phase not in ("running", "paused"))
        _set(self._pause, label="Resume" if view.phase == "paused" else "Pause")
        _set(self._pause, disabled=not view.may_pause)
        _set(self._reset, disabled=not view.may_reset)

    def _switch(self) -> None:
        if self._view is not None:
            on = not self._view.accommodate
            self._link.change(COMPENSATOR, {"accommodate": on}, f"accommodation switched {'on' if on else 'off'}")

    def _toggle_pause(self) -> None:
        if self._view is not None and self._view.phase == "paused":
            self._link.resume()
        else:
            self._link.pause()


def _complaint(spinner: Spinner) -> str:
    """Return what is wrong with a number, empty when nothing is."""
    (low, high), value = spinner.tags, spinner.value
    if value is None or not low <= value <= high:
        return f"{spinner.title}: given {'nothing' if value is None else f'{value:g}'}; allowed: {low:g} to {high:g}"
    return ""


def _set(widget: Any, **values: Any) -> None:
    """Set what is not so already: what is set is sent to the browser."""
    for name, value in values.items():
        if getattr(widget, name) != value:
            setattr(widget, name, value)


def _round(value: float) -> float:
    """Limit in the people's unit, towards zero: what may be typed must be allowed."""
    return float(int(value))
