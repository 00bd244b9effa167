"""References that the plant can follow."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ac_design import ENVELOPE_CONTROLLER, design_controller
from ac_plant_node.saturation import saturation_temperature
from gimc_controller_node import limited_k0
from gimc_controller_node.controller import NO_APPROACH_K
from gimc_controller_node.fallback import FallbackController
from gimc_controller_node.protection import ProtectionLimits
from gimc_controller_node.reference_limits import TOO_DRY, TOO_WARM, ReferenceLimits

LIMITS = ReferenceLimits(ProtectionLimits(), 2.0)
T = 0.1


def highest(pressure, air_c):
    return air_c + 273.15 - saturation_temperature(pressure) - 2.0


@given(st.floats(1e5, 4e5), st.floats(0.0, 60.0), st.floats(10.0, 60.0))
def test_what_is_passed_on_can_be_had(pressure, superheat, air_c):
    within_pressure, within_superheat, said = LIMITS.bounded(pressure, superheat, air_c)
    assert within_pressure >= 175e3
    assert within_superheat >= 8.0
    assert within_superheat <= highest(within_pressure, air_c) + 1e-3 or within_pressure == 175e3
    assert bool(said) == ((within_pressure, within_superheat) != (pressure, superheat))


@given(st.floats(1.75e5, 3.2e5), st.floats(22.0, 60.0), st.floats(0.0, 1.0))
def test_what_can_be_had_is_passed_on(pressure, air_c, share):
    superheat = 8.0 + share * (highest(pressure, air_c) - 8.0)
    assert LIMITS.bounded(pressure, superheat, air_c) == (pressure, superheat, "")


def test_each_bound_has_its_words():
    assert LIMITS.bounded(302e3, 28.0, 25.0)[2] == TOO_DRY
    assert TOO_WARM in LIMITS.bounded(400e3, 12.0, 15.0)[2]


def test_without_the_temperature_or_an_approach_nothing_is_capped():
    assert LIMITS.bounded(302e3, 28.0, None) == (302e3, 28.0, "")
    assert ReferenceLimits(ProtectionLimits(), NO_APPROACH_K).bounded(302e3, 28.0, 25.0) == (302e3, 28.0, "")


def test_the_controller_says_so_and_asks_for_less():
    design = design_controller("med", T, ENVELOPE_CONTROLLER)
    asked, less = (FallbackController(limited_k0(design)) for _ in range(2))
    measured, q = np.array([302e3, 20.0]), np.zeros(2)
    for _ in range(50):
        command = asked.step(np.array([302e3, 28.0]), measured, q, 25.0)
        same = less.step(np.array([302e3, highest(302e3, 25.0)]), measured, q, 25.0)
        assert command == pytest.approx(same, rel=1e-9)
    assert asked.does == TOO_DRY
    assert less.does == ""
