"""Measure figures in sentences of the documentation and write them: ``python -m docs.tools.doc_figures``.

Works in a checkout: it runs `examples/` and writes README.md and `docs/`. Each of `MEASURES` measures a group of
figures; each of `SENTENCES` is the page, the words and the number of digits. A test measures all again and compares
the printed figures. `reference_pages` and `reproduction_page` write whole pages.
"""

import json
import math
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from ac_common.units import KPA, RPM
from ac_experiments.designs import Designs, designs_at
from ac_experiments.metrics import summarise
from ac_experiments.recording import Recording
from ac_experiments.scenario import load
from ac_experiments.simulate import simulate
from ac_plant_node.rest import rest_at
from docs.tools import control_figures

ROOT = Path(__file__).parents[2]
#: What is measured with one command, by the group's name.
Values = dict[str, float]

ACTUATOR, SENSOR, ROAD = "actuator_fault", "sensor_fault", "on_the_road"


_P_E, _SPEED = "plant/evaporator_pressure", "controller/command:compressor"
_SLIPS = "faults=[{kind: compressor_speed, size_rpm: 40, onset_s: 450}]"


def _figures(summary: dict[str, Any]) -> Values:
    """Return the time [s] to isolation of a summary's first fault (nan: not isolated), and the metrics."""
    fault = summary["faults"][0]
    isolated_s = math.nan if fault["isolated_s"] is None else fault["isolated_s"]
    return {"isolated_after_s": isolated_s - fault["onset_s"], **summary["metrics"]}


@cache
def _simulated(scenario: str, passive: bool = False) -> Recording:
    return simulate(load(scenario), passive=passive)


def _reference() -> Values:
    """Measure the paper's two faults, with the compensator and with K0 alone."""
    values: Values = {}
    for scenario in (ACTUATOR, SENSOR):
        for passive in (False, True):
            name = f"{scenario}_{'k0' if passive else 'active'}"
            found = _figures(summarise(_simulated(scenario, passive)))
            values |= {f"{name}_{key}": value for key, value in found.items()}
    return values


def _road() -> Values:
    """Measure the scenario of the README, and with a fault of the compressor in place, against the healthy drive."""
    values: Values = {}
    healthy = simulate(load(ROAD, ["faults=[]"]))
    for name, changed in (("sensor", ()), ("actuator", (_SLIPS,))):
        for who, passive in (("active", False), ("k0", True)):
            scenario = load(ROAD, changed)
            run = simulate(scenario, passive)
            after = run.time_s >= scenario.faults[0].onset_s
            off = {key: (run.series[key] - healthy.series[key])[after] for key in (_P_E, _SPEED)}
            values[f"{name}_{who}_most_kpa"] = float(np.abs(off[_P_E]).max()) / KPA
            values[f"{name}_{who}_end_kpa"] = float(off[_P_E][-200:].mean()) / KPA
            values[f"{name}_{who}_rpm"] = float(off[_SPEED][-200:].mean()) / RPM
            values[f"{name}_{who}_isolated_after_s"] = _figures(summarise(run))["isolated_after_s"]
    return values


def _rest() -> Values:
    """Return inputs and outputs of the medium operating point."""
    rest = rest_at("med")
    return {"rpm": rest["inputs"][0] / RPM, "p_e_kpa": rest["outputs"][0] / KPA, "superheat_k": rest["outputs"][1]}


def _example(name: str) -> Any:
    """Import a module of `examples/`."""
    sys.path.insert(0, str(ROOT / "examples"))
    try:
        return __import__(name)
    finally:
        sys.path.pop(0)


def _with_design(**changed: Any) -> Designs:
    return replace(designs_at("med", 0.1), **changed)


def _own_q() -> Values:
    """Measure `examples/own_q.py` in place of the compensator."""
    designs = _with_design(compensator=_example("own_q").estimate_and_subtract("med", 0.1))
    found = {
        scenario: _figures(summarise(simulate(load(scenario), designs=designs))) for scenario in (ACTUATOR, SENSOR)
    }
    return {f"{scenario}_{key}": value for scenario, values in found.items() for key, value in values.items()}


def _own_filter() -> Values:
    """Measure `examples/own_filter.py` in place of the isolation filter."""
    fdi = _example("own_filter").static_filter("med", 0.1)
    ours = designs_at("med", 0.1).fdi
    run = simulate(load(ACTUATOR), designs=_with_design(fdi=fdi))
    sensor = simulate(load(SENSOR), designs=_with_design(fdi=fdi))
    return {
        **_figures(summarise(run)),
        "residual_rpm": run.series["fdi/residual/compressor_speed:compressor"][-1] / RPM,
        "threshold_rpm": fdi.thresholds[0] / RPM,
        "threshold_kpa": fdi.thresholds[1] / KPA,
        "our_threshold_rpm": ours.thresholds[0] / RPM,
        "our_threshold_kpa": ours.thresholds[1] / KPA,
        "sensor_isolated_after_s": _figures(summarise(sensor))["isolated_after_s"],
    }


