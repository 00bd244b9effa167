"""The same run without its faults: what it is that a fault changes, whatever the load does meanwhile."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from ac_common.units import KPA, RPM
from ac_experiments.recording import Recording
from ac_experiments.study.cases import Case

#: Accommodation has done what it does so long after the onset, s.
LATE_S = 60.0
Played = Mapping[str, Recording]
"""A run, and that of K0 alone beside it, by what the names of their columns begin with."""


class FaultFree:
    """Runs without their faults, the last of which is kept.

    The runs of one pass through a study's grids share drive and noise, so they share it.

    Parameters
    ----------
    played : callable
        Plays a case, with K0 alone beside it or not.
    """

    def __init__(self, played: Callable[[Case, bool], Played]) -> None:
        self._played = played
        self._kept: dict[tuple[str, bytes, bool], Played] = {}

    def __call__(self, case: Case, k0_alone: bool) -> Played:
        """Return a case as it is without its faults; raises what playing it raises."""
        plain = replace(case, scenario=case.scenario.model_copy(update={"faults": [], "name": "fault_free"}))
        plant = b"" if case.parameters is None else case.parameters.array.tobytes()
        key = plain.scenario.model_dump_json(exclude={"description"}), plant, k0_alone
        if key not in self._kept:
            self._kept = {key: self._played(plain, k0_alone)}
        return self._kept[key]


def changes(run: Recording, fault_free: Recording, onset_s: float) -> dict[str, float]:
    """Return what a fault changes, in the columns of `results.CHANGES`."""
    since, late = run.time_s >= onset_s, run.time_s >= onset_s + LATE_S

    def off(key: str) -> np.ndarray:
        return np.asarray(run.series[key] - fault_free.series[key])

    pressure, superheat = off("plant/evaporator_pressure") / KPA, off("plant/superheat")
    speed = off("controller/command:compressor") / RPM
    error = fault_free.series["plant/evaporator_pressure"] - fault_free.series["reference/evaporator_pressure"]
    found = {
        "change_pressure_kpa": float(np.abs(pressure[since]).max()),
        "fault_free_peak_pressure_error_kpa": float(np.abs(error[since]).max()) / KPA,
    }
    if late.any():
        found |= {
            "late_change_pressure_kpa": float(np.abs(pressure[late]).max()),
            "late_change_superheat_k": float(np.abs(superheat[late]).max()),
            "late_change_speed_rpm": float(speed[late].mean()),
        }
    return found
