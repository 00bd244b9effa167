"""A name that is wrong does not stay: the other explanation is followed by an observer of its own."""

import json
import math
from collections.abc import Callable

import pytest

from ac_common.fdi_status import status_row, status_values
from ac_common.units import KPA, RPM
from fdi_node.envelope import EnvelopeDetector, Limits
from fdi_node.envelope.isolation import Isolation
from fdi_node.envelope.memory import LARGEST
from tests.fdi_node.envelope.loops import Loop, design

FAULTS = {
    "compressor_speed": {"speed_fault": 10.0 * RPM},
    "evaporator_pressure": {"reading_fault": (0.5 * KPA, 0.0, 0.0, 0.0)},
}
OTHER = dict(zip(FAULTS, reversed(FAULTS), strict=True))


def isolation_of(loop: Loop) -> Isolation:
    return loop.detector._decision.isolation


def until(loop: Loop, holds: Callable[[], bool], name: str) -> None:
    for _ in loop.run(200.0, **FAULTS[name]):
        if holds():
            return
    raise AssertionError("it never does")


def with_a_rival(name: str) -> Loop:
    """Return a loop in which a fault has just been isolated, neither for sure nor wrongly."""
    loop = Loop("med")
    list(loop.run(25.0))
    until(loop, lambda: bool(isolation_of(loop).faults), name)
    assert [one.name for one in isolation_of(loop).faults] == [name]
    return loop


@pytest.mark.parametrize("name", FAULTS)
def test_a_wrong_name_does_not_stay(name: str) -> None:
    loop = with_a_rival(name)
    isolation = isolation_of(loop)
    assert isolation.rival is not None
    isolation.rival.evidence = -math.inf
    said = loop.step(**FAULTS[name])
    assert said.isolated == OTHER[name]
    isolation.rival.evidence = Limits().better  # as one that has been wrong from the first
    until(loop, lambda: isolation.faults[0].name == name, name)
    assert isolation.rival.evidence > 0.0
    list(loop.run(20.0, **FAULTS[name]))
    assert [one.name for one in isolation.faults] == [name]
    assert loop.step(**FAULTS[name]).size == pytest.approx(
        10.0 * RPM if name == "compressor_speed" else 0.5 * KPA, rel=0.3
    )


def test_what_is_right_by_far_is_compared_no_longer() -> None:
    loop = with_a_rival("compressor_speed")
    until(loop, lambda: isolation_of(loop).rival is None, "compressor_speed")
    assert [one.name for one in isolation_of(loop).faults] == ["compressor_speed"]


def test_a_name_is_acted_on_when_the_other_one_is_far_behind() -> None:
    name = "evaporator_pressure"
    loop = with_a_rival(name)
    isolation = isolation_of(loop)
    assert isolation.rival is not None
    isolation.rival.evidence, isolation.faults[0].is_sure = 0.0, False
    said = loop.step(**FAULTS[name])
    assert (said.isolated, said.unsure, said.acted_on) == (name, name, (None, None))
    assert status_row(status_values(said.status(0.0)), 0.0).acted_on == (None, None)
    twin = EnvelopeDetector(design())
    twin.restore(json.loads(json.dumps(loop.detector.state())))
    assert not twin._decision.isolation.faults[0].is_sure
    isolation.rival.evidence = 1.5 * Limits().better
    said = loop.step(**FAULTS[name])
    assert (said.isolated, said.unsure, said.acted_on) == (name, None, (name, None))
    isolation.rival.evidence = Limits().kept + 5.0  # what has been sure stays so for less
    assert loop.step(**FAULTS[name]).acted_on == (name, None)
    isolation.rival.evidence = Limits().kept - 5.0
    assert loop.step(**FAULTS[name]).acted_on == (None, None)


def test_what_is_unsure_stays_so_when_nothing_is_compared_any_more() -> None:
    name = "evaporator_pressure"
    loop = with_a_rival(name)
    isolation = isolation_of(loop)
    assert isolation.rival is not None
    isolation.rival.is_lost, isolation.faults[0].is_sure, isolation.rival.evidence = True, False, 0.0
    said = [loop.step(**FAULTS[name]) for _ in range(2)][-1]
    assert isolation.rival is None
    assert (said.isolated, said.acted_on) == (name, (None, None))


def test_what_is_sure_stays_so_when_the_other_observer_is_lost() -> None:
    name = "evaporator_pressure"
    loop = with_a_rival(name)
    isolation = isolation_of(loop)
    assert isolation.rival is not None
    isolation.rival.evidence = 2.0 * Limits().better
    assert loop.step(**FAULTS[name]).acted_on == (name, None)
    isolation.rival.is_lost, isolation.rival.memory.out[0] = True, math.nan
    assert [said.acted_on for said in loop.run(0.3, **FAULTS[name])] == [(name, None)] * 3
    assert isolation.rival is None


def test_what_jumps_clearly_has_no_rival() -> None:
    loop = Loop("med")
    list(loop.run(25.0))
    list(loop.run(1.0, reading_fault=(5.0 * KPA, 0.0, 0.0, 0.0)))
    assert isolation_of(loop).faults[0].is_abrupt
    assert isolation_of(loop).rival is None


def test_one_that_takes_its_place_compares_on() -> None:
    loop = with_a_rival("compressor_speed")
    other = EnvelopeDetector(design())
    other.restore(json.loads(json.dumps(loop.detector.state())))
    twin, isolation = other._decision.isolation, isolation_of(loop)
    assert twin.rival is not None
    assert isolation.rival is not None
    assert (twin.asked == isolation.asked).all()
    assert other.state() == loop.detector.state()
    assert (twin.rival.rules.Q == isolation.rival.rules.Q).all()


def test_one_whose_fault_has_no_name_is_refused() -> None:
    state = with_a_rival("compressor_speed").detector.state()
    state["decision"]["isolation"]["rival"]["unknown"] = 2
    with pytest.raises(ValueError, match="no name"):
        EnvelopeDetector(design()).restore(state)


def test_after_a_gap_nothing_is_compared() -> None:
    loop = with_a_rival("compressor_speed")
    loop.detector.begin_anew()
    assert isolation_of(loop).rival is None
    assert len(isolation_of(loop).faults) == 1


def test_what_neither_explains_is_unknown() -> None:
    isolation = isolation_of(with_a_rival("compressor_speed"))
    assert isolation.rival is not None
    isolation.rival.evidence, isolation.rival.memory.scalars[LARGEST] = -math.inf, 2.0 * Limits().likely
    assert isolation.compare(100.0)
    assert isolation.faults[-1].name == "unknown"
    assert isolation.rival is None


def test_a_name_that_changes_again_and_again_is_unknown() -> None:
    loop, names = with_a_rival("compressor_speed"), []
    for _ in range(3):
        rival = isolation_of(loop).rival
        assert rival is not None
        rival.evidence = -math.inf
        names.append(loop.step(**FAULTS["compressor_speed"]).isolated)
        rival.evidence = 0.0
    assert names == ["evaporator_pressure", "compressor_speed", "unknown"]
