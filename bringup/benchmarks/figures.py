"""Benchmarks of the graph, each beside what it is measured against: speed, start, latency, memory, processor time."""

import json
import math
import os
import select
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ac_common.errors import RunError
from ac_common.topics import PLANT, RECORDER
from ac_experiments.scenario import load
from ac_ros_common.process_exit import PARENT_VARIABLE
from bringup.benchmarks import loop_speed
from bringup.benchmarks.children import node_processes, resident_mb
from bringup.benchmarks.figure import Figure
from bringup.benchmarks.host_noise import missed_by_us
from bringup.benchmarks.recovery import recovery
from bringup.launch.launch import GraphRun, run_graph
from bringup.launch.process_table import LOOP_NODES, PROCESSES
from bringup.launch.processes import Domain, end_groups, ros_environment

Say = Callable[[str], None]

#: How long the processes of the bare chain may take to find each other, s, and a tick that goes as fast as it can.
START_S, MOST_S = 60.0, 1.0


def bench(ticks: int = 1000, rounds: int = 3, realtime_s: float = 60.0, say: Say = lambda _: None) -> list[Figure]:
    """Measure all figures of the graph.

    Parameters
    ----------
    ticks
        Of one lockstep run.
    rounds
        Lockstep runs of graph and bare chain, in turn; the median counts.
    realtime_s
        Length of the run at 100 Hz.
    say
        Told what is being measured.
    """
    say("the loop in one process")
    quiet, noisy = (loop_speed.loop_seconds(noise) for noise in (False, True))
    with tempfile.TemporaryDirectory(prefix="acftc-bench-") as folder:
        out = Path(folder)
        say("warm-up: designs and compiled code into their caches")
        _run(out, 1.0, 0.1)
        _run(out, 0.2, 0.01, mode="realtime")
        graph, bare, starts = [], [], []
        for number in range(rounds):
            say(f"lockstep, round {number + 1} of {rounds}: the graph, recording")
            run = _run(out, ticks * 0.1, 0.1)
            graph.append(run.ticks / run.wall_seconds)
            starts.append(run.start_seconds)
            say(f"lockstep, round {number + 1} of {rounds}: the bare chain")
            bare.append(bare_chain(ticks)["ticks_per_second"])
        say(f"realtime at 100 Hz for {realtime_s:g} s")
        probes = start_host_noise(realtime_s + 60.0)
        fast = _run(out, realtime_s, 0.01, mode="realtime", care=True)
        noise = host_noise(probes)
        by_us = len(missed_by_us(fast.missed, 0.01, noise.stalls))
        by_machine = len(fast.missed) - by_us
        say("the bare chain at 100 Hz")
        paced = bare_chain(round(min(realtime_s, 20.0) / 0.01), 0.01)
        say("realtime at 10 Hz for 15 s: memory and processor time")
        use = _Use()
        _run(out, 15.0, 0.1, mode="realtime", progress=use.look)
        say("realtime at 10 Hz for 40 s: nodes are killed")
        recovered = recovery(out)
    speed, yardstick = statistics.median(graph), statistics.median(bare)
    p50, p99, most = fast.latency_ms
    figures = [
        Figure("1000 s of loop in one process (beside: plant)", "s", quiet[0], loop_speed.LIMIT_S, reference=quiet[1]),
        Figure("  with noise, which makes the plant work more", "s", noisy[0], reference=noisy[1]),
        Figure("lockstep speed, recording", "ticks/s", speed, reference=yardstick),
        Figure("  as a share of the bare chain", "", speed / yardstick, 0.6, at_least=True),
        Figure("  as a multiple of real time at 10 Hz", "", speed * 0.1, 13.0, at_least=True),
        Figure("from the call to the first tick", "s", statistics.median(starts), 4.0),
        Figure("realtime 100 Hz: ticks missed", "", float(fast.missed_ticks)),
        Figure("  missed while the machine stood still", "", float(by_machine)),
        Figure("  missed by our code", "", float(by_us), 0.0),
        Figure("  late wake-ups of idle processes (> 5 ms)", "", float(noise.long)),
        Figure("  latest wake-up of an idle process", "ms", noise.max_ms),
        Figure("  measurement to command, p50", "ms", p50, reference=paced["latency_p50_ms"]),
        Figure("  measurement to command, p99", "ms", p99, reference=paced["latency_p99_ms"]),
        Figure("  measurement to command, max", "ms", most, reference=paced["latency_max_ms"]),
        Figure("processor time of the graph at 10 Hz", "% of one core", use.processor_percent(), 60.0),
    ]
    memory = use.memory_mb()
    figures += [
        Figure(f"memory of {name}", "MB", memory[name], 250.0 if name == PLANT else 120.0)
        for name in PROCESSES
        if name in memory
    ]
    return figures + recovered


