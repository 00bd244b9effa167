"""The page's list of events: each once, in order of time, with one mark where several come together."""

import pytest

from ac_common.fdi_status import NO_LONGER, NOT_SURE, SURE, StatusRow
from ac_experiments.metrics import summarise
from bringup.dash.events import MOST_EVENTS, Events, Happening, marks
from tests.small_faults import lost_between, sure_later

SECOND_NS = 10**9


def status(detected: bool, isolated: str | None = None, also: str | None = None) -> StatusRow:
    nan = float("nan")
    return StatusRow(0.0, detected, isolated, nan, nan, nan, (1.0, 1.0), also)


def test_what_fdi_decides_is_told_when_it_changes() -> None:
    events = Events()
    rows = [status(False), status(True), status(True, "compressor_speed"), status(True, "compressor_speed")]
    rows += [status(True, "evaporator_pressure", "compressor_speed"), status(False)]
    for second, row in enumerate(rows, start=10):
        events.decided(second * SECOND_NS, row)
    assert [(time_s, one.what) for time_s, one in events.since(10 * SECOND_NS)] == [
        (1.0, "fault detected"),
        (2.0, "f_N isolated"),
        (4.0, "f_p isolated"),
        (5.0, "f_N no longer isolated"),
        (5.0, "f_p no longer isolated"),
        (5.0, "no fault detected any more"),
    ]
    assert marks(events.since(10 * SECOND_NS)) == [1.0, 2.0, 4.0, 5.0]


def test_a_name_that_is_not_sure_is_told_as_such_and_when_it_is() -> None:
    events, run = Events(), sure_later()
    (fault,) = summarise(run)["faults"]
    lost_s, again_s = (round(fault["sure_s"] + later_s, 1) for later_s in (5.0, 10.0))
    for row in lost_between(run.status, lost_s, again_s):
        events.decided(round(row.time_s * 1e9), row)
    assert [(time_s, one.what) for time_s, one in events.since(0)] == [
        (fault["detected_s"], "fault detected"),
        (fault["isolated_s"], f"f_p isolated: {NOT_SURE}"),
        (fault["sure_s"], f"f_p {SURE}"),
        (pytest.approx(lost_s), f"f_p {NO_LONGER}"),
        (pytest.approx(again_s), f"f_p {SURE}"),
    ]


def test_what_a_node_announces_again_and_again_is_told_once() -> None:
    events = Events()
    for _ in range(3):
        events.announced("gimc_controller", [(12.5, "no q: K0 alone")])
    events.injected(11 * SECOND_NS, frozenset({"evaporator_pressure"}))
    events.injected(11 * SECOND_NS, frozenset({"evaporator_pressure"}))
    events.injected(13 * SECOND_NS, frozenset())
    assert [(time_s, one.node, one.what) for time_s, one in events.since(0)] == [
        (11.0, "fault_injector", "f_p begins"),
        (12.5, "gimc_controller", "no q: K0 alone"),
        (13.0, "fault_injector", "f_p ends"),
    ]
    assert events.since(13 * SECOND_NS)[0][0] == 0.0  # those of the run before are left out


def test_they_do_not_grow() -> None:
    events = Events()
    for number in range(3 * MOST_EVENTS):
        events.add(Happening(number, "fdi", "something"))
    assert len(events.since(0)) == len(events._known) == MOST_EVENTS
