"""Whose turn it is, whatever is lost, late, or early."""

import itertools

from hypothesis import given
from hypothesis import strategies as st

from ac_ros_common.sequencer import Sequencer


class Log:
    """What the detector was called with, in order: (what, tick or command)."""

    def __init__(self) -> None:
        self.calls: list[tuple[str, float]] = []
        self.turns = Sequencer(self.observe, self.close)

    def observe(self, time_ns: int, *_: float) -> None:
        self.calls.append(("observe", time_ns))

    def close(self, command: float) -> None:
        self.calls.append(("close", command))

    def tick(self, k: int) -> None:
        """One undisturbed tick."""
        self.turns.measured(k, 0.0)
        self.turns.commanded(k, float(k))


def test_in_turn() -> None:
    log = Log()
    for k in range(3):
        log.tick(k)
    assert log.calls == [("observe", 0), ("close", 0), ("observe", 1), ("close", 1), ("observe", 2), ("close", 2)]


def test_a_measurement_that_overtakes_a_command_waits_for_it() -> None:
    log = Log()
    log.turns.measured(0, 0.0)
    log.turns.measured(1, 0.0)
    log.turns.commanded(0, 0.0)
    log.turns.commanded(1, 1.0)
    assert log.calls == [("observe", 0), ("close", 0), ("observe", 1), ("close", 1)]
    assert log.turns.overtaken == 0


def test_a_command_that_overtakes_its_measurement_waits_for_it() -> None:
    log = Log()
    log.tick(0)
    log.turns.commanded(1, 1.0)
    log.turns.measured(1, 0.0)
    log.turns.commanded(1, 99.0)  # twice
    assert log.calls == [("observe", 0), ("close", 0), ("observe", 1), ("close", 1)]


def test_after_a_lost_command_no_tick_waits_for_the_next_ones_command() -> None:
    log = Log()
    log.tick(0)
    log.turns.measured(1, 0.0)  # its command is lost
    log.turns.measured(2, 0.0)
    log.turns.commanded(2, 2.0)  # stands in for the lost one, and closes its own tick
    log.turns.measured(3, 0.0)
    assert log.calls[2:] == [("observe", 1), ("close", 2), ("observe", 2), ("close", 2), ("observe", 3)]


def test_after_several_lost_commands_the_observer_goes_on_without() -> None:
    log = Log()
    for k in range(4):
        log.turns.measured(k, 0.0)
    assert log.calls == [("observe", 0), ("observe", 1), ("observe", 2)]
    assert log.turns.overtaken == 2
    assert log.turns.awaited_ns == 2


@given(
    st.lists(
        st.tuples(st.sampled_from(["ok", "no command", "no measurement", "nothing", "command twice"]), st.booleans()),
        max_size=40,
    )
)
def test_whatever_is_lost_every_tick_is_observed_once_and_in_time_again_after_one_good_tick(
    disturbed: list[tuple[str, bool]],
) -> None:
    log = Log()
    for k, (what, command_first) in enumerate(disturbed):
        acts = [lambda k=k: log.turns.measured(k, 0.0), lambda k=k: log.turns.commanded(k, float(k))]
        present = {
            "ok": acts,
            "no command": acts[:1],
            "no measurement": acts[1:],
            "nothing": [],
            "command twice": [*acts, acts[1]],
        }
        for act in reversed(present[what]) if command_first else present[what]:
            act()
    n = len(disturbed)
    for k in (n, n + 1, n + 2):
        log.turns.measured(k, 0.0)
        if k > n:
            assert log.calls[-1] == ("observe", k)  # at once, not with the command
        log.turns.commanded(k, float(k))
        assert log.calls[-1] == ("close", k)
    observed = [tick for call, tick in log.calls if call == "observe"]
    assert observed == sorted(set(observed))
    expected = [k for k, (what, _) in enumerate(disturbed) if what in ("ok", "no command", "command twice")]
    assert observed == [*expected, n, n + 1, n + 2]
    calls = [call for call, _ in log.calls]
    assert all(not (a == b == "close") for a, b in itertools.pairwise(calls))
