"""What the page's controls send and show, without browser or graph."""

from collections.abc import Mapping
from typing import Any

import pytest

from ac_common.topics import SCENARIO
from bringup.dash.controls import CHANGES, ChangeControl
from bringup.dash.view import View
from bringup.nodes.scenario import OFFSETS

#: Name of the parameter, and position among the controls.
SUPERHEAT = OFFSETS[1].name, 1


class Sent:
    """Stands where the graph is: keeps what would be sent there."""

    def __init__(self) -> None:
        self.changes: list[Mapping[str, Any]] = []

    def change(self, node: str, values: Mapping[str, Any], done: str) -> None:  # noqa: ARG002
        assert node == SCENARIO
        self.changes.append(values)


def view(**offsets: float) -> View:
    """The graph as it is with these offsets, all else at rest."""
    at_rest = dict.fromkeys((limits.name for limits in OFFSETS), 0.0)
    return View(
        phase="running",
        message="",
        failed=False,
        point="med",
        mode="realtime",
        recorded=False,
        accommodate=True,
        live_faults=frozenset(),
        status=None,
        plant={},
        parameters={SCENARIO: {**at_rest, **offsets}},
        restarting=(),
    )


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
    assert sent.changes == [{"ramp_s": 0.0, name: -2.5}, {"ramp_s": 0.0, name: -3.0}]
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
    assert sent.changes == [{"ramp_s": 0.0, name: -2.5}, {"ramp_s": 0.0, name: 0.0}]
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
    assert sent.changes == 2 * [{"ramp_s": 0.0, name: -2.5}]
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
    assert sent.changes[-1] == {"ramp_s": 0.0, OFFSETS[0].name: 1000.0}
