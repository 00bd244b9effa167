"""Scenarios: what a file may say, what the error lines say, and the arrays that come of it."""

from collections.abc import Callable
from pathlib import Path
from tempfile import NamedTemporaryFile

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ac_common.errors import UserError
from ac_common.fault_profiles import PROFILES, unit_profile
from ac_common.faults import KINDS
from ac_common.units import KPA, RPM
from ac_common.yaml_file import yaml_text
from ac_experiments.scenario import built_in_scenarios, check, load, schedule, to_yaml
from ac_experiments.scenario_schema import SENSORS, Scenario
from ac_plant_node.inputs import INPUT_HIGH, INPUT_LOW
from ac_plant_node.rest import rest_at
from fault_injector_node.live import LiveFault, Shape

INPUTS = np.array([104.7, 0.40, 0.10, 30.0, 0.55, 30.0, 0.0])
OUTPUTS = np.array([251.2e3, 20.0, 15.0, 1.33e6])


def error_of(*overrides: str, name: str = "both_faults") -> str:
    with pytest.raises(UserError) as caught:
        load(name, overrides)
    line = str(caught.value)
    assert "\n" not in line
    return line


@pytest.mark.parametrize("name", built_in_scenarios())
def test_built_in_scenarios_are_valid_and_survive_a_round_trip(name: str, tmp_path: Path):
    scenario = load(name, whole=False)
    assert scenario.name == name
    copy = tmp_path / "copy.yaml"
    copy.write_text(to_yaml(scenario))
    assert load(copy, whole=False) == scenario
    if not name.startswith("sc03"):  # they want a file
        # What a recording keeps of a scenario is enough to make it again.
        assert check(scenario.model_dump(mode="json")) == scenario


def test_the_papers_experiments_inject_what_the_paper_says():
    actuator, sensor = load("actuator_fault"), load("sensor_fault")
    for scenario, column, size in ((actuator, 0, 40 * RPM), (sensor, 1, 5 * KPA)):
        plan = schedule(scenario, INPUTS, OUTPUTS)
        faulty = plan.faults[:, column] != 0
        assert plan.time_s[faulty][0] == 500.0
        assert np.all(plan.faults[faulty, column] == size)
        assert not plan.faults[:, 1 - column].any()
        # The manoeuvre ends well before the fault.
        at_fault = plan.reference[plan.time_s == 500.0][0]
        assert at_fault == pytest.approx(OUTPUTS[:2] + np.array([5000.0, -2.5]))
        assert np.all(plan.reference[plan.time_s > 300.0] == at_fault)


def test_a_drive_cycle_becomes_changes_of_the_air_flow(tmp_path: Path):
    file = tmp_path / "drive.csv"
    file.write_text("time_s,speed_mph\n0,0\n1,0\n2,20\n3,40\n4,40\n5.3,0\n")
    scenario = load("sc03_ram_air", [f"air.drive_cycle.file={file}", "duration_s=450"])
    assert scenario.air.drive_cycle is None
    flow = schedule(scenario, INPUTS, OUTPUTS).air[:, 0] / INPUTS[2]
    time_s = [0.0, 1.0, 1.5, 2.0, 3.0, 4.0, 5.3, 400.0]
    expected = [1.0, 1.0, 1.0125, 1.025, 1.1, 1.1, 1.0, 1.0]
    np.testing.assert_allclose(flow[np.rint(np.array(time_s) / 0.1).astype(int)], expected)
    assert check(scenario.model_dump(mode="json")) == scenario  # what a recording keeps needs no file
    assert scenario.air.condenser_mass_flow_percent == []


def test_a_drive_cycle_can_be_ram_air_on_the_condenser_too(tmp_path: Path):
    file = tmp_path / "drive.csv"
    file.write_text("time_s,speed_m_s\n0,0\n1,0\n2,10\n3,20\n4,20\n5.3,0\n")
    given = [f"air.drive_cycle.file={file}", "air.drive_cycle.condenser=true", "duration_s=450"]
    air = schedule(load("sc03_ram_air", given), INPUTS, OUTPUTS).air
    flow = air[np.rint(np.array([0.0, 2.0, 3.0, 4.0, 5.3, 400.0]) / 0.1).astype(int), 2]
    # Fan and ram air add as squares: 0.55 kg/s, and 1.16 kg/m3 * 0.24 m2 * 0.2 of the speed.
    ram = 1.16 * 0.24 * 0.2 * np.array([0.0, 10.0, 20.0, 20.0, 0.0, 0.0])
    np.testing.assert_allclose(flow, np.sqrt(0.55**2 + ram**2), rtol=1e-12)
    both = [*given, "air.condenser_mass_flow_percent=[{at_s: 1, to: 2}]"]
    assert "condenser_mass_flow_percent and drive_cycle both say" in error_of(*both, name="sc03_ram_air")


