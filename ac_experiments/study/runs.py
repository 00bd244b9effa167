"""One run of a study: played, with K0 alone and without its faults beside it, and put into a row of figures."""

import math
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from ac_common.cache import fingerprint, source_fingerprint
from ac_common.errors import UserError
from ac_common.fdi_status import StatusRow
from ac_common.topics import BY_NAME
from ac_common.units import KPA
from ac_experiments.energy import car_figures, energies_j
from ac_experiments.metrics import summarise
from ac_experiments.recording import Recording
from ac_experiments.scenario_schema import Scenario
from ac_experiments.study.cases import Case
from ac_experiments.study.fault_free import FaultFree, Played, changes
from ac_experiments.study.outcomes import alarms_before, outcome, peaks, right_name
from ac_experiments.study.schema import NO_FAULT

#: What decides the numbers of a run.
_PACKAGES = (
    *("ac_common", "ac_design", "ac_experiments", "ac_plant_node", "fault_injector_node", "fdi_node"),
    *("gimc", "gimc_controller_node"),
)
Row = dict[str, Any]


@cache
def made_with() -> str:
    """Return a hash of the plant and of the code that decide the numbers of a run."""
    from ac_plant_node import parameters_fingerprint

    return fingerprint({"plant": parameters_fingerprint(), "code": source_fingerprint(*_PACKAGES)})


@cache
def _designs(key: str) -> Any:
    """Return the designs of a scenario by its shortest form, read once a process."""
    from ac_experiments.designs import designs_of

    return designs_of(Scenario.model_validate_json(key))


def designs_for(scenario: Scenario) -> Any:
    """Return the designs of a scenario, those for the plant in use, whatever plant it is run with."""
    sensors = ("sensors", "superheat_sensor", "air_flow_sensor")
    keys = ("operating_point", "sample_time_s", *sensors, "design", "controller")
    content = {key: getattr(scenario, key) for key in keys}
    car = {"compressor_drive": "belt"} if scenario.has_belt else None
    plain = Scenario.model_validate({"name": "designs", "duration_s": 1.0, "car": car, "passive": True, **content})
    return _designs(plain.model_dump_json())


def play(case: Case, passive: bool | None = None, diagnose: bool = True) -> Recording:
    """Run a case in this process, as `ac_experiments.simulate.simulate` does.

    Raises
    ------
    RunError
        When the plant leaves the domain of its model.
    """
    from ac_experiments.simulate import simulate
    from ac_plant_node.parameters.file import another_plant

    designs = designs_for(case.scenario)
    with another_plant(case.parameters):
        return simulate(case.scenario, passive, designs=designs, diagnose=diagnose)


def k0_alone_of(case: Case, recording: Recording) -> Recording:
    """Return a case with K0 alone, without what a detector makes; raises as `play`.

    A run in which no q comes to K0 is that already, to the last bit: only others are played.
    """
    is_alone = not any(recording.series[key].any() for key in BY_NAME["compensator/q"].series)
    return recording if is_alone else play(case, passive=True, diagnose=False)


def played(case: Case, k0_alone: bool) -> Played:
    """Return a case as it is, and with K0 alone when that is asked for, by what their columns begin with."""
    recording = play(case)
    return {"": recording, **({"k0_": k0_alone_of(case, recording)} if k0_alone else {})}


_fault_free = FaultFree(played)


def row_of(case: Case, k0_alone: bool, fault_free: bool = False) -> Row:
    """Play a case, and return its row: what was drawn, what was run, what came of it.

    Parameters
    ----------
    case : Case
    k0_alone, fault_free : bool
        Whether K0 alone plays it, too, and whether it is played without its faults, too.
    """
    onset_s = _onset_s(case)
    try:
        plain = _fault_free(case, k0_alone) if fault_free else None
        runs = played(case, k0_alone) if case.scenario.faults or plain is None else plain
    except UserError as problem:  # the scenario has been checked: it is the run that fails
        return {**_about(case), "outcome": outcome((), 0, str(problem)), "problem": str(problem)}
    row = {**_about(case), **figures(runs[""], hold_s(designs_for(case.scenario).fdi))}
    for prefix, recording in runs.items():
        found = _control(recording, onset_s) if prefix else {}
        if plain is not None and case.scenario.faults:
            found |= changes(recording, plain[prefix], onset_s)
        row |= {f"{prefix}{key}": value for key, value in found.items()}
    return row


