"""The loop in one process, on the nonlinear plant: what a run must reach, and the same numbers every time.

`acftc reproduce` judges the same runs more finely, against the paper.
"""

import numpy as np
import pytest

from ac_common.faults import COMPONENTS, Fault
from ac_common.signals import Performance, PlantOutput
from ac_common.topics import AIR_SIDE, BY_NAME, PERFORMANCE_SERIES, SERIES, residual_of, truth_of
from ac_experiments.designs import designs_at
from ac_experiments.metrics import summarise
from ac_experiments.recording import Recording
from ac_experiments.report.page import render
from ac_experiments.report.performance import figures, performance_of
from ac_experiments.scenario import check, load
from ac_experiments.simulate import simulate
from ac_plant_node import Plant, load_parameters, operating_point
from ac_plant_node.inputs import FAULT_KINDS, FAULTS, TO_SI


@pytest.fixture(scope="module")
def nominal() -> Recording:
    return simulate(load("nominal"))


def test_nominal_stays_at_rest(nominal: Recording):
    summary = summarise(nominal)
    assert summary["metrics"]["peak_pressure_error_kpa"] < 0.05
    assert summary["metrics"]["peak_superheat_error_k"] < 0.05
    assert summary["false_alarms"] == 0
    assert not any(row.detected for row in nominal.status)


def test_every_series_is_there_and_finite(nominal: Recording):
    assert set(nominal.series) == set(SERIES)
    for key, values in nominal.series.items():
        assert values.shape == nominal.time_s.shape, key
        assert np.isfinite(values).all(), key


def test_two_runs_are_the_same_to_the_last_bit():
    noise = [
        "duration_s=60",
        "noise={evaporator_pressure_kpa: 0.2, superheat_k: 0.1, wall_temperature_k: 0.05, seed: 3}",
    ]
    first, second = (simulate(load("nominal", noise)) for _ in range(2))
    for key in SERIES:
        assert np.array_equal(first.series[key], second.series[key]), key
    assert [row.detected for row in first.status] == [row.detected for row in second.status]
    other = simulate(load("nominal", [*noise, "noise.seed=4"]))
    assert not np.array_equal(
        first.series["measured/evaporator_pressure"], other.series["measured/evaporator_pressure"]
    )


def test_the_loop_passes_each_signal_on():
    short = simulate(load("actuator_fault", ["duration_s=30", "faults.0.onset_s=10", "references={}"]))
    series = short.series
    fault = series["fault/compressor_speed:compressor"]
    assert np.array_equal(series["actuator/command:compressor"], series["controller/command:compressor"] + fault)
    assert np.array_equal(series["measured/superheat"], series["plant/superheat"])
    # The fault acts on the plant over the sample after its onset, and not before.
    onset = int(np.flatnonzero(fault)[0])
    pressure = series["plant/evaporator_pressure"]
    assert np.abs(np.diff(pressure[: onset + 1])).max() < 1.0
    assert pressure[onset + 1] < pressure[onset] - 1.0


def test_noise_on_the_condenser_pressure_leaves_the_other_noise_as_it_is():
    noise = ["duration_s=60", "noise={evaporator_pressure_kpa: 0.2, superheat_k: 0.1, seed: 3}"]
    without = simulate(load("nominal", noise)).series
    series = simulate(load("nominal", [*noise, "noise.condenser_pressure_kpa=5"])).series
    assert np.array_equal(without["measured/condenser_pressure"], without["plant/condenser_pressure"])
    off = series["measured/condenser_pressure"] - series["plant/condenser_pressure"]
    assert 4000.0 < np.std(off) < 6000.0
    for key in set(SERIES) - {"measured/condenser_pressure"}:
        assert np.array_equal(series[key], without[key]), key
    # A sequence of its own, not a copy of another sensor's.
    p_e = series["measured/evaporator_pressure"] - series["plant/evaporator_pressure"]
    assert abs(np.corrcoef(off, p_e)[0, 1]) < 0.2


