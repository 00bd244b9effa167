"""A long run on the wall clock: memory over time, missed ticks by cause, whether the bag is complete.

    python -m bringup.benchmarks.endurance                          # 2 h at 50 Hz
    python -m bringup.benchmarks.endurance --seconds 1200 --out results/endurance

Prints the resident memory of every node while it goes, and a judgement at the end. Exit code 1 when a promise was
broken: memory that grows after the first minute, a tick missed by our code, a bag that is not complete.
"""

import argparse
import contextlib
import math
import sys
import tempfile
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import psutil

from ac_common.blas_threads import one_blas_thread
from ac_common.health import HealthReport, missed_ticks
from ac_common.topics import INJECTOR, NAMESPACE, PLANT, TICKED
from ac_experiments.bags.reader import RawBag, health_reports, read_bag, read_raw
from ac_experiments.scenario import check
from bringup.benchmarks.children import node_processes, resident_mb
from bringup.benchmarks.figures import HostNoise, host_noise, start_host_noise
from bringup.benchmarks.host_noise import STALL_S, lost_s, missed_by_us
from bringup.launch.launch import GraphRun, run_graph
from bringup.launch.process_table import PROCESSES

#: Growth of one node after the first minute that is still none, MB: pages that are touched late, once.
PLAY_MB = 3.0
#: What counts as the first minute of a shorter run: a quarter of it.
FIRST_S = 60.0
COLUMNS = tuple(PROCESSES)


@dataclass
class Watch:
    """Resident memory of the nodes over the time of the run; a progress function."""

    period_s: float
    time_s: list[float] = field(default_factory=list)
    memory_mb: list[list[float]] = field(default_factory=list)
    _began_s: float = 0.0

    def __call__(self, tick: int, _ticks: int) -> None:
        """Look, when it is time to."""
        now_s = time.monotonic()
        if tick <= 0:
            return
        self._began_s = self._began_s or now_s
        if self.time_s and now_s - self._began_s < self.time_s[-1] + self.period_s:
            return
        found = node_memory_mb()
        if set(found) < set(COLUMNS):
            return
        self.time_s.append(now_s - self._began_s)
        self.memory_mb.append([found[name] for name in COLUMNS])
        print(f"{self.time_s[-1]:8.0f} s " + " ".join(f"{mb:16.1f}" for mb in self.memory_mb[-1]), flush=True)


def node_memory_mb() -> dict[str, float]:
    """Return the resident memory of each node that is a child of this process."""
    found = {}
    for name, process in node_processes().items():
        with contextlib.suppress(psutil.Error):  # gone meanwhile
            found[name] = resident_mb(process)
    return found


def dropped_datagrams() -> int:
    """Return how many UDP datagrams have found their receiver's buffer full since this machine started."""
    lines = Path("/proc/net/snmp").read_text().splitlines()
    names, values = (line.split() for line in lines if line.startswith("Udp:"))
    return int(values[names.index("RcvbufErrors")])


def growth_mb(time_s: Sequence[float], memory_mb: Sequence[float], first_s: float) -> float:
    """Return the growth of memory after the first `first_s`: median of the last quarter minus that of the first one."""
    times, memory = np.array(time_s), np.array(memory_mb)
    after = memory[times >= first_s]
    if len(after) < 4:
        return float("nan")
    quarter = len(after) // 4
    return float(np.median(after[-quarter:]) - np.median(after[:quarter]))


def sustained_mb(time_s: Sequence[float], memory_mb: Sequence[float], first_s: float) -> float:
    """Return the growth that goes on: twice the smaller of the growths of both halves after the first `first_s`.

    A leak shows in both halves. A queue that once had to be longer, because the machine gave a node no time for a
    while, keeps its memory afterwards: that is a step in one of them.
    """
    times, memory = np.array(time_s), np.array(memory_mb)
    times, memory = times[times >= first_s], memory[times >= first_s]
    if len(times) < 8:
        return float("nan")
    half = len(times) // 2
    return 2.0 * min(
        growth_mb(times[part].tolist(), memory[part].tolist(), 0.0) for part in (slice(half), slice(half, None))
    )


def missing_messages(raw: RawBag, ticks: int) -> dict[str, int]:
    """Return how many messages of each loop topic are not in the bag."""
    counts = {topic.name: len(raw.messages.get(f"{NAMESPACE}/{topic.name}", [])) for topic in TICKED}
    return {name: ticks - count for name, count in counts.items() if count < ticks}