def test_without_its_file_a_drive_cycle_says_where_there_is_one():
    line = error_of(name="sc03_ram_air")
    assert "air.drive_cycle.file: drive cycle sc03.csv: no such file; the EPA publishes SC03" in line
    assert "give one of them" in error_of("air.mass_flow_percent=[{at_s: 1, to: 2}]", name="sc03_ram_air")


def test_time_is_exactly_what_a_stamp_says():
    scenario = load("nominal", ["sample_time_s=0.03"])
    time_s = schedule(scenario, INPUTS, OUTPUTS).time_s
    for k in (0, 1, 7, 333, scenario.ticks - 1):
        stamp_ns = k * 30_000_000
        assert time_s[k] == stamp_ns / 1e9


def test_references_and_air_are_changes_from_the_operating_point():
    scenario = check(
        {
            "name": "moves",
            "duration_s": 100.0,
            "references": {"evaporator_pressure_kpa": [{"at_s": 10, "to": 4, "ramp_s": 20}, {"at_s": 50, "to": 1}]},
            "air": {"mass_flow_percent": [{"at_s": 30, "to": -20}], "inlet_temperature_k": [{"at_s": 40, "to": 3}]},
        }
    )
    plan = schedule(scenario, INPUTS, OUTPUTS)

    def at(array: np.ndarray, time_s: float) -> float:
        return array[round(time_s / 0.1)]

    pressure = (plan.reference[:, 0] - OUTPUTS[0]) / KPA
    assert [at(pressure, t) for t in (0, 10, 20, 30, 49.9, 50, 99)] == pytest.approx([0, 0, 2, 4, 4, 1, 1])
    assert np.all(plan.reference[:, 1] == OUTPUTS[1])
    assert at(plan.air[:, 0], 29.9) == INPUTS[2]
    assert at(plan.air[:, 0], 30) == pytest.approx(0.8 * INPUTS[2])
    assert at(plan.air[:, 1], 40) == INPUTS[3] + 3.0
    assert np.all(plan.air[:, 2:] == INPUTS[4:])


@given(
    targets=st.tuples(st.floats(-80.0, 170.0), st.floats(-30.0, 20.0), st.floats(0.0, 100.0)),
    ramp_s=st.floats(0.0, 30.0),
)
def test_the_condensers_air_and_the_humidity_move_within_what_the_plant_takes(targets, ramp_s: float):
    keys = ("condenser_mass_flow_percent", "condenser_inlet_temperature_k", "humidity_percent")
    air = {key: [{"at_s": 10.0, "to": to, "ramp_s": ramp_s}] for key, to in zip(keys, targets, strict=True)}
    played = schedule(check({"name": "moves", "duration_s": 50.0, "air": air}), INPUTS, OUTPUTS).air
    assert np.all(played[:, :2] == INPUTS[2:4])
    assert np.all(played[:100, 2:] == INPUTS[4:])
    flow, inlet, humidity = targets
    np.testing.assert_allclose(played[-1, 2:], [0.55 * (1.0 + flow / 100.0), 30.0 + inlet, humidity / 100.0], atol=1e-9)
    assert np.all((INPUT_LOW[2:] - 1e-12 <= played) & (played <= INPUT_HIGH[2:] + 1e-12))


@pytest.mark.parametrize("point", ["low", "med", "high"])
def test_the_shipped_operating_points_have_the_air_that_the_limits_are_for(point: str):
    assert np.all(rest_at(point)["inputs"][4:] == INPUTS[4:])


def test_sensors_are_a_number_or_a_list():
    for sensors, designs in (("3", 3), ("4", 3), ("[p_e, superheat, T_w]", 3), ("[p_e, superheat, T_w, p_c]", 3)):
        scenario = load("nominal", [f"sensors={sensors}"])
        assert scenario.design_sensors == designs
        assert check(scenario.model_dump(mode="json")) == scenario
    for sensors in ("2", "[p_c, superheat, p_e]"):
        assert load("nominal", [f"sensors={sensors}", "passive=true"]).design_sensors == 2
        assert "needs passive: true" in error_of(f"sensors={sensors}")
    short = {"name": "short", "duration_s": 1.0}
    for number in (2, 3, 4):
        assert check({**short, "sensors": number}).envelope_sensors == SENSORS[:number]
    assert check(short).envelope_sensors == SENSORS
    assert check({**short, "sensors": ["p_c", "superheat", "p_e"]}).envelope_sensors == ("p_c", "superheat", "p_e")


