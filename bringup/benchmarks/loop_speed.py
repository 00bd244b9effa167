"""How long 1000 s of the closed loop take in one process, beside the plant alone that gets the same inputs.

``python -m bringup.benchmarks.loop_speed`` prints both, with the designs of the operating point and with those of the
whole envelope, without noise and with it.
"""

import time

import numpy as np
from numpy.typing import NDArray

from ac_common.blas_threads import one_blas_thread
from ac_experiments.designs import designs_of
from ac_experiments.recording import Recording
from ac_experiments.scenario import load
from ac_experiments.scenario_schema import Scenario
from ac_experiments.simulate import simulate
from ac_plant_node import Plant

SCENARIO = "both_faults"
NOISE = "noise={evaporator_pressure_kpa: 0.2, superheat_k: 0.1, wall_temperature_k: 0.05}"
DESIGNS = ("paper", "envelope")
LIMIT_S = 0.5
"""Of the paper's loop without noise."""
LIMIT_RATIO = 2.5
"""Of a loop with noise over the plant alone."""


def standing(noise: bool, design: str = DESIGNS[0]) -> Scenario:
    """Return a scenario of 1000 s: a manoeuvre, then both faults; with noise the commands jump at every tick."""
    return load(SCENARIO, ["duration_s=1000", f"design={design}", *([NOISE] if noise else [])])


def loop_seconds(noise: bool, repeats: int = 5, design: str = DESIGNS[0]) -> tuple[float, float]:
    """Return the seconds for 1000 s at 10 Hz with manoeuvre, faults and accommodation, and those of the plant alone.

    Processor time of this process (one thread), the least of `repeats`, loop and plant in turn, after a warm-up.
    """
    scenario = standing(noise, design)
    designs = designs_of(scenario)
    run = simulate(scenario, designs=designs)
    loop, plant = [], []
    for _ in range(repeats):
        started = time.process_time()
        simulate(scenario, designs=designs)
        loop.append(time.process_time() - started)
        plant.append(plant_seconds(run, scenario.operating_point))
    return min(loop), min(plant)


def plant_inputs(run: Recording) -> NDArray[np.float64]:
    """Return what the plant got in a run: one row of four a tick."""
    keys = ("actuator/command:compressor", "actuator/command:expansion_valve", "scenario/air:evaporator_air")
    return np.column_stack([run.series[key] for key in (*keys, "scenario/air_inlet_temperature")])


def plant_seconds(run: Recording, point: str) -> float:
    """Return the seconds that the plant takes for the inputs of a run."""
    inputs, plant, sample_time_s = plant_inputs(run), Plant.at(point), run.metadata["sample_time_s"]
    started = time.process_time()
    for held in inputs:
        plant.step(held, sample_time_s)
    return time.process_time() - started


def main() -> None:
    """Print the figures."""
    one_blas_thread()
    for design in DESIGNS:
        for noise in (False, True):
            loop, plant = loop_seconds(noise, design=design)
            what = f"design {design}, {'with noise' if noise else 'noise-free'}"
            print(f"1000 s of closed loop at 10 Hz, {what}: {loop:.3f} s")
            print(f"  the plant alone: {plant:.3f} s; all that is not the plant: {1e2 * (loop - plant):.1f} us a tick")
            print(f"  the loop over the plant alone: {loop / plant:.2f}")
    print(f"limits: paper, noise-free {LIMIT_S:g} s; with noise {LIMIT_RATIO:g} times the plant alone")


if __name__ == "__main__":
    main()
