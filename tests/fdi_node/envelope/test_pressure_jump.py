"""A pressure reading that jumps in one tick has its name in that tick, whatever the observer knows just then."""

import numpy as np
import pytest

from ac_common.units import KPA, RPM
from ac_experiments.drives import drive
from ac_experiments.scenario import check
from ac_experiments.simulate import simulate
from fdi_node.envelope import jumps
from fdi_node.envelope.memory import JUMPED
from fdi_node.envelope.model import READING_SCALE, SCALE
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


@pytest.mark.parametrize("jump_pa", [0.0, 1.0 * KPA, -2.0 * KPA])
def test_no_jump_of_it_is_larger_than_what_was_seen(jump_pa: float) -> None:
    loop = Loop("med")
    list(loop.run(25.0))
    loop.step(reading_fault=(jump_pa, 0.0, 0.0, 0.0))
    m, rules = loop.detector.memory, loop.detector.rules
    (h,) = (i for i, unknown in enumerate(rules.jumping) if unknown == 1 and not rules.growing[i])
    newest = int(np.argmin(np.where(m.age == 1.0, -m.seen * np.sign(jump_pa or 1.0), np.inf)))
    least, most = (size * rules.rows[1, SCALE] for size in jumps._limits(rules, h, m.seen[newest]))
    assert most - least <= 2.0 * jumps.UNSEEN * np.sqrt(2.0 * rules.R[0]) * READING_SCALE[0] + 1.0
    assert least < jump_pa < most


def test_the_compressor_just_after_a_step_of_the_blower_is_no_jump_of_it() -> None:
    """A jump of -2.6 kPa, of which no tick has seen anything, would explain as much."""
    onset_s = 600.0
    faults = [{"kind": "compressor_speed", "size_rpm": 40.0, "onset_s": onset_s}]
    asked = check({**drive(34157), "faults": faults}, "drive").model_copy(update={"duration_s": onset_s + 20.0})
    said = simulate(asked).status
    assert {row.isolated for row in said} == {None, "compressor_speed"}
    assert said[-1].size == pytest.approx(40.0 * RPM, abs=2.0 * RPM)