def test_the_design_is_that_of_the_envelope_where_nothing_is_said_but_for_the_papers_experiments():
    of_the_paper = {"nominal", "isolation", "isolation_two_sensors", "isolation_disturbed", "actuator_fault"}
    of_the_paper |= {"sensor_fault", "sensor_fault_derived", "both_faults"}
    on_the_belt = {"city"}
    for name in built_in_scenarios():
        expected = "paper" if name in of_the_paper | on_the_belt else "envelope"
        assert load(name, whole=False).design == expected, name
    assert load("drive:1").design == "envelope"
    belt = {"name": "belt", "duration_s": 1.0, "passive": True, "car": {"compressor_drive": "belt"}}
    assert check(belt).design == "paper"
    assert "needs design: paper" in error_of("design=envelope", name="city")


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("duraton_s=5", ["duraton_s", "did you mean 'duration_s'", "allowed"]),
        ("duration_s=nan", ["duration_s", "nan"]),
        ("duration_s=.nan", ["duration_s", "nan", "finite"]),
        ("duration_s='600'", ["duration_s", "'600'", "number"]),
        ("duration_s=-1", ["duration_s", "-1", "greater than 0"]),
        ("sample_time_s=1", ["sample_time_s", "0.1"]),
        ("operating_point=medium", ["operating_point", "'medium'", "'low', 'med' or 'high'"]),
        ("faults.0.size_rmp=3", ["faults.0", "size_rmp", "did you mean 'size_rpm'"]),
        ("faults.0.size_kpa=3", ["faults.0", "size_kpa", "size_rpm"]),  # the wrong unit for this fault
        ("faults.0.kind=compressor", ["faults.0", "'compressor'", "compressor_speed", "evaporator_pressure"]),
        ("faults.0.size_rpm=fast", ["faults.0.size_rpm", "'fast'"]),
        ("faults.0.size_rpm=1e9", ["faults.0.size_rpm", "1000"]),
        ("faults.0.onset_s=5000", ["faults.0.onset_s", "5000", "1100"]),
        ("faults.0.end_s=1", ["end_s 1", "onset_s 400"]),
        ("faults.0.period_s=1", ["period_s", "'step'"]),
        ("faults.7.size_rpm=1", ["faults.7", "0 to 1"]),
        ("faults=[{size_rpm: 3}]", ["faults.0", "kind is missing", "compressor_speed"]),
        ("references.superheat_k=[{at_s: 5, to: 900}]", ["references.superheat_k", "900", "-18 to 30"]),
        ("references.superheat_k=[{at_s: 9, to: 1, ramp_s: 9}, {at_s: 10, to: 2}]", ["superheat_k", "10 s", "9 s"]),
        ("noise.seed=1.5", ["noise.seed", "1.5", "integer"]),
        ("passive=3", ["passive", "3"]),
        ("name=../escape", ["name", "../escape"]),
        ("sensors=5", ["sensors", "given 5", "2, 3, 4 or a list"]),
        ("sensors=[p_e, superheat, T_v]", ["sensors", "'T_v'", "did you mean 'T_w'"]),
        ("sensors=[p_e, T_w]", ["sensors", "lacks superheat"]),
        ("sensors=[p_e, superheat, p_e]", ["sensors", "twice"]),
        ("air_flow_sensor=fan", ["air_flow_sensor", "'fan'", "blower"]),
        ("air_flow_sensor=blower", ["air_flow_sensor: blower", "design: envelope"]),
        ("air.humidity_percent=[{at_s: 1, to: 101}]", ["air.humidity_percent", "101", "0 to 100"]),
        ("air.condenser_inlet_temperature_k=[{at_s: 1, to: 21}]", ["condenser_inlet_temperature_k", "-30 to 20"]),
        ("duration_s.x=1", ["duration_s", "nothing below"]),
        ("duration_s", ["KEY=VALUE"]),
        ("noise={seed: 1, seed: 2}", ["noise"]),
    ],
)
def test_a_bad_value_gets_one_line_that_names_it(override: str, words: list[str]):
    line = error_of(override)
    for word in words:
        assert word in line


