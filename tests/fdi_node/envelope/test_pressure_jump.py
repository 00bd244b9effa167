"""A pressure reading that jumps in one tick has its name in that tick, whatever the observer knows just then."""

import pytest

from ac_common.units import KPA
from fdi_node.envelope.memory import JUMPED
from tests.fdi_node.envelope.loops import Loop

FAULT = (5.0 * KPA, 0.0, 0.0, 0.0)
NAME = "evaporator_pressure"


@pytest.mark.parametrize("after_s", [0.1, 0.4, 1.0, 3.0])
@pytest.mark.parametrize("point", ["low", "high"])
def test_it_does_so_just_after_a_step_of_the_blower(point: str, after_s: float) -> None:
    loop = Loop(point)
    list(loop.run(25.0))
    loop.inputs[2] *= 1.4
    assert {said.isolated for said in loop.run(after_s)} == {None}
    said = loop.step(reading_fault=FAULT)
    assert (said.isolated, said.acted_on) == (NAME, (NAME, None))
    list(loop.run(10.0, reading_fault=FAULT))
    assert loop.step(reading_fault=FAULT).size == pytest.approx(5.0 * KPA, abs=0.5 * KPA)


def test_it_is_over_as_soon() -> None:
    loop = Loop("med")
    list(loop.run(25.0))
    list(loop.run(5.0, reading_fault=FAULT))
    assert loop.step().size == pytest.approx(0.0, abs=KPA)
    said = list(loop.run(25.0))
    assert said[-1].isolated is None


def test_steps_of_the_blower_are_no_jumps() -> None:
    loop = Loop("high")
    list(loop.run(25.0))
    for factor in (1.45 / 0.65, 0.65 / 1.45, 1.45 / 0.65):
        loop.inputs[2] *= factor
        for said in loop.run(10.0):
            assert loop.detector.memory.scalars[JUMPED] == 0.0
            assert said.isolated is None


def test_after_a_gap_what_was_before_is_not_known() -> None:
    loop = Loop("med")
    list(loop.run(25.0))
    loop.detector._decision.restart()
    loop.step(reading_fault=FAULT)
    assert loop.detector.memory.scalars[JUMPED] == 0.0