def lost_messages(
    missing: Mapping[str, int], missed: int, reports: Iterable[tuple[str, Mapping[str, str]]]
) -> dict[str, int]:
    """Return those of the `missing` messages, by topic, that cannot have stayed unsent.

    In a missed tick any may have. And the injector does not send on what has not come from the plant in time; it counts
    such ticks in its health `reports` (``missing/plant/...``, its last one tells).
    """
    lacked = HealthReport.read(dict(reports).get(INJECTOR, {}))
    lost = {}
    for name, count in missing.items():
        kind, _, quantity = name.partition("/")
        unmeasured = lacked.missing.get(f"plant/{quantity}", 0) if kind == "measured" else 0
        if count > max(missed, unmeasured):
            lost[name] = count
    return lost


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, watch and judge."""
    one_blas_thread()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=7200.0)
    parser.add_argument("--rate", type=float, default=50.0, help="ticks a second (default 50)")
    parser.add_argument("--out", type=Path, help="keep bag and logs here (default: nowhere)")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="acftc-endurance-") as nowhere:
        return run(options.seconds, 1.0 / options.rate, options.out or Path(nowhere))


def run(seconds: float, sample_time_s: float, out: Path) -> int:
    """Run everything that a loop has, and judge."""
    scenario = check(
        {
            "name": "endurance",
            "duration_s": seconds,
            "sample_time_s": sample_time_s,
            "faults": [
                {"kind": "compressor_speed", "size_rpm": 30, "onset_s": 0.2 * seconds, "end_s": 0.4 * seconds},
                {"kind": "evaporator_pressure", "size_kpa": 3, "onset_s": 0.6 * seconds, "end_s": 0.8 * seconds},
            ],
            "noise": {"evaporator_pressure_kpa": 0.02, "superheat_k": 0.02, "wall_temperature_k": 0.02, "seed": 1},
        }
    )
    first_s = min(FIRST_S, seconds / 4.0)
    watch = Watch(period_s=max(1.0, min(30.0, seconds / 40.0)))
    print("resident memory, MB: " + " ".join(f"{name:>16}" for name in COLUMNS), flush=True)
    probes = start_host_noise(seconds + 60.0)
    dropped = dropped_datagrams()
    done = run_graph(scenario, out, mode="realtime", progress=watch, care=True)
    noise = host_noise(probes)
    print(f"{done.ticks} ticks at {1 / sample_time_s:g} Hz in {done.wall_seconds:.1f} s, {len(done.restarts)} restarts")
    print(f"datagrams dropped on this machine, their receivers' buffers being full: {dropped_datagrams() - dropped}")
    raw = read_raw(done.bag)
    broken = [*judge_memory(watch, first_s), *judge_ticks(done, raw, noise, sample_time_s), *judge_bag(done, raw)]
    print("; ".join(broken) if broken else "all promises kept")
    return 1 if broken else 0


def judge_memory(watch: Watch, first_s: float) -> list[str]:
    """Print what has grown after the first `first_s`; the broken promises."""
    rows = dict(zip(COLUMNS, zip(*watch.memory_mb, strict=True), strict=True)) if watch.memory_mb else {}
    grown = {name: growth_mb(watch.time_s, row, first_s) for name, row in rows.items()}
    lasting = {name: sustained_mb(watch.time_s, row, first_s) for name, row in rows.items()}
    print("growth after the first minute, MB: " + ", ".join(f"{name} {mb:+.2f}" for name, mb in grown.items()))
    print("of it goes on growing, MB: " + ", ".join(f"{name} {mb:+.2f}" for name, mb in lasting.items()))
    return [f"{name} goes on growing, by {mb:.1f} MB" for name, mb in lasting.items() if mb > PLAY_MB]


def judge_ticks(done: GraphRun, raw: RawBag, noise: HostNoise, sample_time_s: float) -> list[str]:
    """Print who missed how many ticks; the broken promises."""
    missed = missed_ticks([values for name, values in health_reports(raw) if name == PLANT], sample_time_s)
    ours = missed_by_us(missed, sample_time_s, noise.stalls)
    untold = done.missed_ticks - len(missed)
    causes = f"while the machine stood still {len(missed) - len(ours)}, by our code {len(ours)}, untold {untold}"
    print(f"ticks missed: {done.missed_ticks}; {causes}")
    for each in ours:
        end_s = each.began_s + sample_time_s + (0.0 if math.isnan(each.late_s) else each.late_s)
        still_ms = 1e3 * lost_s(np.reshape(noise.stalls, (-1, 2)), each.began_s, end_s)
        came = "never came" if math.isnan(each.late_s) else f"{1e3 * each.late_s:.1f} ms late"
        print(f"  by our code: tick {each.tick}, command {came}, machine stood still {still_ms:.1f} ms")
    latest = f"the latest {noise.max_ms:.1f} ms ({noise.scheduling})"
    print(f"late wake-ups of idle processes: {noise.long} by more than {1e3 * STALL_S:g} ms, {latest}")
    overruns = {name: HealthReport.read(values).overruns or 0 for name, values in health_reports(raw)}
    print("overruns: " + ", ".join(f"{name} {count}" for name, count in sorted(overruns.items())))
    broken = [f"{len(ours)} ticks missed by our code"] * bool(ours)
    return broken + [f"{untold} missed ticks of which nobody told"] * (untold > 0)


def judge_bag(done: GraphRun, raw: RawBag) -> list[str]:
    """Print what is not in the bag; the broken promises."""
    missing = missing_messages(raw, done.ticks)
    lost = lost_messages(missing, done.missed_ticks, health_reports(raw))
    complete = read_bag(done.bag).metadata["complete"]
    print(
        f"messages missing: {missing or 'none'}, more than were left unsent: {lost or 'none'}; bag complete: {complete}"
    )
    broken = [f"{name}: {count} messages missing" for name, count in lost.items()]
    return broken + ["the bag is not complete"] * (not complete)


if __name__ == "__main__":
    sys.exit(main())
