"""The designs for the whole envelope in the loop, through `simulate`."""

import numpy as np
import pytest

from ac_common.errors import UserError
from ac_common.units import KPA
from ac_experiments.scenario import check, load
from ac_experiments.simulate import simulate
from gimc_controller_node.reference_limits import TOO_DRY

SIZES = {"compressor_speed": {"size_rpm": 40.0}, "evaporator_pressure": {"size_kpa": 5.0}}


def drive(**more):
    """The first 240 s of a drive, in which the load moves."""
    content = load("drive:0").model_dump(mode="json")
    short = {"references": {}, "air": {}}
    for part in short:
        for key, changes in content[part].items():
            if isinstance(changes, list):
                short[part][key] = [change for change in changes if change["at_s"] < 240.0]
    return check({**content, **short, "design": "envelope", "duration_s": 240.0, **more})


def pressure(recording):
    return recording.series["plant/evaporator_pressure"]


@pytest.fixture(scope="module")
def alone():
    return simulate(drive(), passive=True)


def test_k0_alone_is_what_is_left_without_a_fault(alone):
    healthy = simulate(drive())
    assert not any(row.isolated for row in healthy.status)
    assert np.array_equal(pressure(healthy), pressure(alone))


@pytest.mark.parametrize(
    ("name", "until_s"),
    [
        ("drive:20170", 952.0),  # a step of the blower moves p_e by 6 kPa/s
        ("drive:20411", 587.0),  # another one, which looked like a fault of the compressor
        ("drive:20679", 513.0),  # a swing after one: the plant's rates have a kink that a coarse step does not see
    ],
)
def test_what_the_load_does_is_no_fault(name, until_s):
    run = simulate(load(name, [f"duration_s={until_s:g}"]))
    assert not any(row.detected for row in run.status)


@pytest.mark.parametrize("kind", SIZES)
def test_a_fault_leaves_the_plant_where_it_is_without(alone, kind):
    run = simulate(drive(faults=[{"kind": kind, "onset_s": 100.0, **SIZES[kind]}]))
    assert {row.isolated for row in run.status[1200:]} == {kind}
    assert np.abs(pressure(run) - pressure(alone))[1600:].max() < 500.0


def test_a_superheat_that_the_air_cannot_give_is_capped_and_said():
    content = {
        "name": "too_dry",
        "operating_point": "low",
        "design": "envelope",
        "duration_s": 400.0,
        "air": {"inlet_temperature_k": [{"at_s": 0.0, "to": -5.0, "ramp_s": 100.0}]},
        "references": {"superheat_k": [{"at_s": 100.0, "to": 8.0}]},
    }
    run = simulate(check(content))
    assert TOO_DRY in [event["what"] for event in run.metadata["events"]]
    last = run.series["plant/superheat"][-500:]
    assert np.ptp(last) < 0.1


def test_the_envelope_has_one_k0():
    with pytest.raises(UserError, match="controller: paper needs design: paper"):
        check({"name": "x", "duration_s": 10.0, "design": "envelope", "controller": "paper"})


def test_a_fault_is_told_with_a_superheat_that_is_derived_from_the_faulty_pressure() -> None:
    fault = {"kind": "evaporator_pressure", "size_kpa": 5.0, "onset_s": 60.0}
    what = {"name": "derived", "duration_s": 120.0, "superheat_sensor": "derived", "faults": [fault]}
    run = simulate(check(what))
    assert {row.isolated for row in run.status} == {None, "evaporator_pressure"}
    off = run.series["plant/evaporator_pressure"] - run.series["reference/evaporator_pressure"]
    assert np.abs(off).max() < 0.5 * KPA
    assert np.abs(run.series["fdi/residual/evaporator_pressure"][-100:] - 5.0 * KPA).max() < 0.2 * KPA