def test_a_bad_file_gets_one_line_that_names_it(tmp_path: Path):
    cases = {
        "broken.yaml": (b"name: [", "not valid YAML"),
        "binary.yaml": (b"\xff\xfe\x00", "UTF-8"),
        "list.yaml": (b"- 1\n- 2\n", "a list"),
        "empty.yaml": (b"", "nothing"),
        "twice.yaml": (b"name: a\nduration_s: 1\nduration_s: 2\n", "'duration_s' is given twice"),
        "short.yaml": (b"name: a\n", "duration_s: is missing"),
    }
    for name, (content, words) in cases.items():
        path = tmp_path / name
        path.write_bytes(content)
        with pytest.raises(UserError) as caught:
            load(path)
        assert str(path) in str(caught.value)
        assert words in str(caught.value)
        assert "\n" not in str(caught.value)


def test_a_misspelt_scenario_suggests_the_nearest():
    assert "did you mean 'actuator_fault'" in error_of(name="actuator_fualt")
    assert "no such scenario file" in error_of(name="missing.yaml")


_json = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["name", "duration_s", "faults", "kind", "size_rpm", "onset_s", "references", "air", "to"])
            | st.text(max_size=5),
            inner,
            max_size=4,
        )
    ),
    max_leaves=12,
)


def attempt(call: Callable[..., Scenario], argument: object) -> tuple[Scenario | None, str]:
    """Scenario or error line; any other exception passes through and fails the test."""
    try:
        return call(argument), ""
    except UserError as problem:
        return None, str(problem)


# The first draw of a text loads Unicode tables, which is not the code under test.
@settings(suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(content=st.dictionaries(st.sampled_from(["name", "duration_s", "faults", "noise", "air", "references"]), _json))
def test_whatever_the_file_holds_the_answer_is_a_scenario_or_one_line(content: dict[str, object]):
    scenario, line = attempt(check, content)
    assert "\n" not in line
    if scenario is not None:
        plan = schedule(scenario.model_copy(update={"duration_s": min(scenario.duration_s, 10.0)}), INPUTS, OUTPUTS)
        assert np.isfinite(plan.reference).all()
        assert np.isfinite(plan.air).all()


@settings(deadline=None)
@given(text=st.text(max_size=60))
def test_whatever_the_text_the_answer_is_a_scenario_or_one_line(text: str):
    with NamedTemporaryFile("w", suffix=".yaml", encoding="utf-8", errors="surrogateescape") as file:
        file.write(text)
        file.flush()
        _, line = attempt(load, file.name)
        assert "\n" not in line


@pytest.mark.parametrize("profile", PROFILES)
def test_a_profile_is_zero_before_its_onset_and_after_its_end(profile: str):
    time_s = np.arange(0, 300, 0.1)
    values = unit_profile(time_s, profile, 100.0, 200.0)
    assert not values[(time_s < 100.0) | (time_s >= 200.0)].any()
    assert np.abs(values).max() > 0.3
    assert np.array_equal(values, unit_profile(time_s, profile, 100.0, 200.0))


def test_an_intermittent_fault_is_back_in_the_tick_in_which_its_period_ends():
    """Tick 1607 less the onset is 59.999999999999986 s: rounding must not cost a tick, here or live."""
    time_s = np.arange(3000) * 0.1
    shape = unit_profile(time_s, "intermittent", 100.7, period_s=60.0, duty_percent=50.0)
    live = LiveFault(0.1)
    live.start(Shape(profile="intermittent", size=1.0, period_s=60.0, duty_percent=50.0))
    assert np.flatnonzero(np.diff(shape)).tolist() == [1006, 1306, 1606, 1906, 2206, 2506, 2806]
    assert [live.value(at_s) for at_s in time_s[1007:].tolist()] == shape[1007:].tolist()


def test_faults_of_a_kind_may_not_be_more_together_than_one_may_be():
    faults = "faults=[{kind: evaporator_pressure, size_kpa: -80, onset_s: 100%s}, {kind: evaporator_pressure, %s}]"
    second = "size_kpa: 30, onset_s: 200"
    assert error_of(faults % ("", second)) == (
        "both_faults.yaml with --set: faults: those of evaporator_pressure are 110 kPa together at 200 s; "
        "allowed: 100 kPa"
    )
    assert len(load("both_faults", [faults % (", end_s: 200", second)]).faults) == 2


def test_a_random_walk_stays_within_the_largest_fault():
    fault = "faults=[{kind: compressor_speed, size_rpm: 900, onset_s: 0, profile: random_walk, time_constant_s: 1}]"
    plan = schedule(load("nominal", [fault]), INPUTS, OUTPUTS)
    assert np.abs(plan.faults[:, 0]).max() == pytest.approx(1000 * RPM)


def test_profiles_have_the_size_that_is_said():
    time_s = np.arange(0, 4000, 0.1)
    assert unit_profile(time_s, "ramp", 10.0, rise_s=20.0)[200] == pytest.approx(0.5)
    assert unit_profile(time_s, "drift", 0.0, time_constant_s=100.0)[1000] == pytest.approx(1 - np.exp(-1))
    assert unit_profile(time_s, "sine", 0.0, period_s=40.0)[100] == pytest.approx(1.0)
    assert unit_profile(time_s, "intermittent", 0.0, period_s=40.0, duty_percent=25.0).mean() == pytest.approx(0.25)
    walks = np.array([unit_profile(time_s[:1001], "random_walk", 0.0, seed=seed)[-1] for seed in range(400)])
    assert walks.std() == pytest.approx(1.0, rel=0.15)  # four standard errors of 400 draws


def test_yaml_numbers_with_an_exponent_are_numbers(tmp_path: Path):
    path = tmp_path / "s.yaml"
    path.write_text(yaml_text({"name": "s"}) + "duration_s: 1e2\n")
    assert load(path).duration_s == 100.0


def test_the_reference_page_is_that_of_the_schema():
    from docs.tools.scenario_reference import PAGE, text

    assert PAGE.read_text(encoding="utf-8") == text(), "run: python -m docs.tools.scenario_reference"


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("operating_point=hihg", ["operating_point", "did you mean 'high'", "'low', 'med' or 'high'"]),
        ("controller=papers", ["controller", "did you mean 'paper'"]),
        ("superheat_sensor=derive", ["superheat_sensor", "did you mean 'derived'"]),
        ("faults.0.size_rpm=60", ["faults.0", "the list is empty", "faults=[{kind: compressor_speed"]),
        ("faults=3", ["faults", "given 3", "must be a list", "faults=[{kind: compressor_speed"]),
        ("references.superheat_k=5", ["references.superheat_k", "references.superheat_k=[{at_s: 100"]),
        ("noise.sed=3", ["noise", "'sed'", "did you mean 'seed'"]),
    ],
)
def test_a_wrong_setting_says_what_is_allowed(override: str, words: list[str]):
    with pytest.raises(UserError) as refused:
        load("nominal", [override])
    for word in words:
        assert word in str(refused.value)


