"""Figures of docs/control.md that come from whole runs; `docs.tools.doc_figures` writes them into the page."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ac_common.units import KPA, RPM
from ac_experiments.designs import designs_at
from ac_experiments.metrics import summarise
from ac_experiments.recording import Recording
from ac_experiments.scenario import load
from ac_experiments.simulate import simulate

PAGE = "docs/control.md"
POINTS = ("low", "med", "high")

NOISE = ("noise.evaporator_pressure_kpa=0.2", "noise.superheat_k=0.1", "noise.wall_temperature_k=0.05")
"""Noise of the section "Noise"."""

STEP_AT_S = 10.0


@cache
def _run(scenario: str, point: str, overrides: Sequence[str] = (), passive: bool = False) -> Recording:
    return simulate(load(scenario, [f"operating_point={point}", *overrides]), passive=passive)


def _off(run: Recording, quantity: str) -> NDArray[np.float64]:
    """Return the deviation of the actual quantity from its reference."""
    return np.abs(run.series[f"plant/{quantity}"] - run.series[f"reference/{quantity}"])


def reached(design: str = "paper") -> dict[str, float]:
    """Measure the faults at every point, noise-free."""
    values: dict[str, float] = {}
    given = (f"design={design}",)
    for point in POINTS:
        for name, scenario in (("e5", "actuator_fault"), ("e6", "sensor_fault"), ("derived", "sensor_fault_derived")):
            summary = summarise(_run(scenario, point, given))
            fault = summary["faults"][0]
            values[f"{point}_{name}_command_rpm"] = summary["metrics"]["command_change_rpm"]
            values[f"{point}_{name}_peak_kpa"] = summary["metrics"]["peak_pressure_error_kpa"]
            values[f"{point}_{name}_isolated_s"] = fault["isolated_s"] - fault["onset_s"]
        both = _run("both_faults", point, given)
        first, second = (fault["peak_pressure_error_kpa"] for fault in summarise(both)["faults"])
        values |= {f"{point}_both_first_kpa": first, f"{point}_both_second_kpa": second}
        values[f"{point}_both_superheat_k"] = float(_off(both, "superheat").max())
    return values


def steps() -> dict[str, float]:
    """Measure p_e's deviation after a step of the superheat's reference by 5 K, with and without compensator."""
    values = {}
    for point in POINTS:
        for direction, kelvin in (("up", 5.0), ("down", -5.0)):
            for who, passive in (("whole", False), ("k0", True)):
                run = _run("nominal", point, (_step_by(kelvin), "duration_s=410"), passive)
                values[f"{point}_{direction}_{who}_kpa"] = float(_off(run, "evaporator_pressure").max()) / KPA
    low = designs_at("low", 0.1)
    unscaled = replace(low, compensator=replace(low.compensator, reference_rest=np.empty(0)))
    scenario = load("nominal", ["operating_point=low", _step_by(5.0), "duration_s=410"])
    off = _off(simulate(scenario, designs=unscaled), "evaporator_pressure")
    return {**values, "low_up_unscaled_kpa": float(off.max()) / KPA}


def _step_by(kelvin: float) -> str:
    return f"references.superheat_k=[{{at_s: {STEP_AT_S:g}, to: {kelvin:g}}}]"


def reach() -> dict[str, float]:
    """Return the factor on q where the references lead furthest from a point."""
    excess = {point: designs_at(point, 0.1).compensator.reach_excess for point in POINTS}
    at = {"low_k": ("low", 1, 3), "low_kpa": ("low", 0, 4), "med_k": ("med", 1, 4), "med_kpa": ("med", 0, 4)}
    at |= {"high_kpa": ("high", 0, 4)}
    return {name: 1.0 / float(excess[point][row, column]) for name, (point, row, column) in at.items()}


def noise() -> dict[str, float]:
    """Measure the effect of noise at rest, in ten minutes: on the commands, and on the residuals with the guard."""
    values = {}
    for point in POINTS:
        for who, passive in (("guard", False), ("k0", True)):
            series = _run("nominal", point, NOISE, passive).series
            values[f"{point}_{who}_speed_rpm"] = float(series["controller/command:compressor"].std()) / RPM
            values[f"{point}_{who}_valve_percent"] = 100.0 * float(series["controller/command:expansion_valve"].std())
        series = _run("nominal", point, NOISE).series
        values[f"{point}_r_n_rpm"] = float(series["fdi/residual/compressor_speed:compressor"].mean()) / RPM
        values[f"{point}_r_p_kpa"] = float(series["fdi/residual/evaporator_pressure"].mean()) / KPA
    return values


def _row(label: str, group: str, name: str, digits: int) -> tuple[str, str]:
    """Return a row of a table, with a column for each point."""
    cells = " | ".join(f"{{{group}[{point}_{name}]:.{digits}f}}" for point in POINTS)
    return PAGE, f"| {label} | {cells} |"


#: Rows of the tables of what is reached: label, name of the figure, digits.
_REACHED = (
    ("E5 command at rest, rpm", "e5_command_rpm", 2),
    ("E5 peak of p_e, kPa", "e5_peak_kpa", 2),
    ("E5 isolated after, s", "e5_isolated_s", 1),
    ("E6 command at rest, rpm", "e6_command_rpm", 2),
    ("E6 peak of actual p_e, kPa", "e6_peak_kpa", 2),
    ("E6 isolated after, s", "e6_isolated_s", 1),
    ("E6, derived superheat: command, rpm", "derived_command_rpm", 2),
    ("E6, derived superheat: peak of p_e, kPa", "derived_peak_kpa", 2),
    ("both faults: peak of p_e after the first, kPa", "both_first_kpa", 2),
    ("both faults: peak of p_e after the second, kPa", "both_second_kpa", 2),
    ("both faults: largest error of SH, K", "both_superheat_k", 2),
)
SENTENCES = (
    (
        PAGE,
        "at the low point by {reach[low_k]:.2f} at +5 K and {reach[low_kpa]:.2f} at +40 kPa, at the medium one by"
        " {reach[med_k]:.2f} at +10 K and {reach[med_kpa]:.2f} at +40 kPa, at the high one by {reach[high_kpa]:.2f} at"
        " +40 kPa",
    ),
    (PAGE, "all of q would move p_e by {steps[low_up_unscaled_kpa]:.1f} kPa, and leave by its bounds"),
    *(_row(label, "reached", name, digits) for label, name, digits in _REACHED),
    *(_row(f"envelope: {label}", "reached_envelope", name, digits) for label, name, digits in _REACHED),
    _row("compressor, K0 alone, rpm rms", "noise", "k0_speed_rpm", 1),
    _row("compressor, with the guard, rpm rms", "noise", "guard_speed_rpm", 1),
    _row("valve, K0 alone, % rms", "noise", "k0_valve_percent", 2),
    _row("valve, with the guard, % rms", "noise", "guard_valve_percent", 2),
    _row("r_N, mean with the guard, rpm", "noise", "r_n_rpm", 2),
    _row("r_p, mean with the guard, kPa", "noise", "r_p_kpa", 2),
    _row("up, with the compensator, kPa", "steps", "up_whole_kpa", 1),
    _row("up, K0 alone, kPa", "steps", "up_k0_kpa", 1),
    _row("down, with the compensator, kPa", "steps", "down_whole_kpa", 1),
    _row("down, K0 alone, kPa", "steps", "down_k0_kpa", 1),
)
