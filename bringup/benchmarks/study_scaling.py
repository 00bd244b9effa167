"""How studies scale: what one worker, two, and eight on this machine make of a study with K0 alone beside.

``python -m bringup.benchmarks.study_scaling [SECONDS]`` plays, with each number of workers, drives of 1000 s of the
whole envelope, without a fault and with one of compressor or pressure sensor, for about SECONDS (90), after each worker
has played one. With the default it takes about six minutes on two cores. Worker processes beyond the number of cores
stand for a cluster: what they cost the scheduler is what they would cost it anywhere.
"""

import sys
import tempfile
import threading
from typing import NamedTuple

import psutil

from ac_common.blas_threads import one_blas_thread
from ac_experiments.study.engine import Timing, opened_client, run_study
from ac_experiments.study.results import Store
from ac_experiments.study.schema import Study, check_study
from bringup.benchmarks.children import resident_mb

WORKERS, SECONDS, RUN_S = (1, 2, 8), 90.0, 1000.0
SAMPLE_S = 0.5
"""Between two looks at the client's memory."""


class Scaling(NamedTuple):
    """How a study went on so many workers; the client's resident memory at the start, in the middle, at the end."""

    workers: int
    cores: int
    timing: Timing
    memory_mb: tuple[float, float, float]

    @property
    def runs_a_minute(self) -> float:
        """Runs a minute."""
        return 60.0 * self.timing.runs / self.timing.wall_s

    @property
    def busy(self) -> float:
        """Processor time in runs as a share of that of the cores which the workers can use."""
        return self.timing.busy_cpu_s / (self.timing.wall_s * self.cores)

    @property
    def scheduler(self) -> float:
        """Processor time of client and scheduler as a share of that in runs."""
        return self.timing.client_cpu_s / self.timing.busy_cpu_s


def drives(runs: int, run_s: float) -> Study:
    """Return the study that is played."""
    return check_study(
        {
            "name": "scaling",
            "set": {"design": "envelope", "duration_s": run_s, "fault.typical": 1.0, "fault.onset_s": 0.5 * run_s},
            "runs": runs,
            "k0_alone": True,
            "vary": {"fault.kind": {"grid": ["none", "compressor_speed", "evaporator_pressure"]}},
        }
    )


def measure(workers: int, seconds: float = SECONDS, run_s: float = RUN_S) -> Scaling:
    """Return how a study of about so many seconds goes on so many worker processes of this machine."""
    cores = min(workers, len(psutil.Process().cpu_affinity() or [0]))
    memory_mb, is_over = [], threading.Event()

    def look() -> None:
        while not is_over.wait(SAMPLE_S):
            memory_mb.append(resident_mb(psutil.Process()))

    with tempfile.TemporaryDirectory(prefix="acftc-scaling-") as folder, opened_client(None, workers) as client:
        address = client.scheduler_info()["address"]
        for name in ("first", "second"):  # the first loads and compiles, the second says how long a run takes
            warm = run_study(drives(2 * workers, run_s), Store(f"{folder}/{name}"), scheduler=address)
        runs = max(2 * workers, round(seconds * cores / warm.busy_cpu_s * warm.runs))
        memory_mb.append(resident_mb(psutil.Process()))
        looking = threading.Thread(target=look, daemon=True)
        looking.start()
        timing = run_study(drives(runs, run_s), Store(f"{folder}/measured"), scheduler=address)
        is_over.set()
        looking.join()
    return Scaling(workers, cores, timing, (memory_mb[0], memory_mb[len(memory_mb) // 2], memory_mb[-1]))


def main() -> None:
    """Print the table."""
    one_blas_thread()
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS
    print(
        "workers  in runs  runs  runs/min  CPU s/run  cores busy with runs  efficiency  client, scheduler  client's MB"
    )
    first = None
    for workers in WORKERS:
        one = measure(workers, seconds)
        first = first or one
        timing, efficiency = one.timing, one.runs_a_minute / first.runs_a_minute / one.cores * first.cores
        print(
            f"{workers:7d} {100.0 * timing.busy_s / (timing.wall_s * workers):6.1f} % {timing.runs:5d}"
            f" {one.runs_a_minute:9.1f} {timing.busy_cpu_s / timing.runs:10.3f}"
            f" {100.0 * one.busy:13.1f} % of {one.cores} {efficiency:11.3f} {100.0 * one.scheduler:16.2f} %"
            f"  {' '.join(f'{mb:.1f}' for mb in one.memory_mb)}",
            flush=True,
        )
    print("efficiency: runs a minute over those of one worker, a core; client, scheduler: over the CPU time in runs")


if __name__ == "__main__":
    main()
