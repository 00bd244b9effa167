"""Random drives: a family of scenarios, each reproducible by its seed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ac_common.errors import UserError
from ac_experiments.drives import seed_of
from ac_experiments.scenario import check, load, schedule
from ac_plant_node import Plant


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**31 - 1))
def test_each_seed_is_a_drive_within_what_is_promised(seed):
    scenario = load(f"drive:{seed}")
    assert scenario == load(f"drive:{seed}")
    assert (scenario.duration_s, scenario.noise.seed) == (1500.0, seed)
    plant = Plant.at(scenario.operating_point)
    begin = plant.outputs.evaporator_pressure_pa, plant.outputs.superheat_k
    plan = schedule(scenario, plant.inputs, np.array(begin))
    p_e, superheat = plan.reference.T
    assert (p_e[0], superheat[0]) == begin
    assert np.all((p_e >= min(205e3, begin[0]) - 1e-6) & (p_e <= max(300e3, begin[0]) + 1e-6))
    assert np.all((superheat >= begin[1] - 8.0 - 1e-9) & (superheat <= begin[1] + 4.0 + 1e-9))
    flow, inlet_c, condenser_flow, condenser_c = plan.air.T[:4]
    rest = plant.inputs
    assert np.all((flow / rest[2] >= 0.65 - 1e-9) & (flow / rest[2] <= 1.45 + 1e-9))
    assert np.all((condenser_flow / rest[4] >= 0.5 - 1e-9) & (condenser_flow / rest[4] <= 2.0 + 1e-9))
    assert np.all((inlet_c >= 20.0 - 1e-9) & (inlet_c <= 43.0 + 1e-9))
    assert np.all((condenser_c >= 20.0 - 1e-9) & (condenser_c <= 45.0 + 1e-9))


def test_two_seeds_are_two_drives():
    assert load("drive:1").references != load("drive:2").references


def test_a_drive_takes_overrides_and_survives_its_own_file():
    scenario = load("drive:3", ["faults=[{kind: compressor_speed, size_rpm: 40, onset_s: 900}]"])
    assert scenario.faults[0].onset_s == 900.0
    assert check(scenario.model_dump(mode="json")) == scenario


@pytest.mark.parametrize("name", ["drive:", "drive:x", "drive:-1", "drive"])
def test_what_is_no_seed_is_refused(name):
    assert seed_of(name) is None
    with pytest.raises(UserError, match=r"unknown scenario|no such"):
        load(name)
