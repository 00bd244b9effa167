"""Bookkeeping of deaths and returns, on given times."""

import math

from hypothesis import given
from hypothesis import strategies as st

from ac_common.health import HealthReport
from bringup.launch.restart_policy import BACKOFF_S, MOST, WINDOW_S, RestartPolicy
from bringup.launch.restarts import HUNG_S, PAUSE_S, Restarts, Silence


@given(st.lists(st.floats(0.0, 100.0), min_size=1, max_size=30).map(sorted))
def test_restarts_are_bounded_and_wait_longer_each_time(deaths_s: list[float]) -> None:
    policy = RestartPolicy()
    for number, death_s in enumerate(deaths_s):
        recent = [earlier for earlier in deaths_s[:number] if death_s - earlier < WINDOW_S]
        expected = BACKOFF_S[len(recent)] if len(recent) < MOST else None
        assert policy.wait_s("fdi", death_s) == expected


def test_each_node_has_its_own_chances_and_gets_them_back() -> None:
    policy = RestartPolicy()
    assert [policy.wait_s("fdi", 1.0 * k) for k in range(MOST + 1)] == [*BACKOFF_S, None]
    assert policy.deaths("fdi") == MOST + 1
    assert policy.wait_s("compensator", 3.0) == 0.0
    assert policy.wait_s("fdi", 4.0 + WINDOW_S) == 0.0


def test_a_node_is_dead_until_it_is_due_and_waits_until_it_works() -> None:
    restarts = Restarts()
    assert restarts.died("fdi", 10.0)
    restarts.add("fdi", 17, 4.0, "SIGKILL")
    assert restarts.is_dead("fdi")
    assert restarts.waiting == ["fdi"]
    assert restarts.take_due(10.0 + BACKOFF_S[0]) == ["fdi"]
    assert not restarts.is_dead("fdi")
    assert restarts.is_of_dead("fdi", HealthReport(pid=17))  # its last words
    assert not restarts.is_of_dead("fdi", HealthReport(pid=18))
    (restart,) = restarts.back("fdi", 11.5)
    assert (restart.died_s, restart.back_s) == (4.0, 5.5)
    assert restarts.waiting == []
    assert restarts.back("fdi", 12.0) == []


def test_a_node_without_a_first_tick_has_no_time_of_the_run() -> None:
    restarts = Restarts()
    restarts.died("fdi", 10.0)
    restarts.add("fdi", 17, math.nan, "SIGKILL")
    (restart,) = restarts.back("fdi", 11.0)
    assert math.isnan(restart.back_s)


def test_silence_is_told_once_of_active_nodes_and_not_after_a_pause_of_this_process() -> None:
    silence = Silence(0.0)
    for node in ("fdi", "scenario"):
        silence.heard(node, 0.0)
    late_s = 2.0 * HUNG_S
    silence.look(late_s)  # this process itself had stopped: nobody is to blame
    assert silence.hung({"fdi"}, late_s) == []
    now_s = late_s
    while now_s < late_s + HUNG_S:
        now_s += PAUSE_S / 2
        silence.look(now_s)
    assert silence.hung({"fdi"}, now_s + PAUSE_S) == ["fdi"]
    assert silence.hung({"fdi"}, now_s + PAUSE_S) == []
    assert silence.died("fdi") == f"ended, as it had not reported for {HUNG_S:g} s"
    assert silence.died("fdi") == ""