def _run(out: Path, duration_s: float, sample_time_s: float, **options: Any) -> GraphRun:
    overrides = [f"duration_s={duration_s:g}", f"sample_time_s={sample_time_s:g}"]
    return run_graph(load("nominal", [*overrides, "references={}", "air={}", "faults=[]"]), out, **options)


class _Use:
    """Memory and processor time of the nodes that this process has started, looked at while a run goes on."""

    def __init__(self) -> None:
        self._first: tuple[float, float] | None = None
        self._last = (0.0, 0.0)
        self._memory: dict[str, float] = {}

    def look(self, done: int, _ticks: int) -> None:
        """Take a look; a progress function of `run_graph`."""
        processes = node_processes()
        if done == 0 or len(processes) < len(PROCESSES):
            return
        seconds = 0.0
        for name, process in processes.items():
            used = process.cpu_times()
            seconds += used.user + used.system
            self._memory[name] = max(self._memory.get(name, 0.0), resident_mb(process))
        self._last = (time.monotonic(), seconds)
        if self._first is None:
            self._first = self._last

    def processor_percent(self) -> float:
        """Return the share of one core that all children together took."""
        if self._first is None or self._last[0] <= self._first[0]:
            return float("nan")
        return 100.0 * (self._last[1] - self._first[1]) / (self._last[0] - self._first[0])

    def memory_mb(self) -> dict[str, float]:
        """Return the largest resident memory of each node."""
        return self._memory


@dataclass(frozen=True)
class HostNoise:
    """What idle processes, one on each processor, have seen of the machine.

    Attributes
    ----------
    stalls : (due, woken) of each late wake-up, s on the monotonic clock, in order.
    long : how many of them were late by more than `STALL_S`.
    max_ms : how late the latest was.
    scheduling : of these processes.
    """

    stalls: tuple[tuple[float, float], ...]
    long: int
    max_ms: float
    scheduling: str


def start_host_noise(duration_s: float) -> "list[subprocess.Popen[str]]":
    """Watch, on each processor, how late the machine wakes a process that is always next: `host_noise`."""
    return [
        subprocess.Popen(
            [sys.executable, "-m", "bringup.benchmarks.host_noise", f"{duration_s:g}", str(processor)],
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, PARENT_VARIABLE: str(os.getpid())},
            process_group=0,
        )
        for processor in sorted(os.sched_getaffinity(0))
    ]


def host_noise(probes: "list[subprocess.Popen[str]]") -> HostNoise:
    """End the probes; what they have seen: nothing when they had not begun yet."""
    for probe in probes:
        probe.terminate()
    seen = [json.loads(said) for probe in probes if (said := probe.communicate()[0])]
    if not seen:
        return HostNoise((), 0, math.nan, "")
    stalls = sorted((due_s, woke_s) for each in seen for due_s, woke_s in each["stalls_at"])
    most_ms = max(each["max_ms"] for each in seen)
    return HostNoise(tuple(stalls), sum(each["stalls"] for each in seen), most_ms, seen[0]["scheduling"])


def bare_chain(ticks: int, period_s: float = 0.0) -> dict[str, float]:
    """Return the figures of the bare chain over `ticks`: see `bringup.benchmarks.bare_chain`."""
    domain = Domain()
    try:
        return _bare_chain(ticks, period_s, domain.number)
    finally:
        domain.release()


def _bare_chain(ticks: int, period_s: float, domain: int) -> dict[str, float]:
    environment = {**os.environ, **ros_environment(), "ROS_DOMAIN_ID": str(domain)}
    environment[PARENT_VARIABLE] = str(os.getpid())
    processes = {
        name: subprocess.Popen(
            [sys.executable, "-m", "bringup.benchmarks.bare_chain", name, str(ticks), str(period_s)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
            process_group=0,
        )
        for name in (*LOOP_NODES, RECORDER)
    }
    try:
        for name, process in processes.items():
            if _line(process, START_S) != "ready":
                ended = [other for other, its in processes.items() if its.poll() is not None]
                msg = f"the bare chain's {', '.join(ended or [name])} did not start"
                raise RunError(msg)
        plant = processes[PLANT]
        assert plant.stdin is not None
        plant.stdin.write("go\n")
        plant.stdin.flush()
        said = _line(plant, START_S + ticks * max(period_s, MOST_S))
        if not said:
            msg = "the bare chain does not move"
            raise RunError(msg)
        figures: dict[str, float] = json.loads(said)
        return figures
    finally:
        end_groups(list(processes.values()))
        for process in processes.values():
            process.communicate()  # closes its pipes


def _line(process: "subprocess.Popen[str]", patience_s: float) -> str:
    """Return one line that a process says next; nothing when it has ended, or takes longer."""
    assert process.stdout is not None
    says, _, _ = select.select([process.stdout], [], [], patience_s)
    return process.stdout.readline().strip() if says else ""


def as_dicts(figures: list[Figure]) -> list[dict[str, Any]]:
    """Return the figures for JSON."""
    return [{**asdict(figure), "name": figure.name.strip(), "passed": figure.passed} for figure in figures]
