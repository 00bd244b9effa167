"""Benchmarks of the plant beside references; `python -m bringup.benchmarks.plant_speed` prints them."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ac_common.blas_threads import one_blas_thread
from ac_plant_node.dynamics import balances, workspace
from ac_plant_node.dynamics.drive import drive
from ac_plant_node.equilibrium import operating_point
from ac_plant_node.inputs import INPUT_HIGH, INPUT_LOW
from ac_plant_node.parameters.file import load_parameters
from ac_plant_node.parameters.values import POINTS
from ac_plant_node.plant import Plant
from ac_plant_node.properties.compiled import Array, jit
from ac_plant_node.properties.tables import Tables, load_tables
from bringup.benchmarks.figure import Figure

Say = Callable[[str], None]


def run_benchmarks(hours: int = 10, say: Say = lambda _: None) -> list[Figure]:
    """Return all figures of the plant.

    Parameters
    ----------
    hours : int
        Simulated hours of random inputs over the whole permitted box, a seed each.
    say : callable
        Told what is being measured.
    """
    say("right-hand side, compiled and with CoolProp")
    compiled, humid, direct = rhs_time_us(), rhs_time_us(humidity=0.5), coolprop_rhs_time_us()
    say("1000 s of transient, ours and BDF with CoolProp")
    ours_ms, ours_error = transient(3.0e-5)
    bdf_ms, bdf_error = transient_with_bdf(1.0e-5)
    say(f"{hours} h of random inputs")
    random = random_inputs(hours)
    say("accuracy under random inputs, then fresh processes, with caches and without")
    return [
        Figure("right-hand side", "us", compiled, 5.0, reference=direct),
        Figure("  in air of 50 % relative humidity", "us", humid, 5.0),
        Figure("  CoolProp's time over ours", "", direct / compiled, 50.0, at_least=True),
        Figure("1000 s of open-loop transient (reference: BDF on CoolProp)", "ms", ours_ms, 50.0, reference=bdf_ms),
        Figure("  BDF's time over ours", "", bdf_ms / ours_ms, 100.0, at_least=True),
        Figure("  largest error of p_e on the way", "Pa", ours_error, reference=bdf_error),
        *random,
        *accuracy(),
        Figure("import and first step, caches warm", "s", first_step_s(), 2.0),
        Figure("import and first step, caches cold", "s", first_step_s(cold=True), 60.0),
    ]


def _best(function: Callable[[], None], rounds: int) -> float:
    """Return the shortest time (s) of some rounds: what the code takes when nothing else takes the processor."""
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


@jit
def _rhs_loop(
    s: Array, w: Array, par: Array, tab: Tables, guess: Array, z: Array, ds: Array, aux: Array, n: int, factor: float
) -> None:
    for _ in range(n):
        s[1] *= factor
        s[6] *= factor
        factor = 1.0 / factor
        balances.rhs(s, w, par, tab, guess, z, ds, aux)


def rhs_time_us(n: int = 10000, humidity: float = 0.0) -> float:
    """Return the time of a compiled right-hand side at the medium point, its state moved by 1e-4 from call to call."""
    parameters, point = load_parameters(), operating_point("med")
    tab = load_tables(parameters.refrigerant)
    guess, z, ds, aux = balances.new_workspace()
    guess[:] = point.state[1], point.state[7]

    outside = [parameters["condenser_air_kg_s"], parameters["condenser_air_inlet_k"] - 273.15]
    w = drive(np.array([*point.inputs, *outside, humidity]), parameters)

    def loop(count: int = n) -> None:
        _rhs_loop(point.conserved.copy(), w, parameters.values, tab, guess, z, ds, aux, count, 1.0 + 1.0e-4)

    loop(10)
    return _best(loop, 60) / n * 1.0e6


def coolprop_rhs_time_us(n: int = 40) -> float:
    """Return the same time with CoolProp instead of tables, in plain Python."""
    from ac_plant_node.coolprop_model import CoolPropModel

    point, direct = operating_point("med"), CoolPropModel()
    states = [point.conserved * f for f in (1.0, 1.0 + 1.0e-4)]

    def loop() -> None:
        for k in range(n):
            direct.rates(states[k % 2], point.inputs)

    direct.rates(states[0], point.inputs)
    return _best(loop, 3) / n * 1.0e6


def _transient_inputs() -> NDArray[np.float64]:
    w: NDArray[np.float64] = operating_point("med").inputs * np.array([1.1, 1.1, 1.15, 1.05])
    return w


_TIMES_S = np.array([2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0])
"""When the two are compared with a far more accurate solution."""


def _pressures(tolerance: float) -> NDArray[np.float64]:
    plant, w = Plant.at("med", tolerance), _transient_inputs()
    return np.array([plant.step(w, dt)[0] for dt in np.diff(_TIMES_S, prepend=0.0)])


def transient(tolerance: float) -> tuple[float, float]:
    """Return the time (ms) of 1000 s after a step of every input, and the largest error of p_e (Pa) on the way."""
    w = _transient_inputs()
    times = []
    for _ in range(7):
        plant = Plant.at("med", tolerance)
        start = time.perf_counter()
        plant.step(w, 1000.0)
        times.append(time.perf_counter() - start)
    return min(times) * 1.0e3, float(np.abs(_pressures(tolerance) - _pressures(1.0e-9)).max())


def transient_with_bdf(rtol: float) -> tuple[float, float]:
    """Return the same figures by scipy's BDF on the right-hand side that calls CoolProp.

    BDF gets a Jacobian by differences large enough for CoolProp's iterative flashes: its own are lost in their noise.
    """
    from scipy.integrate import solve_ivp

    from ac_plant_node.coolprop_model import CoolPropModel

    w, direct = _transient_inputs(), CoolPropModel()
    start_state = operating_point("med").conserved
    direct.rates(start_state, w)
    scale = workspace.ERROR_SCALE.copy()
    scale[5] = scale[0]  # the condenser's mass, where our integration carries heat

    def jacobian(_t: float, s: NDArray[np.float64]) -> NDArray[np.float64]:
        base, columns = direct.rates(s, w), []
        for j in range(balances.N_STATES):
            moved = s.copy()
            moved[j] += 1.0e-4 * scale[j]
            columns.append((direct.rates(moved, w) - base) / (moved[j] - s[j]))
        return np.array(columns).T

    begin = time.perf_counter()
    result = solve_ivp(
        lambda _t, s: direct.rates(s, w), (0.0, 1000.0), start_state, method="BDF", rtol=rtol, atol=rtol * scale,
        jac=jacobian, t_eval=_TIMES_S,
    )  # fmt: skip
    spent = time.perf_counter() - begin
    found = []
    for s in result.y.T:
        direct.rates(s, w)
        found.append(direct.aux[1])
    return spent * 1.0e3, float(np.abs(np.array(found) - _pressures(1.0e-9)).max())


class Interval(NamedTuple):
    """One control interval: how many steps were tried in it, the plant before it, its inputs."""

    attempts: float
    before: Plant
    inputs: NDArray[np.float64]


def random_holds(seed: int) -> Iterator[tuple[NDArray[np.float64], int]]:
    """Return one hour of random inputs over the permitted box: what is held, and for how many intervals of 0.1 s."""
    rng, left = np.random.default_rng(seed), 36000
    while left > 0:
        w = rng.uniform(INPUT_LOW, INPUT_HIGH)
        w[0] *= rng.random() > 0.1  # the compressor's clutch open, the valve shut: now and then exactly
        w[1] *= rng.random() > 0.1
        ticks = min(left, int(rng.uniform(50, 600)))
        left -= ticks
        yield w, ticks


def accuracy(seeds: int = 5) -> list[Figure]:
    """Return the errors of the outputs under random inputs against tolerance 1e-8; half an hour of each seed."""
    figures = []
    for given, name in (
        (len(INPUT_LOW), f"rms error over {seeds} half hours of random inputs"),
        (4, "with the paper's four inputs alone at random"),
    ):
        rms = np.sqrt(np.mean(np.square(_errors(seeds, given)), axis=0))
        figures += [Figure(f"  {name}, p_e", "Pa", float(rms[0])), Figure("  the same, SH", "K", float(rms[1]))]
    return figures


def _errors(seeds: int, given: int) -> list[Array]:
    """Return the errors of all outputs at every second, the first `given` inputs at random."""
    errors = []
    for seed in range(seeds):
        plant, exact = Plant.at(POINTS[seed % 3]), Plant.at(POINTS[seed % 3], 1.0e-8)
        left = 1800
        for w, ticks in random_holds(seed):
            seconds = min(left, ticks // 10)
            errors += [plant.step(w[:given], 1.0) - exact.step(w[:given], 1.0) for _ in range(seconds)]
            left -= seconds
    return errors


def _longest(start: Plant, w: NDArray[np.float64], attempts: list[float]) -> Interval:
    """Return the interval of a hold in which the integrator tried most steps; the plant is brought there again."""
    k = int(np.argmax(attempts))
    plant = start.copy()
    for _ in range(k):
        plant.step(w, 0.1)
    return Interval(attempts[k], plant, w)


def random_inputs(hours: int, kept: int = 40, rounds: int = 50) -> list[Figure]:
    """Run intervals of 0.1 s under random inputs: their time, the balances, and the bounds that outputs stay in.

    The longest interval is looked for by what the integrator does in it, which no other job on the machine can change:
    the `kept` intervals with most steps tried. Each of them is then run `rounds` times from the very same state, and
    its shortest time counts, so what is left is the plant's own.
    """
    worst: list[Interval] = []
    rows, spent, ticks = [], 0, 0
    mass = energy = 0.0
    for seed in range(hours):
        plant = Plant.at(POINTS[seed % 3])
        mass_0, energy_0 = plant.refrigerant_mass_kg, plant.stored_energy_j
        for w, count in random_holds(seed):
            start, tried = plant.copy(), [plant.steps_tried]
            begin = time.thread_time_ns()
            for _ in range(count):
                y = plant.step(w, 0.1)
                tried.append(plant.steps_tried)
            spent += time.thread_time_ns() - begin
            ticks += count
            rows.append(y)
            attempts = np.diff(tried).tolist()
            if len(worst) < kept or max(attempts) > worst[-1].attempts:
                worst = sorted([*worst, _longest(start, w, attempts)], key=lambda each: -each.attempts)[:kept]
        mass = max(mass, abs(plant.refrigerant_mass_kg / mass_0 - 1.0))
        energy = max(energy, abs(plant.stored_energy_j - energy_0 - plant.heat_in_j) / plant.heat_moved_j)
    table = np.array(rows)
    return [
        Figure("one control interval of 0.1 s, mean (processor time)", "ms", spent * 1.0e-6 / ticks),
        Figure(f"  longest of {ticks}, repeated", "ms", max(_again(worst, rounds)) * 1.0e3, 1.0),
        Figure("  integration steps tried in one interval, most", "", worst[0].attempts),
        Figure("  relative drift of the refrigerant mass", "", mass, 1.0e-6),
        Figure("  energy imbalance over heat moved", "", energy, 1.0e-4),
        Figure("  lowest p_e", "kPa", float(table[:, 0].min()) * 1.0e-3, 15.0, at_least=True),
        Figure("  highest p_c", "kPa", float(table[:, 3].max()) * 1.0e-3, 3450.0),
    ]


def _again(intervals: list[Interval], rounds: int) -> list[float]:
    """Return the shortest time (s) of each interval run again and again from the same state.

    All of them in turn, so that the repeats of one are spread over seconds: a neighbour on the same core that slows
    everything for a while is then not taken for the plant.
    """
    times = [np.inf] * len(intervals)
    for _ in range(rounds):
        for k, interval in enumerate(intervals):
            plant = interval.before.copy()
            begin = time.perf_counter()
            plant.step(interval.inputs, 0.1)
            times[k] = min(times[k], time.perf_counter() - begin)
    return times


def first_step_s(cold: bool = False) -> float:
    """Return the seconds from the start of a Python process to its first step of the plant."""
    code = "import ac_plant_node; ac_plant_node.Plant.at('med').advance(0.1)"
    with tempfile.TemporaryDirectory(prefix="acftc-cold-") as folder:
        environment = dict(os.environ, XDG_CACHE_HOME=folder) if cold else None

        def start() -> None:
            subprocess.run([sys.executable, "-c", code], check=True, env=environment, stderr=subprocess.DEVNULL)

        return _best(start, 1 if cold else 3)


def main() -> None:
    """Print the figures, and what else ran meanwhile as far as the load average tells."""
    one_blas_thread()
    hours = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    before = os.getloadavg()[0]
    for f in run_benchmarks(hours, say=lambda text: print(f"  ... {text}", file=sys.stderr, flush=True)):
        limit = "" if f.limit is None else f"{'at least' if f.at_least else 'at most'} {f.limit:g}"
        reference = "" if f.reference is None else f"reference {f.reference:.4g}"
        print(f"{f.name:62s} {f.ours:12.4g} {f.unit:4s} {limit:16s} {reference}")
    print(
        f"{os.cpu_count()} processors, load average {before:.1f} at the start and {os.getloadavg()[0]:.1f} at the end"
    )


if __name__ == "__main__":
    main()
