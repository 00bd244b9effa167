"""Rows of the live page: complete ones at once, incomplete ones late, nothing twice, nothing for ever."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ac_common.topics import BY_NAME
from ac_common.units import KPA, RPM
from bringup.dash.rows import COLUMNS, MOST_ROWS, MOST_WAITING, NAMES, TOPIC_NAMES, Row, Rows, columns_of

TICK_NS = 100_000_000
SILENT = {key for topic in BY_NAME.values() if topic.silent_at_zero for key in topic.series}
AWAITED = {series for _, series, _ in COLUMNS} - SILENT


def everything(value: float) -> dict[str, float]:
    return {series: value * unit for _, series, unit in COLUMNS}


def test_every_topic_exists() -> None:
    assert set(TOPIC_NAMES) <= set(BY_NAME)
    known = {key for topic in BY_NAME.values() for key in topic.series}
    assert {series for _, series, _ in COLUMNS if not series.startswith("fdi/status")} <= known


def test_values_become_those_of_the_people() -> None:
    rows = Rows()
    rows.add(0, everything(0.0) | {"plant/evaporator_pressure": 300 * KPA, "controller/command:compressor": 1000 * RPM})
    newest = rows.newest
    assert newest["p_e"] == 300.0
    assert math.isclose(newest["speed"], 1000.0)


@given(order=st.permutations(range(len(COLUMNS))), ticks=st.integers(1, 5))
def test_a_row_is_closed_by_its_last_message_in_whatever_order(order: list[int], ticks: int) -> None:
    """What is silent while it is zero is taken, but not waited for."""
    rows = Rows()
    for k in range(ticks):
        waits = len(AWAITED)
        for n, i in enumerate(order):
            assert len(rows.since(1, 0)[2]) == k + (waits == 0)
            _, series, unit = COLUMNS[i]
            rows.add(7 + k * TICK_NS, {series: (k + n) * unit})
            waits -= series in AWAITED
    np.testing.assert_allclose([row[0] for row in rows.since(1, 0)[2]], np.arange(ticks) * 0.1)


def test_what_never_comes_is_nan_and_holds_nobody_up() -> None:
    rows = Rows()
    for k in range(20):
        rows.add(k * TICK_NS, {"plant/evaporator_pressure": 3e5})
    got = columns_of(rows.since(1, 0)[2])
    assert len(got["t"]) == 20 - MOST_WAITING
    assert (got["p_e"] == 300.0).all()
    assert np.isnan(got["speed"]).all()


def test_each_reader_gets_each_row_once() -> None:
    rows = Rows()
    seen: list[Row] = []
    generation = count = 0
    for k in range(50):
        rows.add(k * TICK_NS, everything(float(k)))
        if k % 7 == 0:
            generation, count, fresh = rows.since(generation, count)
            seen += fresh
    seen += rows.since(generation, count)[2]
    assert [row[1] for row in seen] == [float(k) for k in range(50)]
    assert len(rows.since(0, 0)[2]) == 50  # a page that is opened later sees what has been


def test_nothing_grows() -> None:
    rows = Rows()
    for k in range(MOST_ROWS + 500):
        rows.add(k * TICK_NS, everything(1.0) if k % 3 else {"plant/superheat": 1.0})
    assert len(rows.since(0, 0)[2]) == MOST_ROWS
    assert len(rows._waiting) <= MOST_WAITING + 1


def test_a_fast_loop_is_thinned_out() -> None:
    rows = Rows()
    for k in range(1000):
        rows.add(k * 10_000_000, everything(float(k)))
    t = np.array([row[0] for row in rows.since(0, 0)[2]])
    assert np.diff(t).min() >= 0.099
    assert len(t) == 100


def test_a_pause_is_a_gap_and_another_run_begins_anew() -> None:
    rows = Rows()
    for k in (0, 1, 2, 600, 601):
        rows.add(k * TICK_NS, everything(1.0))
    got = columns_of(rows.since(0, 0)[2])
    np.testing.assert_allclose(got["t"], [0.0, 0.1, 0.2, 0.3, 60.0, 60.1])
    assert np.isnan(got["p_e"][3])
    before = rows.generation
    rows.add(0, everything(2.0))  # time went back by a minute: a lockstep run that begins again
    assert rows.generation == before + 1
    assert [row[1] for row in rows.since(before, 5)[2]] == [2.0]
    rows.add(1_790_000_000 * 1_000_000_000, everything(3.0))  # and one on the wall clock
    assert rows.newest["t"] == 0.0
    assert rows.newest["p_e"] == 3.0


def test_a_message_that_is_late_begins_nothing() -> None:
    rows = Rows()
    for k in range(40):
        rows.add(k * TICK_NS, everything(1.0))
    before = rows.generation
    rows.add(5 * TICK_NS, everything(2.0))
    rows.add(40 * TICK_NS, everything(1.0))
    assert rows.generation == before
    assert [row[1] for row in rows.since(0, 0)[2]] == [1.0] * 41


def test_columns_have_both_thresholds() -> None:
    assert set(columns_of([])) == {*NAMES, "threshold_r_N_low", "threshold_r_p_low"}
    got = columns_of([tuple(float(i) for i in range(len(NAMES)))])
    assert got["threshold_r_p_low"] == -got["threshold_r_p"]
