"""How long a tick of the envelope's observer takes, beside the plant that it is a copy of, in one process.

``python -m bringup.benchmarks.observer_speed [SEED] [REPEATS]`` runs a drive (`drive:SEED`, sensors' noise included),
then gives its readings and commands to an observer, and its inputs to a plant, in turn. The cost is processor time, the
least of the repeats; a tick's time is the least of the repeats of that tick, so that what the machine does beside is
not in it.
"""

import sys
import time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ac_common.blas_threads import one_blas_thread
from ac_common.signals import Measurement, topics_of
from ac_common.topics import AIR_SIDE, BY_NAME
from ac_experiments.designs import EnvelopeDesigns, designs_of
from ac_experiments.recording import Recording
from ac_experiments.scenario import load
from ac_experiments.simulate import simulate
from ac_plant_node import Plant
from fdi_node.envelope import EnvelopeDesign, EnvelopeDetector

LIMIT_RATIO, LIMIT_P99_MS = 1.5, 1.0
Rows = list[list[float]]


class Costs(NamedTuple):
    """Seconds of a whole run of observer and plant; milliseconds of the detector's tick, 99 % quantile and longest."""

    observer_s: float
    plant_s: float
    p99_ms: float
    longest_ms: float


def measure(seed: int = 7, repeats: int = 5) -> Costs:
    """Return what observer and plant cost in a drive."""
    scenario = load(f"drive:{seed}", ["design=envelope"])
    designs = designs_of(scenario)
    assert isinstance(designs, EnvelopeDesigns)
    run = simulate(scenario, designs=designs)
    h = scenario.sample_time_s
    readings, inlets, commands, inputs = (_rows(run, keys) for keys in _KEYS)
    costs, ticks = [], []
    for _ in range(repeats):
        started = time.process_time()
        ticks.append(_observe(designs.fdi, run.time_s.tolist(), readings, inlets, commands))
        between = time.process_time()
        _run_plant(scenario.operating_point, inputs, h)
        costs.append((between - started, time.process_time() - between))
    observer_s, plant_s = np.min(costs, axis=0)
    tick_ms = 1e3 * np.min(ticks, axis=0)
    return Costs(float(observer_s), float(plant_s), float(np.quantile(tick_ms, 0.99)), float(tick_ms.max()))


_COMMANDED = ("compressor", "expansion_valve")
_KEYS = (
    topics_of("measured", Measurement),
    ("plant/air_inlet_temperature", "plant/condenser_air_inlet_temperature"),
    tuple(f"controller/command:{joint}" for joint in _COMMANDED),
    (*(f"actuator/command:{joint}" for joint in _COMMANDED), *(BY_NAME[topic].series[0] for topic in AIR_SIDE)),
)
"""Series: what the detector is told at a tick, of readings, inlet temperatures, commands; what drives the plant."""


def _rows(run: Recording, keys: tuple[str, ...]) -> Rows:
    rows: Rows = np.column_stack([run.series[key] for key in keys]).tolist()
    return rows


def _observe(
    design: EnvelopeDesign, times: list[float], readings: Rows, inlets: Rows, commands: Rows
) -> NDArray[np.float64]:
    """Return how long each tick takes, s."""
    detector, took = EnvelopeDetector(design), np.empty(len(times))
    for k, (time_s, reading, inlet, command) in enumerate(zip(times, readings, inlets, commands, strict=True)):
        began = time.perf_counter()
        detector.observe(time_s, reading, *inlet)
        detector.commanded(command)
        took[k] = time.perf_counter() - began
    return took


def _run_plant(point: str, inputs: Rows, sample_time_s: float) -> None:
    plant = Plant.at(point)
    for held in np.array(inputs):
        plant.step(held, sample_time_s)


def main() -> None:
    """Print the figures."""
    one_blas_thread()
    seed, repeats = (int(given) for given in (*sys.argv[1:], *("7", "5")[len(sys.argv) - 1 :]))
    costs = measure(seed, repeats)
    ratio = costs.observer_s / costs.plant_s
    print(f"drive:{seed}: observer {costs.observer_s:.3f} s, plant {costs.plant_s:.3f} s")
    print(
        f"  ratio {ratio:.2f} (limit {LIMIT_RATIO:g}); p99 of a tick {costs.p99_ms:.3f} ms (limit {LIMIT_P99_MS:g}), ",
        end="",
    )
    print(f"longest {costs.longest_ms:.3f} ms")


if __name__ == "__main__":
    main()
