"""The summary on recordings whose figures are known by construction."""

import json
from collections.abc import Callable

import numpy as np
import pytest

from ac_common.errors import UserError
from ac_common.health import AS_USUAL
from ac_common.units import KPA, RPM
from ac_experiments.metrics import summarise, write_summary
from ac_experiments.recording import Recording

ACTUATOR = {"kind": "compressor_speed", "size_rpm": 40.0, "onset_s": 100.0}
SENSOR = {"kind": "evaporator_pressure", "size_kpa": 5.0, "onset_s": 150.0}
Make = Callable[..., Recording]

CONTRACT = {
    *("scenario", "mode", "passive", "ticks", "sample_time_s", "wall_seconds", "real_time_factor", "missed_ticks"),
    *("faults", "false_alarms", "metrics"),
}
CONTRACT_METRICS = {
    *("command_change_rpm", "peak_pressure_error_kpa", "steady_pressure_error_kpa", "peak_superheat_error_k"),
}


def test_an_actuator_fault(recording_of: Make, tmp_path):
    summary = summarise(recording_of(faults=[ACTUATOR]))
    assert set(summary) >= CONTRACT
    assert set(summary["metrics"]) >= CONTRACT_METRICS
    assert (summary["ticks"], summary["real_time_factor"], summary["false_alarms"]) == (2000, 100.0, 0)
    (fault,) = summary["faults"]
    assert (fault["kind"], fault["isolated_as"]) == ("compressor_speed", "compressor_speed")
    assert (fault["onset_s"], fault["detected_s"], fault["isolated_s"]) == (100.0, 103.0, 107.0)
    assert (fault["size"], fault["unit"], fault["estimate"]) == (pytest.approx(40), "rpm", pytest.approx(40))
    metrics = summary["metrics"]
    assert metrics["command_change_rpm"] == pytest.approx(-40.0)
    assert metrics["peak_pressure_error_kpa"] == pytest.approx(1.0)
    assert metrics["steady_pressure_error_kpa"] == pytest.approx(0.0, abs=1e-9)
    assert metrics["peak_superheat_error_k"] == pytest.approx(0.5)
    write_summary(summary, tmp_path / "summary.json")
    assert json.loads((tmp_path / "summary.json").read_text()) == summary


def test_when_the_pressure_is_back_for_good(recording_of: Make):
    (fault,) = summarise(recording_of(faults=[ACTUATOR]))["faults"]
    # A half sine of 1 kPa over 20 s falls below 0.25 kPa at 20 (1 - asin(0.25)/pi) = 18.39 s.
    assert fault["settled_s"] == pytest.approx(118.4)
    assert fault["peak_pressure_error_kpa"] == pytest.approx(1.0)
    away = recording_of(faults=[ACTUATOR])
    away.series["plant/evaporator_pressure"][-5:] += KPA
    assert summarise(away)["faults"][0]["settled_s"] is None
    calm = recording_of(faults=[ACTUATOR])
    calm.series["plant/evaporator_pressure"] = calm.series["reference/evaporator_pressure"] + 0.2 * KPA
    assert summarise(calm)["faults"][0]["settled_s"] == 100.0
    # Noise of 0.2 kPa is there before the fault as after it; a bump of 3 kPa is not.
    noisy = recording_of(faults=[ACTUATOR])
    noisy.series["plant/evaporator_pressure"] += 200.0 * np.random.default_rng(1).normal(size=len(noisy.time_s))
    noisy.series["plant/evaporator_pressure"] += 3 * KPA * ((noisy.time_s > 100) & (noisy.time_s < 130))
    (fault,) = summarise(noisy)["faults"]
    assert fault["settled_s"] == pytest.approx(130.0)
    assert fault["settled_within_kpa"] == pytest.approx(0.25 + 4 * 0.2, rel=0.1)
    # What comes after the next fault is that one's.
    first, second = summarise(recording_of(faults=[ACTUATOR, SENSOR]))["faults"]
    assert (first["settled_s"], second["settled_s"]) == (pytest.approx(118.4), pytest.approx(168.4))


def test_the_error_is_that_of_the_actual_pressure_with_its_sign(recording_of: Make):
    recording = recording_of(faults=[SENSOR])
    recording.series["plant/evaporator_pressure"] -= np.where(recording.time_s >= 160.0, 5.0 * KPA, 0.0)
    metrics = summarise(recording)["metrics"]
    assert metrics["steady_pressure_error_kpa"] == pytest.approx(-5.0)
    assert metrics["peak_pressure_error_kpa"] == pytest.approx(5.0)


def test_nothing_before_the_first_fault_counts_as_its_effect(recording_of: Make):
    recording = recording_of(faults=[ACTUATOR])
    recording.series["plant/evaporator_pressure"][:500] += 30.0 * KPA
    assert summarise(recording)["metrics"]["peak_pressure_error_kpa"] == pytest.approx(1.0)


