"""A recording whose key figures are known by construction, for tests that need no plant."""

from collections.abc import Callable

import numpy as np
import pytest

from ac_common.faults import FAULTS, KINDS
from ac_common.fdi_status import StatusRow
from ac_common.topics import AIR_SIDE, BY_NAME, SERIES, schedule_of, truth_of
from ac_common.units import KPA, RPM
from ac_experiments.recording import Recording
from ac_experiments.scenario import check, schedule
from ac_experiments.scenario_schema import Scenario

REST_INPUTS = np.array([1000.0 * RPM, 0.40, 0.10, 30.0, 0.55, 30.0, 0.0])
REST_OUTPUTS = np.array([251.2 * KPA, 20.0, 15.0, 1.33e6])


def make_recording(scenario: Scenario, passive: bool = False) -> Recording:
    """Ideal run: outputs on reference but for a 1 kPa bump, the command answers each fault fully 10 s after its onset.

    The detector sees a fault 3 s after its onset and names it 7 s after.
    """
    plan = schedule(scenario, REST_INPUTS, REST_OUTPUTS)
    series = {key: np.zeros(scenario.ticks) for key in SERIES}
    time_s = plan.time_s
    reference_p, reference_sh = plan.reference.T
    bump = np.zeros_like(time_s)
    command = np.full_like(time_s, REST_INPUTS[0])
    for fault in scenario.faults:
        since = time_s - fault.onset_s
        bump += np.where((since > 0) & (since < 20), 1.0 * KPA * np.sin(np.pi * since / 20), 0.0)
        if fault.kind == "compressor_speed":
            command -= np.where(since >= 10, fault.size, 0.0)
    series["reference/evaporator_pressure"], series["reference/superheat"] = reference_p, reference_sh
    series["plant/evaporator_pressure"] = reference_p + bump
    series["plant/superheat"] = reference_sh - 0.5 * bump / KPA
    series["plant/wall_temperature"] = series["measured/wall_temperature"] = np.full_like(time_s, REST_OUTPUTS[2])
    series["plant/condenser_pressure"] = series["measured/condenser_pressure"] = np.full_like(time_s, REST_OUTPUTS[3])
    series["measured/evaporator_pressure"] = series["plant/evaporator_pressure"] + plan.faults[:, 1]
    series["measured/superheat"] = series["plant/superheat"]
    series["controller/command:compressor"] = command
    series["controller/command:expansion_valve"] = np.full_like(time_s, REST_INPUTS[1])
    series["actuator/command:compressor"] = command + plan.faults[:, 0]
    series["actuator/command:expansion_valve"] = series["controller/command:expansion_valve"]
    series |= dict(zip([BY_NAME[topic].series[0] for topic in AIR_SIDE], plan.air.T, strict=True))
    for name in ("air_inlet_temperature", "condenser_air_inlet_temperature"):
        series[f"plant/{name}"] = series[f"measured/{name}"] = series[f"scenario/{name}"]
    lag = 1 - np.exp(-np.maximum(time_s[:, None] - np.array([_onset(scenario, kind) for kind in KINDS]), 0) / 10)
    for i, fault in enumerate(FAULTS):
        series[truth_of(fault.kind)] = plan.faults[:, i].copy()
        series[schedule_of(fault.kind)] = plan.faults[:, i].copy()
        if fault.has_filter:
            series[BY_NAME[fault.residual_topic].series[0]] = plan.faults[:, i] * lag[:, i]
    return Recording(
        time_s=time_s,
        series=series,
        status=[_status(scenario, float(t)) for t in time_s],
        metadata={
            "scenario": scenario.model_dump(mode="json"),
            "mode": "simulate",
            "passive": passive,
            "sample_time_s": scenario.sample_time_s,
            "wall_seconds": 2.0,
            "missed_ticks": 0,
            "complete": True,
        },
    )


def _onset(scenario: Scenario, kind: str) -> float:
    return min((fault.onset_s for fault in scenario.faults if fault.kind == kind), default=1e9)


def _status(scenario: Scenario, time_s: float) -> StatusRow:
    seen = [fault for fault in scenario.faults if time_s >= fault.onset_s + 3.0]
    named = [fault for fault in scenario.faults if time_s >= fault.onset_s + 7.0]
    return StatusRow(
        time_s=time_s,
        detected=bool(seen),
        isolated=named[-1].kind if named else None,
        size=named[-1].size if named else np.nan,
        onset_s=seen[0].onset_s if seen else np.nan,
        isolated_s=named[-1].onset_s + 7.0 if named else np.nan,
        thresholds=(5.0 * RPM, 0.5 * KPA),
    )


@pytest.fixture(scope="session")
def recording_of() -> Callable[..., Recording]:
    """Make the ideal recording of a scenario given as a mapping."""

    def make(passive: bool = False, **content: object) -> Recording:
        return make_recording(check({"name": "made_up", "duration_s": 200.0, **content}), passive)

    return make