def _about(case: Case) -> Row:
    """Return what is run."""
    scenario, row = case.scenario, dict(case.drawn)
    faults = sorted(scenario.faults, key=lambda fault: fault.onset_s)
    return {
        **{f"drawn.{key}": value for key, value in row.items()},
        "run": case.run,
        "drive": case.drive,
        "operating_point": scenario.operating_point,
        "duration_s": scenario.duration_s,
        "fault_kind": faults[0].fault.kind if faults else NO_FAULT,
        "fault_size": faults[0].size / faults[0].fault.si if faults else None,
        "fault_onset_s": faults[0].onset_s if faults else None,
        "problem": "",
    }


def _onset_s(case: Case) -> float:
    return min((fault.onset_s for fault in case.scenario.faults), default=math.inf)


def hold_s(design: Any) -> float:
    """Return for how long a residual must be above its threshold before a design's detector says that there is a fault.

    The decision of the whole envelope detects by likelihoods, too; this is about its thresholds alone.
    """
    if hasattr(design, "supervision"):
        return float(design.supervision.confirm_s)
    from fdi_node.envelope.limits import Limits

    return Limits(*design.limits.tolist()).wander_s


def figures(recording: Recording, hold: float) -> Row:
    """Return what came of a run, in the columns of `results.FIGURES`."""
    summary = summarise(recording)
    faults = summary["faults"]
    first: Mapping[str, Any] = faults[0] if faults else {}
    onset_s = first.get("onset_s", math.inf)
    before = alarms_before(recording, onset_s)
    fault_free, faulty = peaks(recording, onset_s, hold)
    seconds = len(recording.time_s) * summary["sample_time_s"]
    return {
        "outcome": outcome(faults, before, ""),
        "false_alarms": before,
        "fault_free_s": min(onset_s, seconds),
        "detection_delay_s": _since(first.get("detected_s"), onset_s),
        "isolation_delay_s": _since(first.get("isolated_s"), onset_s),
        "isolated_as": first.get("isolated_as"),
        "wrong_name_s": _wrongly_named_s(recording.status, first.get("kind"), onset_s) * summary["sample_time_s"],
        "estimate": first.get("estimate"),
        "peak_fault_free": fault_free,
        "peak_faulty": faulty,
        **_control(recording, onset_s),
    }


def _since(time_s: float | None, onset_s: float) -> float | None:
    return None if time_s is None else time_s - onset_s


def _wrongly_named_s(status: list[StatusRow], kind: str | None, onset_s: float) -> int:
    """Count the ticks in which a name is isolated that is not that of the fault."""
    right = None if kind is None else right_name(kind)
    return sum(row.isolated not in (None, right) for row in status if kind is None or row.time_s >= onset_s)


def _control(recording: Recording, onset_s: float) -> Row:
    """Return how well the loop is controlled from the fault's onset on, or without one in the whole run."""
    series, time_s = recording.series, recording.time_s
    step_s = float(recording.metadata["sample_time_s"])
    since = time_s >= (onset_s if math.isfinite(onset_s) else 0.0)
    pressure = np.abs(series["plant/evaporator_pressure"] - series["reference/evaporator_pressure"])[since] / KPA
    superheat = np.abs(series["plant/superheat"] - series["reference/superheat"])[since]
    joules = energies_j(recording)
    row: Row = {
        "iae_pressure_kpa_s": float(pressure.sum()) * step_s,
        "iae_superheat_k_s": float(superheat.sum()) * step_s,
        "peak_pressure_error_kpa": float(pressure.max()),
        "peak_superheat_error_k": float(superheat.max()),
        "least_superheat_k": float(series["plant/superheat"][since].min()),
    }
    if joules:
        seconds = len(time_s) * step_s
        row |= {
            "compressor_kj": joules["compressor"] / 1e3,
            "cooling_kj": joules["cooling"] / 1e3,
            "load_kw": joules["cooling"] / 1e3 / seconds,
        }
    car = car_figures(recording)
    return row if car is None else {**row, "cabin_c": car.cabin_c}