@pytest.mark.parametrize(
    ("key", "to", "higher"),
    [
        ("condenser_mass_flow_percent", -50.0, ["plant/condenser_pressure"]),
        ("condenser_inlet_temperature_k", 10.0, ["plant/condenser_pressure", "plant/condenser_air_inlet_temperature"]),
        # Water that condenses gives its heat, too: the compressor has more to do for the same pressure.
        ("humidity_percent", 60.0, ["controller/command:compressor", "plant/condenser_pressure"]),
    ],
)
def test_the_condensers_air_and_the_humidity_reach_the_plant(key: str, to: float, higher: list[str]):
    changes = {key: [{"at_s": 20.0, "to": to, "ramp_s": 30.0}]}
    series = simulate(check({"name": "moist", "duration_s": 200.0, "passive": True, "air": changes})).series
    for signal in higher:
        before, after = series[signal][190], series[signal][-1]
        assert after > 1.02 * before, signal


def test_the_performance_is_that_of_a_plant_with_the_same_inputs():
    changes = {"humidity_percent": [{"at_s": 5.0, "to": 60.0, "ramp_s": 10.0}]}
    series = simulate(check({"name": "moist", "duration_s": 60.0, "passive": True, "air": changes})).series
    told = Performance(*[series[key] for key in PERFORMANCE_SERIES])
    joints = ("compressor", "expansion_valve")
    inputs = np.column_stack(
        [
            *(series[f"actuator/command:{joint}"] for joint in joints),
            *(series[BY_NAME[topic].series[0]] for topic in AIR_SIDE),
        ]
    )
    plant = Plant.at("med")
    for k, held in enumerate(inputs):
        out = plant.outputs
        assert told.cooling[k] == out.cooling_power_w
        assert told.latent_cooling[k] == out.latent_cooling_w
        assert told.condensed_water[k] == out.condensed_water_kg_s
        assert told.frost[k] == out.frost_kg_s
        assert told.compressor_power[k] == out.compressor_power_w
        assert told.vent_temperature[k] == out.air_outlet_temperature_c
        assert told.subcooling[k] == out.subcooling_k
        plant.step(held, 0.1)
    dry = 30.0 - told.cooling[0] / (inputs[0, 2] * load_parameters()["air_cp_j_kgk"])
    assert told.vent_temperature[0] == pytest.approx(dry)
    # Latent heat of water at 0 to 30 degC: 2.43 to 2.50 MJ/kg.
    assert 2.40e6 < told.latent_cooling[-1] / told.condensed_water[-1] < 2.52e6
    mean = figures(performance_of(simulate(load("nominal", ["duration_s=60"]))))
    rest = operating_point("med")
    assert mean["cop"] == pytest.approx(rest.cop, rel=1e-6)
    assert mean["sensible_cooling"] == pytest.approx(rest.cooling_power_w, rel=1e-6)


def test_frost_is_told_in_the_run_and_in_its_report():
    content = {
        "name": "cold",
        "duration_s": 300.0,
        "passive": True,
        "references": {"evaporator_pressure_kpa": [{"at_s": 5.0, "to": -70.0, "ramp_s": 60.0}]},
        "air": {"humidity_percent": [{"at_s": 5.0, "to": 80.0}], "inlet_temperature_k": [{"at_s": 5.0, "to": -12.0}]},
    }
    run = simulate(check(content))
    frost = dict(zip(Performance._fields, PERFORMANCE_SERIES, strict=True))["frost"]
    seconds = np.count_nonzero(run.series[frost] > 0.0) * 0.1
    assert seconds > 10.0
    assert f"Frost: for {seconds:g} s" in render(run)
    assert "Frost: for" not in render(simulate(load("nominal", ["duration_s=20"])))


