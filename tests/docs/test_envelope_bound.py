"""The bound on telling a small fault's name, on signals whose answer is known."""

import numpy as np
import pytest

from ac_common.units import KPA, RPM
from docs.tools.envelope_bound import SIZES, deflection, information
from tests.fdi_node.envelope.loops import NOISE, H, Loop, design


def test_signals_that_do_not_overlap_are_told_by_all_of_their_energy() -> None:
    for fault, energy in enumerate((4.0, 9.0)):
        assert deflection(np.diag([4.0, 9.0]), fault) == (energy * SIZES[fault] ** 2, 0.0)


def test_signals_that_are_alike_cannot_be_told() -> None:
    for fault, share in enumerate((2.0 / 3.0, 1.5)):
        separation, like = deflection(np.outer([2.0, 3.0], [2.0, 3.0]), fault)
        assert separation == pytest.approx(0.0, abs=1e-6)
        assert like == pytest.approx(share * SIZES[fault])


def test_in_the_first_tick_a_jump_of_the_reading_is_in_the_reading() -> None:
    plant = Loop().plant.outputs
    outputs = (plant.evaporator_pressure_pa, plant.superheat_k, plant.wall_temperature_c, plant.condenser_pressure_pa)
    loop = Loop()
    ticks = np.tile([*outputs, loop.inputs[3], loop.inputs[5], *loop.command], (round(20.0 / H), 1))
    one, ten = (information(design(), ticks[:until], 100) for until in (101, 200))
    assert one[0, 0] == 0.0
    assert 0.5 < NOISE[0] * np.sqrt(one[1, 1]) <= 1.0
    assert np.linalg.eigvalsh(ten - one).min() >= 0.0
    for fault, largest in enumerate((5.0 * KPA, 40.0 * RPM)):
        separation, like = deflection(ten, fault)
        assert 0.0 < separation < SIZES[fault] ** 2 * ten[fault, fault]
        assert abs(like) < largest
