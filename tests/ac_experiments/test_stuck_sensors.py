"""Sensors that stand still: their readings stay to the bit, the truth is reading minus actual, and files offer them."""

import numpy as np
import pytest

from ac_common.errors import UserError
from ac_common.faults import FAULTS, STICKING
from ac_common.topics import truth_of
from ac_experiments.metrics import fault_summaries, summarise
from ac_experiments.report.narrative import narrative
from ac_experiments.scenario import check, load, to_yaml
from ac_experiments.simulate import simulate

NOISE = {
    "evaporator_pressure_kpa": 0.05,
    "superheat_k": 0.05,
    "wall_temperature_k": 0.05,
    "condenser_pressure_kpa": 0.5,
}
MOVING = {
    "mass_flow_percent": [{"at_s": 1, "to": 15.0, "ramp_s": 20}],
    "inlet_temperature_k": [{"at_s": 1, "to": 3.0, "ramp_s": 20}],
    "condenser_inlet_temperature_k": [{"at_s": 1, "to": 2.0, "ramp_s": 20}],
}
ONSET, END = 100, 200  # ticks
READINGS = {
    "evaporator_pressure": "evaporator_pressure",
    "superheat_sensor": "superheat",
    "wall_temperature_sensor": "wall_temperature",
    "condenser_pressure_sensor": "condenser_pressure",
    "air_inlet_sensor": "air_inlet_temperature",
    "condenser_air_sensor": "condenser_air_inlet_temperature",
}
NOISY = tuple(READINGS)[:4]


def scenario(*kinds, end_s=20.0, **more):
    faults = [{"kind": kind, "profile": "stuck", "onset_s": 10.0, "end_s": end_s} for kind in kinds]
    return check({"name": "stuck", "duration_s": 25.0, "air": MOVING, "faults": faults, "noise": NOISE, **more})


def test_all_sensors_have_the_profile_and_nothing_else_has() -> None:
    assert {fault.kind for fault in STICKING} == set(READINGS)
    for fault in FAULTS:
        given = {"kind": fault.kind, "profile": "stuck", "onset_s": 1.0}
        whole = {"name": "one", "duration_s": 5, "faults": [given]}
        if fault in STICKING:
            (found,) = check(whole).faults
            assert (found.size, found.profile) == (0.0, "stuck")
            given[fault.size_key] = 1.0
            with pytest.raises(UserError, match=f"{fault.size_key} does not belong to the profile 'stuck'"):
                check(whole)
        else:
            with pytest.raises(UserError, match="profile: given 'stuck'"):
                check(whole)


def test_a_stuck_fault_survives_its_file(tmp_path) -> None:
    given = scenario("superheat_sensor")
    file = tmp_path / "stuck.yaml"
    file.write_text(to_yaml(given))
    assert load(file) == given


@pytest.mark.parametrize("kind", NOISY)
def test_a_reading_stays_to_the_bit_what_it_was_and_comes_back(kind) -> None:
    series = simulate(scenario(kind)).series
    name = READINGS[kind]
    reading, actual, truth = series[f"measured/{name}"], series[f"plant/{name}"], series[truth_of(kind)]
    held = slice(ONSET - 1, END)
    assert (reading[held] == reading[ONSET - 1]).all()
    assert len(set(reading[:ONSET])) == ONSET  # noise
    assert len(set(reading[END:])) == len(reading) - END
    now = slice(ONSET, END)
    assert (truth[now] == reading[now] - actual[now]).all()
    assert np.ptp(truth[now]) > 0.0
    assert not truth[:ONSET].any()
    assert not truth[END:].any()
    # The others go on.
    for other in {READINGS[kind] for kind in NOISY} - {name}:
        assert len(set(series[f"measured/{other}"])) == len(actual)