@pytest.mark.parametrize(
    ("key", "to", "isolated", "active_kpa"),
    [
        ("condenser_inlet_temperature_k", 10.0, {"compressor_speed", "evaporator_pressure"}, -1.8),
        ("condenser_mass_flow_percent", -50.0, {"compressor_speed", "evaporator_pressure"}, -4.1),
        ("humidity_percent", 50.0, {"evaporator_pressure"}, -9.7),
    ],
)
def test_the_linear_designs_take_the_new_disturbances_for_faults(key, to, isolated, active_kpa):
    """As the table in docs/plant.md says; a detector that knows of them is to do better."""
    scenario = load("nominal", ["duration_s=400", f"air.{key}=[{{at_s: 50, to: {to}, ramp_s: 50}}]"])
    for passive, expected in ((True, 0.0), (False, active_kpa)):
        run = simulate(scenario, passive=passive)
        assert {row.isolated for row in run.status} - {None} == isolated
        assert summarise(run)["false_alarms"] > 0
        error = run.series["plant/evaporator_pressure"][-1] - run.series["reference/evaporator_pressure"][-1]
        assert error / 1e3 == pytest.approx(expected, abs=0.05)


@pytest.mark.parametrize("passive", [False, True])
def test_actuator_fault(passive: bool):
    summary = summarise(simulate(load("actuator_fault"), passive=passive))
    (fault,) = summary["faults"]
    assert fault["isolated_as"] == "compressor_speed"
    assert fault["isolated_s"] - fault["onset_s"] < 60
    assert summary["false_alarms"] == 0
    if not passive:
        assert summary["metrics"]["command_change_rpm"] == pytest.approx(-40, abs=1)
        assert summary["metrics"]["peak_pressure_error_kpa"] < 1.0


@pytest.mark.parametrize("passive", [False, True])
def test_sensor_fault(passive: bool):
    summary = summarise(simulate(load("sensor_fault"), passive=passive))
    (fault,) = summary["faults"]
    assert fault["isolated_as"] == "evaporator_pressure"
    assert fault["isolated_s"] - fault["onset_s"] < 60
    assert summary["false_alarms"] == 0
    metrics = summary["metrics"]
    if passive:
        assert metrics["command_change_rpm"] == pytest.approx(50, abs=5)
        assert metrics["steady_pressure_error_kpa"] == pytest.approx(-5, abs=0.2)
    else:
        assert abs(metrics["command_change_rpm"]) < 0.5
        assert metrics["peak_pressure_error_kpa"] < 0.5


def test_another_compensator_can_be_tried():
    scenario = load("sensor_fault", ["duration_s=560"])
    own = designs_at("med", scenario.sample_time_s)
    assert np.array_equal(
        simulate(scenario, designs=own).series["compensator/q:compressor"],
        simulate(scenario).series["compensator/q:compressor"],
    )


def test_a_jump_of_the_superheat_sensor_is_an_unknown_fault_and_k0_is_then_alone():
    fault = {"kind": "superheat_sensor", "size_k": 3.0, "onset_s": 20.0}
    recording = simulate(check({"name": "jump", "design": "paper", "duration_s": 40.0, "faults": [fault]}))
    off = recording.series["measured/superheat"] - recording.series["plant/superheat"]
    np.testing.assert_allclose(off, np.where(recording.time_s >= 20.0, 3.0, 0.0), atol=1e-12)
    summary = summarise(recording)
    (found,) = summary["faults"]
    assert (found["size"], found["unit"], found["isolated_as"], found["estimate"]) == (3.0, "K", "unknown", None)
    assert found["isolated_s"] == pytest.approx(20.5)
    assert summary["false_alarms"] == 0
    q = np.abs(recording.series["compensator/q:compressor"])
    assert q[recording.time_s < 20.0].max() < 1e-6
    assert q.max() > 1.0  # the guard has seen it, too,
    assert q[recording.time_s > 26.0].max() == 0.0  # until it stands back


