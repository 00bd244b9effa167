"""Prints times and norms of the synthesis beside SLICOT's: `python tests/gimc/benchmark.py`. Not a test.

SLICOT's norm is the one that its controller achieves, recomputed; what it claims is in brackets.
"""

import time
from collections.abc import Callable
from typing import Any

import control
import numpy as np
from synthesis_problems import mixed_sensitivity, performance_weight, random_system, stiff_plant
from test_hinfsyn import PUBLISHED, dc_servo, scherer_7

import gimc
from gimc import Abcd, SampledFilter, abcd, append, discretise, hinf_norm, hinf_synthesis, is_stable, lft, state_space

REPEATS = 3


def shortest(function: Callable[[], Any]) -> tuple[float, Any]:
    """Shortest of a few runs in seconds, and the last result."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        result = function()
        times.append(time.perf_counter() - start)
    return min(times), result


def stiff() -> tuple[Abcd, int, int]:
    system = abcd(stiff_plant(0))
    G = Abcd(system.A, system.B[:, :2], system.C[:2], system.D[:2, :2])
    W1 = gimc.series(append(performance_weight(0.02), performance_weight(0.02)), np.diag([1e-4, 1 / 3]))
    P = mixed_sensitivity(G, W1, abcd(np.diag([1 / 100, 1 / 0.3])))
    return gimc.scale(P, right=np.array([1e4, 3.0, 1.0, 1.0])), 2, 2


def slicot(P: Abcd, nmeas: int, ncon: int) -> str:
    try:
        seconds, (K, _, claimed, _) = shortest(lambda: control.hinfsyn(state_space(P), nmeas, ncon))
    except Exception as error:  # whatever its wrapper raises
        return f"fails: {type(error).__name__}"
    closed = lft(P, K, nmeas, ncon)
    achieved = f"{hinf_norm(closed)[0]:10.6g}" if is_stable(closed) else "  unstable"
    return f"{1e3 * seconds:8.1f} ms {achieved} [{claimed:.6g}]"


def main() -> None:
    problems = {
        **{name: make() for name, (make, _, _) in PUBLISHED.items()},
        "DC servo": dc_servo(),
        "Scherer 1997, example 7": scherer_7(),
        "stiff plant, SI units": stiff(),
    }
    for n in (10, 20, 40, 60):
        system = random_system(n, n, 6, 6, stable=True)
        D = system.D.copy()
        D[3:, 3:] = 0.0
        problems[f"random, {n} states"] = Abcd(system.A, system.B, system.C, D), 3, 3
    for name, (P, nmeas, ncon) in problems.items():
        seconds, result = shortest(lambda P=P, nmeas=nmeas, ncon=ncon: hinf_synthesis(P, nmeas, ncon))
        print(f"{name:24s} {1e3 * seconds:8.1f} ms {result.gamma:10.6g} | SLICOT {slicot(P, nmeas, ncon)}")
    for n in (10, 30, 60):
        run, u = SampledFilter(discretise(random_system(n, n, 3, 2, stable=True), 0.1)), np.ones(3)
        seconds, _ = shortest(lambda run=run, u=u: [run.step(u) for _ in range(10_000)])
        print(f"step of a filter with {n} states: {1e2 * seconds:.2f} us")


if __name__ == "__main__":
    main()
