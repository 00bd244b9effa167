"""The calibration says what is wrong with what it was given: a sign, a row, a size."""

from dataclasses import replace

import pytest

from ac_common.errors import UserError
from ac_plant_node import calibrate, load_parameters
from ac_plant_node.calibration import doubtful
from ac_plant_node.parameters.values import TABLE_I


def test_the_shipped_plant_is_not_doubted() -> None:
    assert doubtful(load_parameters()) == []


def test_an_efficiency_that_grows_with_the_pressure_ratio_is_told() -> None:
    low, med, high = TABLE_I
    solved, _ = calibrate(rows=(low, replace(med, evaporator_pressure_kpa=330.0), high))
    assert any("eta_v_pressure_ratio is +" in warning for warning in doubtful(solved))


def test_a_superheat_that_the_air_cannot_give_is_to_blame() -> None:
    low, med, high = TABLE_I
    with pytest.raises(UserError, match=r"'low' point .* boils at 0\.9 degC: 40 K of superheat are not to be had"):
        calibrate(rows=(replace(low, superheat_k=40.0), med, high))


def test_a_size_is_to_blame() -> None:
    heavy = load_parameters().replace(charge_kg=1.4)
    with pytest.raises(UserError, match=r"one of these there would be one: charge_kg 1\.4 \(shipped: 0\.5\)"):
        calibrate(heavy)
