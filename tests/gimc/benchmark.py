"""Norms and times of the synthesis beside SLICOT's; writes the table of docs/optima.md. Not a test.

    python tests/gimc/benchmark.py          # prints the table, and the times of a sampled filter
    python tests/gimc/benchmark.py --write  # and puts it into the page

SLICOT's norm is the one that its controller achieves, recomputed; what it claims stands in a column of its own.
"""

import statistics
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import control
import numpy as np
from published import PUBLISHED, Problem
from synthesis_problems import mixed_sensitivity, performance_weight, random_system, stiff_plant

import gimc
from gimc import Abcd, SampledFilter, abcd, append, discretise, hinf_norm, hinf_synthesis, is_stable, lft, state_space

REPEATS = 5
PAGE = Path(__file__).parents[2] / "docs" / "optima.md"
HEAD = "| problem | published | ours | SLICOT has | SLICOT claims | ours, ms | SLICOT, ms | SLICOT / ours |"


def shortest(*functions: Callable[[], Any]) -> list[tuple[float, Any]]:
    """Shortest of some runs of each function in seconds of processor time, and its last result; they take turns."""
    times: list[list[float]] = [[] for _ in functions]
    results: list[Any] = [None] * len(functions)
    for _ in range(REPEATS):
        for i, function in enumerate(functions):
            start = time.process_time()
            results[i] = function()
            times[i].append(time.process_time() - start)
    return [(min(spent), result) for spent, result in zip(times, results, strict=True)]


def stiff() -> Problem:
    system = abcd(stiff_plant(0))
    G = Abcd(system.A, system.B[:, :2], system.C[:2], system.D[:2, :2])
    W1 = gimc.series(append(performance_weight(0.02), performance_weight(0.02)), np.diag([1e-4, 1 / 3]))
    P = mixed_sensitivity(G, W1, abcd(np.diag([1 / 100, 1 / 0.3])))
    return gimc.scale(P, right=np.array([1e4, 3.0, 1.0, 1.0])), 2, 2


def random_problem(n: int) -> Problem:
    system = random_system(n, n, 6, 6, stable=True)
    D = system.D.copy()
    D[3:, 3:] = 0.0
    return Abcd(system.A, system.B, system.C, D), 3, 3


def slicot(P: Abcd, nmeas: int, ncon: int) -> tuple[Any, float] | None:
    """Return SLICOT's controller and the norm that it claims, or None where it fails."""
    try:
        K, _, claimed, _ = control.hinfsyn(state_space(P), nmeas, ncon)
    except Exception:  # whatever its wrapper raises
        return None
    return K, claimed


def row(name: str, problem: Problem, optimum: float | None) -> tuple[str, float | None]:
    """Return a row of the table, and how many times as long SLICOT takes (None where it fails)."""
    P, nmeas, ncon = problem
    (ours_s, result), (theirs_s, found) = shortest(lambda: hinf_synthesis(*problem), lambda: slicot(*problem))
    printed = "" if optimum is None else f"{optimum:.6g}"
    if found is None:
        has, claims, ratio = "fails", "", None
    else:
        K, claimed = found
        closed = lft(P, K, nmeas, ncon)
        has = f"{hinf_norm(closed)[0]:.6g}" if is_stable(closed) else "unstable"
        claims, ratio = f"{claimed:.6g}", theirs_s / ours_s
    times = f"{1e3 * ours_s:.1f} | {1e3 * theirs_s:.1f} | {'' if ratio is None else f'{ratio:.1f}'}"
    return f"| {name} | {printed} | {result.gamma:.6g} | {has} | {claims} | {times} |", ratio


def table() -> Iterator[str]:
    """Return the lines of the table, and one that sums up the times."""
    problems = {name: (published.problem(), published.optimum) for name, published in PUBLISHED.items()}
    problems["stiff plant in SI units"] = stiff(), None
    problems |= {f"random, {n} states": (random_problem(n), None) for n in (10, 20, 40, 60)}
    yield HEAD
    yield "|---" * HEAD.count(" | ") + "|---|"
    ratios = []
    for name, (problem, optimum) in problems.items():
        line, ratio = row(name, problem, optimum)
        yield line
        if ratio is not None:
            ratios.append(ratio)
    yield ""
    yield (
        f"SLICOT takes {min(ratios):.1f} to {max(ratios):.1f} times as long (median {statistics.median(ratios):.1f}): "
        f"processor time, the shortest of {REPEATS} runs of each, taking turns in one process."
    )


def main() -> None:
    lines = []
    for line in table():
        print(line, flush=True)
        lines.append(line)
    if "--write" in sys.argv[1:]:
        before, _, rest = PAGE.read_text(encoding="utf-8").partition("<!-- table -->\n")
        _, _, after = rest.partition("<!-- end of table -->\n")
        body = "\n".join(lines)
        PAGE.write_text(f"{before}<!-- table -->\n{body}\n<!-- end of table -->\n{after}", encoding="utf-8")
    for n in (10, 30, 60):
        run, u = SampledFilter(discretise(random_system(n, n, 3, 2, stable=True), 0.1)), np.ones(3)
        [(seconds, _)] = shortest(lambda run=run, u=u: [run.step(u) for _ in range(10_000)])
        print(f"step of a filter with {n} states: {1e2 * seconds:.2f} us")


if __name__ == "__main__":
    main()