def test_a_slow_bias_of_the_superheat_sensor_cannot_be_told_from_the_other_faults():
    """The columns of air flow, f_N and f_p span all three readings at every frequency, so they explain any bias."""
    from ac_design.model import design_model

    for point in ("low", "med", "high"):
        system = design_model(point).system
        for frequency in np.logspace(-4, 0, 9):
            dynamics = 1j * frequency * np.eye(len(system.A)) - system.A
            columns = system.C @ np.linalg.solve(dynamics, np.hstack([system.E1, system.F1]))
            columns = columns + np.hstack([system.E2, system.F2])
            assert columns.shape == (3, 3)
            assert 10.0 < np.linalg.cond(columns) < 100.0


@pytest.mark.parametrize("fault", COMPONENTS, ids=lambda fault: fault.kind)
def test_a_component_fault_acts_in_the_plant_and_its_truth_is_told(fault: Fault):
    """The plant, given what the recording says that it was given, gives the recorded outputs."""
    profile = {"profile": "ramp", "rise_s": 2.0}
    faults = [{"kind": fault.kind, fault.size_key: fault.typical, "onset_s": 1.0, "end_s": 6.0, **profile}]
    moves = [{"at_s": 0.5, "to": 10.0, "ramp_s": 4.0}]
    scenario = {"name": "faulty", "duration_s": 8.0, "faults": faults, "references": {"evaporator_pressure_kpa": moves}}
    run = simulate(check(scenario), passive=True)
    series, plant = run.series, Plant.at("med")
    sizes = series[truth_of(fault.kind)]
    assert (sizes == series[f"component/faults:{fault.kind}"]).all()
    assert sizes.max() == pytest.approx(fault.typical * fault.si)
    told = np.column_stack([series[f"actuator/command:{joint}"] for joint in ("compressor", "expansion_valve")])
    for k in range(len(sizes) - 1):
        plant.set_faults({fault.kind: sizes[k] / TO_SI[FAULTS[FAULT_KINDS.index(fault.kind)].unit](1.0)})
        out = plant.step(np.append(told[k], plant.inputs[2:4]), 0.1)
        recorded = [series[f"plant/{name}"][k + 1] for name in PlantOutput._fields]
        np.testing.assert_allclose(out, recorded, rtol=1e-9)
    healthy = simulate(check({**scenario, "faults": []}), passive=True).series["plant/condenser_pressure"]
    assert np.abs(series["plant/condenser_pressure"] - healthy)[sizes == 0.0][:10].max() == 0.0
    assert np.abs(series["plant/condenser_pressure"] - healthy).max() > 1.0


@pytest.mark.parametrize(
    ("kind", "topic"),
    [
        ("air_inlet_sensor", "air_inlet_temperature"),
        ("condenser_air_sensor", "condenser_air_inlet_temperature"),
    ],
)
@pytest.mark.parametrize("design", ["paper", "envelope"])
def test_a_fault_of_an_inlet_sensor_is_in_the_reading_and_not_in_the_air(kind: str, topic: str, design: str):
    fault = {"kind": kind, "size_k": 3.0, "onset_s": 2.0}
    scenario = {"name": "inlet", "duration_s": 5.0, "design": design, "passive": True, "faults": [fault]}
    run = simulate(check(scenario))
    off = run.series[f"measured/{topic}"] - run.series[f"plant/{topic}"]
    assert (off == np.where(run.time_s >= 2.0, 3.0, 0.0)).all()
    assert (run.series[f"plant/{topic}"] == run.series[f"scenario/{topic}"]).all()
    healthy = simulate(check({**scenario, "faults": []}))
    # It is the detector alone that is told something else; that of a point has no use for the condenser's air.
    pressure = "plant/evaporator_pressure"
    np.testing.assert_array_equal(run.series[pressure], healthy.series[pressure])
    seen = residual_of("compressor_speed")
    used = design == "envelope" or kind == "air_inlet_sensor"
    assert (run.series[seen] == healthy.series[seen]).all() != used