def _own_controller() -> Values:
    """Measure `examples/own_controller.py` as a node in the graph, with an earlier fault and a shorter run."""
    command = "run actuator_fault --set faults.0.onset_s=20 --set duration_s=80 --no-report --json --node"
    return _figures(_acftc(*command.split(), f"gimc_controller={sys.executable} examples/own_controller.py"))


def _own_car() -> Values:
    """Measure `examples/own_car.yaml`, calibrated; without ROS, which gives the same figures."""
    command = "calibrate --points examples/own_points.yaml --parameters examples/own_car.yaml --out results/car.yaml"
    then = "--plant results/car.yaml simulate actuator_fault --no-report --json"
    return _figures(_acftc(*command.split(), then=then))


def _own_scenario() -> Values:
    """Measure `examples/own_scenario.yaml`, and the same with a stronger change of the air."""
    path = str(ROOT / "examples" / "own_scenario.yaml")
    run = simulate(load(path))
    faults = summarise(run)["faults"]
    isolated = [fault["isolated_s"] - fault["onset_s"] for fault in faults]
    warmer = "air.inlet_temperature_k.0.to=4"
    strong, of_paper = (summarise(simulate(load(path, [warmer, *more]))) for more in ([], ["design=paper"]))
    found_s = faults[0]["isolated_s"]
    drift = run.series["fault/evaporator_pressure"][run.time_s.searchsorted(found_s)]
    return {
        "drift_after_s": isolated[0],
        "drift_kpa": drift / KPA,
        "slips_within_s": math.ceil(max(isolated[1:])),
        "strong_false_alarms": strong["false_alarms"],
        "strong_false_alarms_of_paper": of_paper["false_alarms"],
    }


