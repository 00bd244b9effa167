"""What a run amounts to, in the numbers of `summary.json`: the same function for a bag and for a simulation."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ac_common.errors import UserError
from ac_common.fault_profiles import STUCK
from ac_common.faults import BY_KIND, KINDS, UNKNOWN, in_unit
from ac_common.fdi_status import StatusRow
from ac_common.files import write_whole
from ac_common.topics import schedule_of, truth_of
from ac_common.units import KPA, RPM
from ac_experiments.decisions import Spell, spells_of, sure_from, with_lengths
from ac_experiments.energy import car_figures, energies_j
from ac_experiments.recording import Recording

#: "At rest" and "just before" are averages over this long, s.
WINDOW_S = 20.0
#: A detection this long after a fault has gone away still belongs to it, s.
GRACE_S = 60.0
#: The actual p_e is back when it stays this near to its reference, kPa (0.1 % of p_e at the medium point), and so many
#: standard deviations of what it did just before the fault: with noise it is never quieter than that.
SETTLED_KPA, SETTLED_DEVIATIONS = 0.25, 4.0


@dataclass(frozen=True)
class InjectedFault:
    """One fault of a run: `size` in SI, `end_s` nan when it stayed; with `is_stuck` the size is the largest."""

    kind: str
    onset_s: float
    end_s: float
    size: float
    is_stuck: bool = False


def summarise(recording: Recording) -> dict[str, Any]:
    """Return the key figures of a run.

    Returns
    -------
    dict
        Ready for JSON (what could not be computed is None):

        ``scenario``, ``mode``, ``passive``, ``ticks``, ``sample_time_s``, ``wall_seconds``, ``real_time_factor``
        (simulated over wall time), ``missed_ticks``, ``overruns`` (by node: ticks whose own work took longer than a
        sample time; nodes with none are left out), ``complete`` (False for a recording cut short).

        ``faults``: a list in order of onset, each with ``kind``, ``onset_s``, ``end_s`` (None: it stayed), ``size``,
        ``unit`` (of `size`: rpm, kPa, K), ``stuck`` (True of a reading that stood still: `size` is the most that it was
        off by), ``detected_s`` (first detection after the onset), ``isolated_s``, ``isolated_as`` (the first fault
        named after the onset, or "unknown"), ``sure_s`` (from when on that name was sure, and so to be acted on; None:
        never), ``estimate`` (the detector's size in its unit, averaged over the last 20 s of its isolation); and, until
        the next fault, of the *actual* p_e minus its reference: ``peak_pressure_error_kpa``, the largest magnitude, and
        ``settled_s``, from when on it stays within ``settled_within_kpa`` (the onset itself when it never leaves that;
        None when it does not come back): `SETTLED_KPA` and, with noise, `SETTLED_DEVIATIONS` of the 20 s before.

        ``false_alarms``: detections that begin while no fault is present nor was within the last 60 s, plus isolations
        that name a fault that is not there although another one is ("unknown" is right for one that no filter is for).
        ``false_alarm_list``: each of them with ``time_s``, ``kind`` (what was named, None: nothing) and ``length_s``
        (None: to the end).

        ``detections``, ``isolations``: all of them, right and wrong, likewise. What was named has ``sure_s``, too.

        ``restarts``: of nodes that had died, each with ``node``, ``died_s``, ``back_s`` (None: not within the run),
        ``reason``. ``events``: what nodes announced (a missing input, a protection that acts, and the end of it), each
        with ``time_s``, ``node``, ``what``, ``length_s`` (until the node's next one; None: to the end, or the end of
        another one).

        ``metrics``:

        - ``command_change_rpm``: compressor speed commanded, mean of the last 20 s of the run minus mean of the 20 s
          before the last fault's onset (without a fault: minus mean of the first 20 s).
        - ``peak_pressure_error_kpa``: largest magnitude of *actual* p_e minus its reference from the first fault's
          onset on (without a fault: over the whole run). Also ``peak_superheat_error_k``.
        - ``steady_pressure_error_kpa``: the same difference, with its sign, averaged over the last 20 s. Also
          ``steady_superheat_error_k``.

        Where the plant tells its performance, ``energy_kj`` (``compressor`` work, ``cooling``, ``latent_cooling``) and
        ``cop``, the cooling over the work; in a car ``cabin_temperature_c`` and ``vent_temperature_c`` at the end,
        ``cabin_cooled_s`` (when the air of the cabin was first below 27 degC; None: never) and ``distance_km``.

    Raises
    ------
    UserError
        When the recording holds no tick.
    """
    time_s, about = recording.time_s, recording.metadata
    if len(time_s) == 0:
        msg = "the recording holds no tick"
        raise UserError(msg)
    sample_time_s = float(about["sample_time_s"])
    wall_seconds = about.get("wall_seconds")
    spells = spells_of(recording.status)
    alarms = false_alarms(injected_faults(recording), spells)
    return {
        "scenario": about["scenario"]["name"],
        "mode": about["mode"],
        "passive": bool(about["passive"]),
        "ticks": len(time_s),
        "sample_time_s": sample_time_s,
        "wall_seconds": wall_seconds,
        "real_time_factor": len(time_s) * sample_time_s / wall_seconds if wall_seconds else None,
        "missed_ticks": int(about.get("missed_ticks") or 0),
        "overruns": {node: count for node, count in about.get("overruns", {}).items() if count},
        "complete": bool(about.get("complete", True)),
        "faults": fault_summaries(recording),
        "false_alarms": len(alarms),
        "false_alarm_list": _told(alarms),
        "detections": _told([spell for spell in spells if spell.kind is None]),
        "isolations": _told([spell for spell in spells if spell.kind is not None]),
        "restarts": [_with_numbers(restart) for restart in about.get("restarts", [])],
        "events": with_lengths(about.get("events", [])),
        "metrics": _metrics(recording),
        **_energy(recording),
    }


def _energy(recording: Recording) -> dict[str, Any]:
    """Return what `summarise` tells of energy and, in a car, of its cabin; nothing where nobody has told it."""
    joules, car = energies_j(recording), car_figures(recording)
    told: dict[str, Any] = {}
    if joules:
        work = joules["compressor"]
        told["energy_kj"] = {name: joule / 1e3 for name, joule in joules.items()}
        told["cop"] = joules["cooling"] / work if work > 0.0 else None
    if car is not None:
        told["cabin_temperature_c"], told["vent_temperature_c"] = _number(car.cabin_c), _number(car.vent_c)
        told["cabin_cooled_s"], told["distance_km"] = _number(car.comfort_s), car.distance_m / 1e3
    return told


def _metrics(recording: Recording) -> dict[str, float | None]:
    """Return the entry ``metrics`` of `summarise`."""
    time_s, series = recording.time_s, recording.series
    onsets = [fault.onset_s for fault in injected_faults(recording)]
    first_onset_s = min(onsets, default=float(time_s[0]))
    last_onset_s = max(onsets, default=float(time_s[0]) + WINDOW_S)
    after = time_s >= first_onset_s
    at_rest = time_s > time_s[-1] - WINDOW_S
    before = (time_s >= last_onset_s - WINDOW_S) & (time_s < last_onset_s)
    if not before.any():
        before = time_s == time_s[0]
    command_rpm = series["controller/command:compressor"] / RPM
    pressure_error_kpa = (series["plant/evaporator_pressure"] - series["reference/evaporator_pressure"]) / KPA
    superheat_error_k = series["plant/superheat"] - series["reference/superheat"]
    return {
        "command_change_rpm": _number(_mean(command_rpm[at_rest]) - _mean(command_rpm[before])),
        "peak_pressure_error_kpa": _number(_peak(pressure_error_kpa[after])),
        "steady_pressure_error_kpa": _number(_mean(pressure_error_kpa[at_rest])),
        "peak_superheat_error_k": _number(_peak(superheat_error_k[after])),
        "steady_superheat_error_k": _number(_mean(superheat_error_k[at_rest])),
    }


def _with_numbers(row: dict[str, Any]) -> dict[str, Any]:
    """Return what JSON can hold: None in place of nan."""
    return {key: None if isinstance(value, float) and math.isnan(value) else value for key, value in row.items()}


def write_summary(summary: dict[str, Any], path: Path) -> None:
    """Write `summary` as JSON, readable and strict (no NaN)."""
    write_whole(path, json.dumps(summary, indent=2, allow_nan=False) + "\n")


def injected_faults(recording: Recording) -> list[InjectedFault]:
    """Return the faults that were really injected, in order of onset.

    Those of the scenario when they explain the recorded truth; what was injected live besides is read off the truth
    itself: from where it leaves zero until it is back there for longer than the grace time.
    """
    found = []
    for kind in KINDS:
        truth, planned = _size_of(recording, truth_of(kind)), _size_of(recording, schedule_of(kind))
        stuck = _size_of(recording, schedule_of(f"{kind}_stuck")) > 0.0
        if np.array_equal(truth[~stuck], planned[~stuck]):
            found += _scheduled(recording, kind, truth)
        else:
            time_s = recording.time_s
            found += [_read_off(kind, time_s, truth, start, stop) for start, stop in _episodes(time_s, truth != 0.0)]
    return sorted(found, key=lambda fault: fault.onset_s)


def _size_of(recording: Recording, key: str) -> NDArray[np.float64]:
    """Return a fault over time; zero where nothing says it, as in a recording that is older than the kind."""
    return np.nan_to_num(recording.series.get(key, np.zeros(len(recording.time_s))), posinf=0.0, neginf=0.0)


def fault_summaries(recording: Recording) -> list[dict[str, Any]]:
    """List what came of each fault: the entry ``faults`` of `summarise`."""
    faults, spells = injected_faults(recording), spells_of(recording.status)
    return [_fault_summary(recording, faults, number, spells) for number in range(len(faults))]


def false_alarms(faults: Sequence[InjectedFault], spells: Sequence[Spell]) -> list[Spell]:
    """Return detections without a fault, and isolations that name the wrong one; see `summarise`.

    The kind of a detection without a fault is what was named first meanwhile, None: nothing.
    """

    def present(time_s: float, named: str | None = None) -> bool:
        return any(
            fault.onset_s <= time_s and not time_s > fault.end_s + GRACE_S
            for fault in faults
            if named is None or fault.kind == named or (named == UNKNOWN and not BY_KIND[fault.kind].has_filter)
        )

    named = [spell for spell in spells if spell.kind is not None]
    alarms, wrong = [], [spell for spell in spells if spell.kind is None and not present(spell.start_s)]
    for detection in wrong:
        first = next((spell for spell in named if detection.holds_at(spell.start_s)), detection)
        alarms.append(replace(detection, kind=first.kind, sure_s=first.sure_s))
    apart = [spell for spell in named if not any(detection.holds_at(spell.start_s) for detection in wrong)]
    alarms += [spell for spell in apart if not present(spell.start_s, spell.kind)]
    return sorted(alarms, key=lambda spell: spell.start_s)


def _told(spells: Sequence[Spell]) -> list[dict[str, Any]]:
    return [
        {
            "time_s": spell.start_s,
            "kind": spell.kind,
            "length_s": _number(spell.length_s),
            **({} if spell.kind is None else {"sure_s": _number(spell.sure_s)}),
        }
        for spell in spells
    ]


def _scheduled(recording: Recording, kind: str, truth: NDArray[np.float64]) -> list[InjectedFault]:
    """Return the faults of one kind of the scenario whose onset lies within what was recorded."""
    found, registered, time_s = [], BY_KIND[kind], recording.time_s
    for fault in recording.metadata["scenario"].get("faults", []):
        if fault["kind"] != kind or fault["onset_s"] > time_s[-1]:
            continue
        end_s = math.nan if fault.get("end_s") is None else float(fault["end_s"])
        size = float(fault.get(registered.size_key, registered.default)) * registered.si
        is_stuck = fault.get("profile") == STUCK
        if is_stuck:
            there = truth[(time_s >= fault["onset_s"]) & ~(time_s >= end_s)]
            size = float(there[np.argmax(np.abs(there))])
        found.append(InjectedFault(kind, float(fault["onset_s"]), end_s, size, is_stuck))
    return found


def _read_off(
    kind: str, time_s: NDArray[np.float64], truth: NDArray[np.float64], start: int, stop: int
) -> InjectedFault:
    """Return the fault between two ticks; its size is the value of largest magnitude."""
    values = truth[start:stop]
    return InjectedFault(
        kind=kind,
        onset_s=float(time_s[start]),
        end_s=math.nan if stop == len(truth) else float(time_s[stop]),
        size=float(values[np.argmax(np.abs(values))]),
    )


def _episodes(time_s: NDArray[np.float64], holds: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the half-open index ranges where `holds`, those closer together than the grace time taken as one."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(np.int8)))
    ranges: list[tuple[int, int]] = []
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if ranges and time_s[start] - time_s[ranges[-1][1]] < GRACE_S:
            ranges[-1] = (ranges[-1][0], stop)
        else:
            ranges.append((start, stop))
    return ranges


def _fault_summary(
    recording: Recording, faults: list[InjectedFault], number: int, spells: Sequence[Spell]
) -> dict[str, Any]:
    """Return one entry of ``faults``: what was injected, and what the detector made of it before the next one."""
    fault = faults[number]
    until_s = faults[number + 1].onset_s if number + 1 < len(faults) else math.inf
    before = [row for row in recording.status if row.time_s < fault.onset_s]
    rows = [row for row in recording.status if fault.onset_s <= row.time_s < until_s]
    was_detected = bool(before) and before[-1].detected
    was_isolated = before[-1].isolated if before else None

    isolation = next((row for row in rows if row.isolated is not None and row.isolated != was_isolated), None)
    # While an earlier fault is still detected, a new one shows first when it is named.
    detection = isolation if was_detected else next((row for row in rows if row.detected), None)
    within_kpa = _usual_error_kpa(recording, fault.onset_s)
    peak_kpa, settled_s = _pressure_error(recording, fault.onset_s, until_s, within_kpa)
    return {
        "kind": fault.kind,
        "onset_s": fault.onset_s,
        "end_s": _number(fault.end_s),
        "size": in_unit(fault.kind, fault.size),
        "unit": BY_KIND[fault.kind].unit,
        "stuck": fault.is_stuck,
        "detected_s": detection.time_s if detection else None,
        "isolated_s": isolation.time_s if isolation else None,
        "isolated_as": isolation.isolated if isolation else None,
        "sure_s": _number(sure_from(spells, isolation.isolated, isolation.time_s)) if isolation else None,
        "estimate": _estimate(rows, isolation),
        "peak_pressure_error_kpa": peak_kpa,
        "settled_s": settled_s,
        "settled_within_kpa": within_kpa,
    }


def _usual_error_kpa(recording: Recording, onset_s: float) -> float:
    """Return how far the actual p_e may be from its reference and count as back there."""
    series, time_s = recording.series, recording.time_s
    before = (time_s >= onset_s - WINDOW_S) & (time_s < onset_s)
    error = (series["plant/evaporator_pressure"] - series["reference/evaporator_pressure"])[before] / KPA
    error = error[np.isfinite(error)]
    return SETTLED_KPA + (SETTLED_DEVIATIONS * float(error.std()) if len(error) else 0.0)


def _pressure_error(
    recording: Recording, start_s: float, stop_s: float, within_kpa: float
) -> tuple[float | None, float | None]:
    """Return the peak of the actual p_e off its reference, kPa, and from when on it is within a band for good."""
    series, time_s = recording.series, recording.time_s
    inside = (time_s >= start_s) & (time_s < stop_s)
    error_kpa = np.abs(series["plant/evaporator_pressure"] - series["reference/evaporator_pressure"])[inside] / KPA
    known = np.isfinite(error_kpa)
    error_kpa, time_s = error_kpa[known], time_s[inside][known]
    if not len(error_kpa):
        return None, None
    off = np.flatnonzero(error_kpa > within_kpa)
    if not len(off):
        settled_s: float | None = start_s
    elif off[-1] + 1 < len(time_s):
        settled_s = float(time_s[off[-1] + 1])
    else:
        settled_s = None
    return float(error_kpa.max()), settled_s


def _estimate(rows: list[StatusRow], isolation: StatusRow | None) -> float | None:
    """Return the detector's size in that fault's unit, averaged over the last 20 s in which it was isolated."""
    if isolation is None or isolation.isolated is None:
        return None
    named = [row for row in rows if row.isolated == isolation.isolated and row.time_s >= isolation.time_s]
    last = [row.size for row in named if row.time_s > named[-1].time_s - WINDOW_S]
    return _number(in_unit(isolation.isolated, _mean(np.array(last))))


def _mean(values: NDArray[np.float64]) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if len(finite) else math.nan


def _peak(values: NDArray[np.float64]) -> float:
    finite = values[np.isfinite(values)]
    return float(np.abs(finite).max()) if len(finite) else math.nan


def _number(value: float) -> float | None:
    """Return `value`, or None where there is none: JSON knows no NaN."""
    return value if math.isfinite(value) else None
