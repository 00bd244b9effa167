"""How long the envelope's observer takes, beside the plant that it is a copy of, in one process.

``python -m bringup.benchmarks.observer_speed [SEED] [REPEATS]`` plays a drive (`drive:SEED`, sensors' noise included)
with K0 alone, in turn with diagnosis (observer, decision, compensator, and what is recorded of them) and without it;
then the plant alone with its inputs, and the observer alone with its readings and commands, tick after tick in compiled
code as in the loop. What the decision tells the observer, jumps of the air flow above all, is told here, too, but its
own time is not the observer's. Times are processor time, the least of the repeats.

Last, a detector is told the readings and commands one by one, as in a node. A tick's time is the least of the repeats
of that tick, so that what the machine does beside is not in it.
"""

import sys
import time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ac_common.blas_threads import one_blas_thread
from ac_common.compiled import Array, compiler
from ac_common.errors import RunError
from ac_common.signals import Measurement, topics_of
from ac_common.topics import AIR_SIDE, BY_NAME
from ac_experiments.compiled_loop import CompiledLoop
from ac_experiments.designs import EnvelopeDesigns, designs_of
from ac_experiments.ordinary_ticks import MOVE, SENSE
from ac_experiments.recording import Recording
from ac_experiments.scenario import load
from ac_experiments.scenario_schema import Scenario
from ac_experiments.simulate import simulate
from ac_plant_node import Plant
from ac_plant_node.dynamics.drive import AIR_C, OPENING, SPEED
from ac_plant_node.dynamics.telling import run_and_tell
from ac_plant_node.dynamics.workspace import views
from ac_plant_node.inputs import INPUT
from ac_plant_node.plant import handed_over
from ac_plant_node.properties.tables import Tables
from bringup.benchmarks.loop_speed import LIMIT_RATIO as LOOP_RATIO
from fdi_node.envelope import EnvelopeDesign, EnvelopeDetector
from fdi_node.envelope.compiled import SOURCES
from fdi_node.envelope.filter import go_on_to_next, take
from fdi_node.envelope.memory import memory_of, rules_in
from fdi_node.envelope.quiet import leaves_nothing

LIMIT_RATIO, LIMIT_P99_MS = 1.5, 1.0
Rows = list[list[float]]
_CONDENSER_AIR_C = INPUT["condenser_air_inlet_temperature"]
jit = compiler(*SOURCES, "bringup.benchmarks.observer_speed")


class Costs(NamedTuple):
    """Seconds of a drive: with diagnosis, without, plant, observer; ms of a node's tick, 99 % quantile and longest."""

    diagnosed_s: float
    alone_s: float
    plant_s: float
    observer_s: float
    p99_ms: float
    longest_ms: float


def measure(seed: int = 7, repeats: int = 5) -> Costs:
    """Return what observer and plant cost in a drive."""
    scenario = load(f"drive:{seed}", ["design=envelope"])
    designs = designs_of(scenario)
    assert isinstance(designs, EnvelopeDesigns)
    run = simulate(scenario, designs=designs)
    h, times = scenario.sample_time_s, run.time_s.tolist()
    readings, inlets, commands, inputs = (_rows(run, keys) for keys in _KEYS)
    costs, ticks = [], []
    for _ in range(repeats + 1):  # the first compiles
        loops = [_loop_s(scenario, designs, diagnose) for diagnose in (True, False)]
        plant_s = _plant_s(scenario.operating_point, np.array(inputs), h)
        costs.append((*loops, plant_s, _observer_s(designs.fdi, times, readings, inlets, commands)))
        ticks.append(_observe(designs.fdi, times, readings, inlets, commands))
    tick_ms = 1e3 * np.min(ticks, axis=0)
    diagnosed_s, alone_s, plant_s, observer_s = np.min(costs, axis=0).tolist()
    p99_ms, longest_ms = float(np.quantile(tick_ms, 0.99)), float(tick_ms.max())
    return Costs(diagnosed_s, alone_s, plant_s, observer_s, p99_ms, longest_ms)


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