def test_faults_that_are_there_or_not_need_no_size() -> None:
    faults = [{"kind": "valve_stuck", "onset_s": 1.0}, {"kind": "condenser_fan", "onset_s": 1.0}]
    assert [fault.size for fault in check({"name": "dead", "duration_s": 5.0, "faults": faults}).faults] == [1.0, 1.0]
    with pytest.raises(UserError, match="size_percent: is missing"):
        check({"name": "foul", "duration_s": 5.0, "faults": [{"kind": "condenser_fouling", "onset_s": 1.0}]})


def test_what_is_lost_cannot_be_gained() -> None:
    fault = {"kind": "refrigerant_leak", "size_kg_h": -0.1, "onset_s": 1.0}
    with pytest.raises(UserError, match=r"size_kg_h: given -0\.1; must be greater than or equal to 0"):
        check({"name": "filled", "duration_s": 5.0, "faults": [fault]})
    waves = {"kind": "refrigerant_leak", "size_kg_h": 1.0, "onset_s": 0.0, "profile": "sine", "period_s": 10.0}
    scenario = check({"name": "waves", "duration_s": 20.0, "faults": [waves]})
    sizes = schedule(scenario, INPUTS, OUTPUTS).faults[:, KINDS.index("refrigerant_leak")]
    assert sizes.min() == 0.0
    assert sizes.max() == pytest.approx(1.0 / 3600.0, rel=1e-3)


def test_noise_has_the_rms_of_its_size_and_is_the_same_again() -> None:
    time_s = 0.1 * np.arange(20000)
    noise = unit_profile(time_s, "noise", 500.0, seed=3)
    assert not noise[time_s < 500.0].any()
    assert noise[time_s >= 500.0].std() == pytest.approx(1.0, abs=0.03)
    assert (noise == unit_profile(time_s, "noise", 500.0, seed=3)).all()
    live = LiveFault(0.1)
    live.start(Shape("noise", 2.0, seed=3))
    assert np.std([live.value(t) for t in time_s]) == pytest.approx(2.0, abs=0.06)
