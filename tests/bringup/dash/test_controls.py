"""What the page's controls send and show, without browser or graph."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from ac_common.faults import BY_KIND, UNFILTERED
from ac_common.topics import SCENARIO
from bringup.dash.controls import CHANGES, LOADS, N_REFERENCES, USUAL_RAMP_S, ChangeControl, FaultControl
from bringup.dash.view import View
from bringup.nodes.scenario import OFFSETS
from tests.dash_views import RUNNING

#: Name of the parameter, and position among the controls.
SUPERHEAT = OFFSETS[1].name, 1


class Sent:
    """Stands where the graph is: keeps what would be sent there."""

    def __init__(self) -> None:
        self.changes: list[Mapping[str, Any]] = []

        self.faults: list[tuple[str, Mapping[str, Any]]] = []

        self.said: list[tuple[str, bool]] = []

    def say(self, words: str, failed: bool = False) -> None:
        self.said.append((words, failed))

    def inject(self, fault: str, values: Mapping[str, Any], words: str) -> None:
        self.said.append((words, False))
        self.faults.append((fault, values))

    def change(self, node: str, values: Mapping[str, Any], done: str) -> None:  # noqa: ARG002
        assert node == SCENARIO
        self.changes.append(values)


def view(**offsets: float) -> View:
    """The graph as it is with these offsets, all else at rest."""
    at_rest = dict.fromkeys((limits.name for limits in OFFSETS), 0.0)
    return replace(RUNNING, parameters={SCENARIO: {**at_rest, **offsets}})


@pytest.fixture
def sent() -> Sent:
    return Sent()


@pytest.fixture
def control(sent: Sent) -> ChangeControl:
    control = ChangeControl(sent)  # type: ignore[arg-type]
    control.show(view())
    return control


def test_what_others_have_changed_is_shown(control: ChangeControl) -> None:
    name, place = SUPERHEAT
    control.widgets[0].value = 3.0  # typed here and not sent
    control.show(view(**{name: -2.5}))
    assert [widget.value for widget in control.widgets[: len(CHANGES)]] == [3.0, -2.5, *[0.0] * (len(CHANGES) - 2)]
    control.show(view())
    assert control.widgets[place].value == 0.0


def test_what_has_been_typed_stays_while_the_changes_before_it_come_about(control: ChangeControl, sent: Sent) -> None:
    name, place = SUPERHEAT
    for value in (-2.5, -3.0):
        control.widgets[place].value = value
        control._clicked()
    assert sent.changes == [{"ramp_s": USUAL_RAMP_S, name: -2.5}, {"ramp_s": USUAL_RAMP_S, name: -3.0}]
    for typed in (-4.0, None):
        control.widgets[place].value = typed
        for value in (-2.5, -3.0, 0.0):
            control.show(view(**{name: value}))
            assert control.widgets[place].value == typed


def test_back_to_zero_undoes_a_change_that_has_not_been_heard_of_yet(control: ChangeControl, sent: Sent) -> None:
    name, place = SUPERHEAT
    control.widgets[place].value = -2.5
    control._clicked()
    control._undo()
    assert sent.changes == [{"ramp_s": USUAL_RAMP_S, name: -2.5}, {"ramp_s": USUAL_RAMP_S, name: 0.0}]
    control.show(view(**{name: -2.5}))
    control.show(view())
    assert control.widgets[place].value == 0.0


def test_a_change_that_was_refused_can_be_sent_again_and_gives_way_to_somebody_else_s(
    control: ChangeControl, sent: Sent
) -> None:
    name, place = SUPERHEAT
    control.widgets[place].value = -2.5
    control._clicked()
    control._clicked()
    assert sent.changes == 2 * [{"ramp_s": USUAL_RAMP_S, name: -2.5}]
    control.show(view(**{name: 1.0}))
    assert control.widgets[place].value == 1.0


def test_a_value_that_is_not_shown_to_the_last_digit_is_not_taken_for_a_typed_one(control: ChangeControl) -> None:
    pressure = OFFSETS[0].name
    control.show(view(**{pressure: 1234.56789012}))
    assert control.widgets[0].value == 1.234568
    control.show(view(**{pressure: 500.0}))
    assert control.widgets[0].value == 0.5


def test_only_what_is_new_is_sent(control: ChangeControl, sent: Sent) -> None:
    name, place = SUPERHEAT
    control.widgets[place].value = -2.5
    control._clicked()
    control.show(view(**{name: -2.5}))
    control.widgets[0].value = 1.0
    control._clicked()
    assert sent.changes[-1] == {"ramp_s": USUAL_RAMP_S, OFFSETS[0].name: 1000.0}


def test_a_click_moves_the_load_and_leaves_the_references(control: ChangeControl, sent: Sent) -> None:
    for button, (_, load) in zip(control._loads, LOADS, strict=True):
        (_, act), *_ = button._event_callbacks.items()
        act[0]()
        names = [limits.name for limits in OFFSETS[N_REFERENCES:]][: len(load)]
        assert sent.changes[-1] == {"ramp_s": USUAL_RAMP_S, **dict(zip(names, load, strict=True))}
        assert all(widget.value == 0.0 for widget in control.widgets[:N_REFERENCES])


def test_one_control_offers_all_faults_without_a_filter_with_their_own_limits(sent: Sent) -> None:
    control = FaultControl("other", UNFILTERED, sent)  # type: ignore[arg-type]
    size, _, _, button, kind = control.widgets
    assert [option[0] for option in kind.options] == [fault.kind for fault in UNFILTERED]
    for fault in UNFILTERED:
        kind.value = fault.kind
        low, high = size.tags
        assert low == pytest.approx(fault.lowest_live_si / fault.si, rel=0.1)
        assert low <= size.value == fault.typical <= high
        control.show(view())
        assert button.label == f"Inject {fault.symbol}"
        control._clicked()
    assert [name for name, _ in sent.faults] == [fault.kind for fault in UNFILTERED]
    for name, values in sent.faults:
        fault = BY_KIND[name]
        assert values == {"profile": "step", fault.size_parameter: pytest.approx(fault.typical * fault.si)}


def test_choosing_another_fault_leaves_a_running_one_alone(sent: Sent) -> None:
    control = FaultControl("other", UNFILTERED, sent)  # type: ignore[arg-type]
    *_, button, kind = control.widgets
    running = replace(view(), live_faults=frozenset({UNFILTERED[0].kind}))
    control.show(running)
    assert button.label == f"Stop {UNFILTERED[0].symbol}"
    kind.value = UNFILTERED[1].kind
    control.show(running)
    assert button.label == f"Inject {UNFILTERED[1].symbol}"
    assert sent.faults == []