def test_two_faults_are_told_apart(recording_of: Make):
    summary = summarise(recording_of(faults=[ACTUATOR, SENSOR]))
    assert [fault["isolated_as"] for fault in summary["faults"]] == ["compressor_speed", "evaporator_pressure"]
    assert [fault["isolated_s"] for fault in summary["faults"]] == [107.0, 157.0]
    assert [fault["detected_s"] for fault in summary["faults"]] == [103.0, 157.0]
    assert [fault["estimate"] for fault in summary["faults"]] == pytest.approx([40.0, 5.0])
    # After the last fault minus just before it: the answer to the first one is over by then.
    assert summary["metrics"]["command_change_rpm"] == pytest.approx(0.0)


def test_without_a_fault(recording_of: Make):
    summary = summarise(recording_of())
    assert summary["faults"] == []
    assert summary["false_alarms"] == 0
    assert summary["metrics"]["command_change_rpm"] == 0.0
    assert summary["metrics"]["peak_pressure_error_kpa"] == 0.0


def test_false_alarms_are_counted(recording_of: Make):
    # The detector's rows are those of a run with a fault, but none was injected.
    recording = recording_of()
    recording.status[:] = recording_of(faults=[ACTUATOR]).status
    assert summarise(recording)["false_alarms"] == 1
    # A fault that is there, named as the other one.
    wrong = recording_of(faults=[ACTUATOR])
    wrong.status[:] = [row._replace(isolated=row.isolated and "evaporator_pressure") for row in wrong.status]
    summary = summarise(wrong)
    assert summary["false_alarms"] == 1
    assert summary["faults"][0]["isolated_as"] == "evaporator_pressure"


def test_each_false_alarm_is_told_with_time_kind_and_length(recording_of: Make):
    recording = recording_of()
    recording.status[:] = [
        row._replace(
            detected=20.0 <= row.time_s < 32.0, isolated="evaporator_pressure" if 25 <= row.time_s < 30 else None
        )
        for row in recording.status
    ]
    summary = summarise(recording)
    assert summary["false_alarms"] == 1
    assert summary["false_alarm_list"] == [
        {"time_s": 20.0, "kind": "evaporator_pressure", "length_s": pytest.approx(12.0), "sure_s": 25.0}
    ]
    assert summary["detections"] == [{"time_s": 20.0, "kind": None, "length_s": pytest.approx(12.0)}]
    assert summary["isolations"] == [
        {"time_s": 25.0, "kind": "evaporator_pressure", "length_s": pytest.approx(5.0), "sure_s": 25.0}
    ]


def test_a_fault_that_stays_named_beside_a_second_one_is_named_once(recording_of: Make):
    recording = recording_of(faults=[ACTUATOR, SENSOR])
    recording.status[:] = [
        row._replace(also_isolated="compressor_speed" if row.isolated == "evaporator_pressure" else None)
        for row in recording.status
    ]
    summary = summarise(recording)
    assert [(spell["kind"], spell["time_s"], spell["length_s"]) for spell in summary["isolations"]] == [
        ("compressor_speed", 107.0, None),
        ("evaporator_pressure", 157.0, None),
    ]
    assert summary["false_alarm_list"] == []


def test_what_nodes_do_other_than_usual_is_told_with_its_length(recording_of: Make):
    recording = recording_of()
    recording.metadata["events"] = [
        {"time_s": 10.0, "node": "gimc_controller", "what": "no q: K0 alone"},
        {"time_s": 12.0, "node": "compensator", "what": "outside the design range"},
        {"time_s": 14.5, "node": "gimc_controller", "what": AS_USUAL},
    ]
    assert [event["length_s"] for event in summarise(recording)["events"]] == [4.5, None, None]


def test_a_missed_fault(recording_of: Make):
    recording = recording_of(faults=[ACTUATOR])
    recording.status[:] = recording_of().status
    (fault,) = summarise(recording)["faults"]
    assert (fault["detected_s"], fault["isolated_as"], fault["estimate"]) == (None, None, None)


def test_a_fault_injected_live_is_read_off_the_truth(recording_of: Make):
    recording = recording_of()
    recording.series["fault/compressor_speed:compressor"][700:900] = -30.0 * RPM
    (fault,) = summarise(recording)["faults"]
    assert (fault["kind"], fault["onset_s"], fault["size"]) == ("compressor_speed", 70.0, pytest.approx(-30.0))


def test_a_recording_cut_short_is_summarised_as_far_as_it_goes(recording_of: Make):
    whole = recording_of(faults=[ACTUATOR, SENSOR])
    cut = Recording(
        time_s=whole.time_s[:1200],
        series={key: values[:1200] for key, values in whole.series.items()},
        status=whole.status[:1200],
        metadata={**whole.metadata, "complete": False, "wall_seconds": None},
    )
    cut.series["plant/superheat"][-3:] = np.nan
    summary = summarise(cut)
    assert summary["complete"] is False
    assert summary["real_time_factor"] is None
    assert [fault["kind"] for fault in summary["faults"]] == ["compressor_speed"]
    json.dumps(summary, allow_nan=False)


def test_an_empty_recording_is_refused(recording_of: Make):
    whole = recording_of()
    empty = Recording(whole.time_s[:0], {key: values[:0] for key, values in whole.series.items()}, [], whole.metadata)
    with pytest.raises(UserError, match="no tick"):
        summarise(empty)