def _acftc(*arguments: str, then: str = "") -> Any:
    """Return the JSON that `acftc` prints in a temporary folder with `examples/`; `then`: a second command after it."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "examples").symlink_to(ROOT / "examples")
        for words in (arguments, tuple(then.split())):
            if words:
                done = subprocess.run(
                    [sys.executable, "-m", "bringup.cli", *words],
                    cwd=folder,
                    env={**os.environ, "PYTHONPATH": str(ROOT)},
                    check=True,
                    stdout=subprocess.PIPE,
                )
        return json.loads(done.stdout)


MEASURES: dict[str, Callable[[], Values]] = {
    "run": _reference,
    "road": _road,
    "rest": _rest,
    "own_q": _own_q,
    "own_filter": _own_filter,
    "own_controller": _own_controller,
    "own_car": _own_car,
    "own_scenario": _own_scenario,
    "reached": control_figures.reached,
    "reached_envelope": partial(control_figures.reached, "envelope"),
    "reach": control_figures.reach,
    "steps": control_figures.steps,
    "noise": control_figures.noise,
}

#: Page, and words in which figures stand: {group[name]:format}. Where the page breaks its lines does not matter.
SENTENCES: tuple[tuple[str, str], ...] = (
    (
        "README.md",
        "| 5 kPa too high: isolated after | {road[sensor_active_isolated_after_s]:.1f} s |",
    ),
    (
        "README.md",
        "| ... actual evaporator pressure off at the end | {road[sensor_active_end_kpa]:.1f} kPa"
        " | {road[sensor_k0_end_kpa]:.1f} kPa |",
    ),
    (
        "README.md",
        "| ... and at most | {road[sensor_active_most_kpa]:.1f} kPa | {road[sensor_k0_most_kpa]:.1f} kPa |",
    ),
    (
        "README.md",
        "| 40 rpm too fast: isolated after | {road[actuator_active_isolated_after_s]:.1f} s |",
    ),
    (
        "README.md",
        "| ... command changes by | {road[actuator_active_rpm]:+.1f} rpm | {road[actuator_k0_rpm]:+.1f} rpm |",
    ),
    (
        "README.md",
        "| ... actual evaporator pressure off at most | {road[actuator_active_most_kpa]:.1f} kPa"
        " | {road[actuator_k0_most_kpa]:.1f} kPa |",
    ),
    (
        "docs/tutorial/first-fault.md",
        "({rest[rpm]:.0f} rpm, {rest[p_e_kpa]:.1f} kPa in the evaporator, {rest[superheat_k]:.0f} K of superheat)",
    ),
    (
        "docs/tutorial/first-fault.md",
        "isolated as compressor_speed after {run[actuator_fault_active_isolated_after_s]:.1f} s",
    ),
    (
        "docs/tutorial/first-fault.md",
        "command change {run[actuator_fault_active_command_change_rpm]:.3f} rpm"
        " peak pressure error {run[actuator_fault_active_peak_pressure_error_kpa]:.3f} kPa",
    ),
    (
        "docs/tutorial/first-fault.md",
        "off by {run[actuator_fault_active_peak_pressure_error_kpa]:.2f} kPa at most",
    ),
    (
        "docs/tutorial/first-fault.md",
        "off by {run[actuator_fault_k0_peak_pressure_error_kpa]:.1f} kPa on the way",
    ),
    (
        "docs/tutorial/first-fault.md",
        "the actual pressure moves by {run[sensor_fault_active_peak_pressure_error_kpa]:.1f} kPa",
    ),
    (
        "docs/how-to/own-controller.md",
        "isolated after about {own_controller[isolated_after_s]:.0f} s, as with K0",
    ),
    (
        "docs/how-to/own-controller.md",
        "off by {own_controller[peak_pressure_error_kpa]:.1f} kPa"
        " (K0 alone: {run[actuator_fault_k0_peak_pressure_error_kpa]:.1f} kPa,"
        " with the compensator: {run[actuator_fault_active_peak_pressure_error_kpa]:.1f} kPa)",
    ),
    (
        "docs/how-to/own-controller.md",
        "{own_q[actuator_fault_command_change_rpm]:.1f} rpm at rest, and the pressure off by"
        " {own_q[actuator_fault_peak_pressure_error_kpa]:.1f} kPa at most"
        " (K0 alone: {run[actuator_fault_k0_peak_pressure_error_kpa]:.1f} kPa)."
        " The Q of the synthesis reaches {run[actuator_fault_active_peak_pressure_error_kpa]:.1f} kPa",
    ),
    (
        "docs/how-to/own-controller.md",
        "the actual pressure is off by {own_q[sensor_fault_peak_pressure_error_kpa]:.1f} kPa"
        " ({run[sensor_fault_active_peak_pressure_error_kpa]:.1f} kPa)",
    ),
    ("docs/how-to/own-filter.md", "both are right: {own_filter[residual_rpm]:.1f} rpm"),
    (
        "docs/how-to/own-filter.md",
        "higher: {own_filter[threshold_rpm]:.1f} rpm and {own_filter[threshold_kpa]:.1f} kPa, as the script prints"
        " (ours: {own_filter[our_threshold_rpm]:.1f} rpm and {own_filter[our_threshold_kpa]:.1f} kPa)",
    ),
    (
        "docs/how-to/own-filter.md",
        "isolated after {own_filter[isolated_after_s]:.0f} s instead of"
        " {run[actuator_fault_active_isolated_after_s]:.0f} s",
    ),
    (
        "docs/how-to/own-car.md",
        "isolated after {own_car[isolated_after_s]:.0f} s and the pressure is off by"
        " {own_car[peak_pressure_error_kpa]:.1f} kPa at most",
    ),
    (
        "docs/how-to/own-scenario.md",
        "after {own_scenario[drift_after_s]:.0f} s, when it is {own_scenario[drift_kpa]:.1f} kPa off",
    ),
    ("docs/how-to/own-scenario.md", "each time within {own_scenario[slips_within_s]:.0f} s"),
    *control_figures.SENTENCES,
)

_FIELD = re.compile(r"\{(\w+)\[(\w+)\]:([^}]*)\}")


def groups(sentence: str) -> set[str]:
    """Return the groups of `MEASURES` that a sentence needs."""
    return {group for group, _, _ in _FIELD.findall(sentence)}


def printed(sentence: str, measured: dict[str, Values]) -> list[str]:
    """Return the figures of a sentence in order, formatted."""
    texts = [format(measured[group][name], form) for group, name, form in _FIELD.findall(sentence)]
    return [re.sub(r"^[-+](?=0(\.0*)?$)", "", text) for text in texts]  # no sign before nothing


def stated(sentence: str, text: str) -> re.Match[str]:
    """Find a sentence in the text of a page; the groups of the match are its figures.

    Raises
    ------
    ValueError
        When the page does not have it, or has it twice.
    """
    words = [re.escape(word) for word in re.split(r"\s+", _FIELD.sub("@", sentence))]
    pattern = r"\s+".join(words).replace("@", r"([-+]?\d+(?:\.\d+)?)")
    found = list(re.finditer(pattern, text))
    if len(found) != 1:
        msg = f"{len(found)} times on its page: {sentence}"
        raise ValueError(msg)
    return found[0]


def rewritten(sentence: str, text: str, measured: dict[str, Values]) -> str:
    """Return the text of a page with the measured figures in one sentence."""
    match = stated(sentence, text)
    for number, figure in reversed(list(enumerate(printed(sentence, measured), start=1))):
        text = text[: match.start(number)] + figure + text[match.end(number) :]
    return text


def main() -> None:
    """Measure everything and write all pages."""
    measured = {}
    for name, measure in MEASURES.items():
        print(f"{name} ...", flush=True)
        measured[name] = measure()
    for page, sentence in SENTENCES:
        path = ROOT / page
        old = path.read_text(encoding="utf-8")
        new = rewritten(sentence, old, measured)
        if new != old:
            print(f"{page}: {', '.join(stated(sentence, old).groups())} -> {', '.join(printed(sentence, measured))}")
            path.write_text(new, encoding="utf-8")


if __name__ == "__main__":
    main()