def _loop_s(scenario: Scenario, designs: EnvelopeDesigns, diagnose: bool) -> float:
    """Return how long the ticks of a drive take with K0 alone, s."""
    loop = CompiledLoop(scenario, designs, None, accommodate=False, diagnose=diagnose)
    began = time.process_time()
    loop.run_compiled(lambda *_: None)
    return time.process_time() - began


def _observer_s(design: EnvelopeDesign, times: list[float], readings: Rows, inlets: Rows, commands: Rows) -> float:
    """Return how long the observer's ticks take one after the other in compiled code, as in the loop, s."""
    detector = EnvelopeDetector(design)
    detector.observe(times[0], readings[0], *inlets[0])
    detector.commanded(commands[0])
    given = (*detector.compiled, *(np.array(rows) for rows in (readings, inlets, commands)))
    tick, stage, took = 1, SENSE, 0.0
    while tick < len(times):
        began, first = time.process_time(), tick
        tick, is_lost = _run_observer(first, stage, *given)
        took += time.process_time() - began
        if is_lost:
            msg = f"the observer had to begin anew at {times[tick]:.1f} s"
            raise RunError(msg)
        if tick > first:
            detector.follow(times[first], times[tick - 1])
        if tick < len(times):
            detector.conclude(times[tick], *inlets[tick])
            stage = MOVE
    return took


@jit
def _run_observer(
    first: int, stage: int, flat: Array, packed: Array, reading: Array, told: Array, tables: Tables, asked: Array,
    thresholds: Array, readings: Array, inlets: Array, commands: Array,
) -> tuple[int, bool]:  # fmt: skip
    """Do ticks until one has something to conclude; return it and whether the observer has to begin anew."""
    rules = rules_in(packed)
    m = memory_of(flat, rules.rows.shape[0], rules.jumping.shape[0])
    k, ticks = views(m.work), readings.shape[0]
    for tick in range(first, ticks):
        if tick > first or stage == SENSE:
            reading[:] = readings[tick]
            told[AIR_C], told[_CONDENSER_AIR_C] = inlets[tick, 0], inlets[tick, 1]
            take(m, k, rules, reading, told, tables)
            if not leaves_nothing(m, rules, asked, thresholds):
                return tick, False
        told[SPEED], told[OPENING] = commands[tick, 0], commands[tick, 1]
        if go_on_to_next(m, k, rules, told, tables) != 0:
            return tick, True
    return ticks, False


def _plant_s(point: str, inputs: NDArray[np.float64], sample_time_s: float) -> float:
    """Return how long the plant's ticks take one after the other in compiled code, as in the loop, s."""
    arrays = handed_over(Plant.at(point))
    began = time.process_time()
    _run_plant(inputs, sample_time_s, *arrays)
    return time.process_time() - began


@jit
def _run_plant(
    inputs: Array, h: float, work: Array, par: Array, sat: Array, vapour: Array, isentrope: Array, liquid: Array,
    grid: Array, driven: Array, results: Array,
) -> None:  # fmt: skip
    for k in range(inputs.shape[0]):
        for i in range(inputs.shape[1]):
            driven[i] = inputs[k, i]
        run_and_tell(work, par, sat, vapour, isentrope, liquid, grid, driven, h, results)


def main() -> None:
    """Print the figures."""
    one_blas_thread()
    seed, repeats = (int(given) for given in (*sys.argv[1:], *("7", "5")[len(sys.argv) - 1 :]))
    costs = measure(seed, repeats)
    diagnosed, alone, plant, observer = (1e3 * seconds for seconds in costs[:4])
    print(f"drive:{seed}, ms: {diagnosed:.0f} with diagnosis, {alone:.0f} without; alone: ", end="")
    print(f"the plant {plant:.0f}, the observer {observer:.0f}")
    print(f"  observer over plant {observer / plant:.2f} (limit {LIMIT_RATIO:g})")
    print(f"  all diagnosis over plant {(diagnosed - alone) / plant:.2f}")
    print(f"  loop over plant {diagnosed / plant:.2f} (limit {LOOP_RATIO:g})")
    print(f"  a node's tick: p99 {costs.p99_ms:.3f} ms (limit {LIMIT_P99_MS:g}), longest {costs.longest_ms:.3f} ms")


if __name__ == "__main__":
    main()
