"""Thousands of tiny scenarios in a row: what is left of memory, file handles, processes and shared memory.

    python tests/bringup/fault_campaign/tiny_runs.py                      # 10,000 in one process
    python tests/bringup/fault_campaign/tiny_runs.py --graph --runs 100   # through the graph of processes

Prints what the process holds now and then, as a table. Exit code 1 when something grows.
"""

import argparse
import gc
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import psutil

from ac_experiments.bags.reader import read_bag
from ac_experiments.designs import designs_of
from ac_experiments.metrics import summarise, write_summary
from ac_experiments.scenario import check
from ac_experiments.scenario_schema import Scenario
from ac_experiments.simulate import simulate
from bringup.launch.launch import run_graph
from bringup.launch.shared_memory import SHARED_MEMORY

#: What resident memory may grow by after the warm-up, MB: the allocator's own play.
PLAY_MB = 20.0
#: Fast DDS lets go of a run's segments a moment later than the run ends (up to 0.7 s seen): by then it must have, s.
LET_GO_S = 10.0
WARM_UP = 0.1


@dataclass(frozen=True)
class Held:
    """What a process holds at one moment."""

    runs: int
    memory_mb: float
    files: int
    threads: int
    children: int
    shared: int

    @classmethod
    def now(cls, runs: int) -> "Held":
        """Look at this process, at what it holds and not at what is about to be let go of."""
        gc.collect()
        until = time.monotonic() + LET_GO_S
        while held_segments() and time.monotonic() < until:
            time.sleep(0.05)  # nothing announces it
        this = psutil.Process()
        return cls(
            runs=runs,
            memory_mb=this.memory_info().rss / 2**20,
            files=this.num_fds(),
            threads=this.num_threads(),
            children=len(this.children()),
            shared=len(held_segments()),
        )


def held_segments() -> set[str]:
    """Fast DDS segments that this process has mapped."""
    lines = Path("/proc/self/maps").read_text().splitlines()
    return {line.split()[-1] for line in lines if f"{SHARED_MEMORY}/fastrtps" in line}


def tiny(number: int) -> Scenario:
    """One of many different scenarios of a few ticks, some with faults and noise."""
    faults = [{"kind": "compressor_speed", "size_rpm": 10 + number % 50, "onset_s": 0.1}] if number % 3 == 0 else []
    return check(
        {
            "name": f"tiny_{number}",
            "duration_s": 0.2 + 0.1 * (number % 4),
            "operating_point": ("low", "med", "high")[number % 3],
            "faults": faults,
            "noise": {"superheat_k": 0.01, "seed": number},
        }
    )


def run_one(number: int, folder: Path, graph: bool) -> None:
    """Run one tiny scenario and write its summary."""
    scenario = tiny(number)
    recording = read_bag(run_graph(scenario, folder).bag) if graph else simulate(scenario)
    assert len(recording.time_s) == scenario.ticks
    write_summary(summarise(recording), folder / "summary.json")


def run_many(runs: int, folder: Path, graph: bool = False, looks: int = 10, say: object = print) -> list[Held]:
    """Run many, looking `looks` times at what is held; the first look comes after a tenth of them."""
    first = max(1, round(WARM_UP * runs))
    at = {first + round(i * (runs - first) / max(looks - 1, 1)) for i in range(looks)}
    for number in range(3):  # one for each operating point: a synthesis in this process would look like growth
        designs_of(tiny(number))
    seen = []
    for number in range(1, runs + 1):
        run_one(number, folder, graph)
        if number in at:
            seen.append(Held.now(number))
            if callable(say):
                say(seen[-1])
    return seen


def growth(seen: list[Held]) -> list[str]:
    """What has grown from the first look to the last."""
    first, last = seen[0], seen[-1]
    found = [
        f"{name} from {getattr(first, name)} to {getattr(last, name)}"
        for name in ("files", "threads", "children", "shared")
        if getattr(last, name) > getattr(first, name)
    ]
    if last.memory_mb > first.memory_mb + PLAY_MB:
        found.append(f"memory from {first.memory_mb:.0f} to {last.memory_mb:.0f} MB")
    return found


def main() -> int:
    """Run many and judge."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--graph", action="store_true", help="each through the graph of processes")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="acftc-tiny-") as folder:
        seen = run_many(options.runs, Path(folder), options.graph)
    grown = growth(seen)
    print("; ".join(grown) if grown else "nothing has grown")
    return 1 if grown else 0


if __name__ == "__main__":
    sys.exit(main())