@pytest.mark.parametrize("kind", sorted({*READINGS} - {*NOISY}))
def test_a_reading_of_inlet_air_stays_and_the_air_goes_on(kind: str) -> None:
    series = simulate(scenario(kind)).series
    reading, air = series[f"measured/{READINGS[kind]}"], series[f"plant/{READINGS[kind]}"]
    assert (reading[ONSET:END] == air[ONSET - 1]).all()
    assert air[ONSET - 1] < air[END] - 0.9
    assert (series[truth_of(kind)][ONSET:END] == reading[ONSET:END] - air[ONSET:END]).all()
    assert (reading[END:] == air[END:]).all()


@pytest.mark.parametrize("kind", sorted({*READINGS} - {*NOISY}))
def test_a_reading_of_inlet_air_stays_in_a_car_where_that_air_is_a_result(kind: str) -> None:
    car = {"cabin": 40.0, "outside_temperature_c": [[0, 30], [25, 35]], "sun_w_m2": 600.0}
    fault = {"kind": kind, "profile": "stuck", "onset_s": 10.0, "end_s": 20.0}
    run = simulate(check({"name": "stuck", "duration_s": 25.0, "passive": True, "car": car, "faults": [fault]}))
    reading, air = run.series[f"measured/{READINGS[kind]}"], run.series[f"plant/{READINGS[kind]}"]
    assert (reading[ONSET:END] == air[ONSET - 1]).all()
    assert np.ptp(air[ONSET:END]) > 0.5
    assert (reading[:ONSET] == air[:ONSET]).all()
    assert (reading[END:] == air[END:]).all()
    assert (run.series[truth_of(kind)][ONSET:END] == reading[ONSET:END] - air[ONSET:END]).all()


def test_a_bias_that_is_there_at_the_onset_is_held_with_the_reading() -> None:
    given = scenario("condenser_pressure_sensor").model_dump(mode="json")
    bias = {"kind": "condenser_pressure_sensor", "size_kpa": 50.0, "onset_s": 5.0, "profile": "ramp", "rise_s": 10.0}
    series = simulate(check({**given, "faults": [*given["faults"], bias]})).series
    reading = series["measured/condenser_pressure"]
    assert (reading[ONSET:END] == reading[ONSET - 1]).all()
    off = reading - series["plant/condenser_pressure"]
    assert off[ONSET - 1] == pytest.approx(50e3 * 0.49, abs=3e3)
    assert off[END:] == pytest.approx(50e3, abs=3e3)


def test_a_thermocouple_that_stands_still_leaves_the_derived_superheat_to_the_pressure() -> None:
    from ac_plant_node.saturation import saturation_temperature

    series = simulate(scenario("superheat_sensor", superheat_sensor="derived")).series
    outlet = series["measured/superheat"] + [saturation_temperature(p) for p in series["measured/evaporator_pressure"]]
    np.testing.assert_allclose(outlet[ONSET:END], outlet[ONSET - 1], rtol=0, atol=1e-9)
    assert np.ptp(series["measured/superheat"][ONSET:END]) > 0.0


def test_summary_and_words_tell_the_largest_error() -> None:
    run = simulate(scenario("superheat_sensor", "air_inlet_sensor"))
    inlet, superheat = sorted(fault_summaries(run), key=lambda fault: fault["kind"])
    for fault in (inlet, superheat):
        truth = run.series[truth_of(fault["kind"])]
        assert fault["stuck"]
        assert fault["size"] == truth[np.argmax(np.abs(truth))]
        assert (fault["onset_s"], fault["end_s"]) == (10.0, 20.0)
    told = " ".join(sentence.text for sentence in narrative(summarise(run)))
    assert (
        "At 10 s the sensor of the air's inlet temperature stands still and comes to read up to 1.5 K too low" in told
    )


def test_stuck_in_the_first_tick_is_the_value_of_the_first_tick() -> None:
    faults = [{"kind": kind, "profile": "stuck", "onset_s": 0.0} for kind in READINGS]
    series = simulate(check({"name": "stuck", "duration_s": 5.0, "air": MOVING, "faults": faults})).series
    for name in READINGS.values():
        assert (series[f"measured/{name}"] == series[f"measured/{name}"][0]).all()
