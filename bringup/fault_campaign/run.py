"""Runs the plans of a campaign through the graph of processes, on the wall clock, and gathers what is left."""

import contextlib
import json
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ac_common.errors import BringupError
from ac_common.files import write_whole
from ac_common.health import HealthReport, missed_ticks
from ac_common.topics import BY_NAME, COMPENSATOR, CONTROLLER, INJECTOR, PLANT
from ac_common.units import KPA
from ac_common.wire import NANOSECONDS, columns, stamps_ns
from ac_design import design_controller
from ac_experiments.bags.reader import RawBag, first_stamp_ns, health_reports, loop_messages, read_bag, read_raw
from ac_experiments.report.nodes import reports_of
from bringup.benchmarks.figures import host_noise, start_host_noise
from bringup.fault_campaign.checks import Evidence, Limits, Verdict, judge
from bringup.fault_campaign.plan import Plan, ProcessFault, plan
from bringup.launch.launch import GraphRun, run_graph
from bringup.launch.user_nodes import OwnNodes

COMMAND = BY_NAME["controller/command"]


@dataclass(frozen=True)
class Outcome:
    """One seed: what was done, and which promises were kept."""

    plan: Plan
    verdicts: tuple[Verdict, ...]
    seconds: float

    @property
    def broken(self) -> list[Verdict]:
        """Promises that were not kept."""
        return [verdict for verdict in self.verdicts if verdict.kept is False]


def run_seed(seed: int, folder: Path, duration_s: float, progress: Callable[[int, int], None] | None = None) -> Outcome:
    """Run one seed; the bag, the logs and the plan stay in `folder`."""
    started_s = time.monotonic()
    folder = folder.resolve()
    chosen = plan(seed, duration_s)
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "plan.json"
    content = {"seed": seed, "messages": [asdict(fault) for fault in chosen.messages], "happens": chosen.lines()}
    write_whole(file, json.dumps(content, indent=2) + "\n")
    own = OwnNodes({INJECTOR: [sys.executable, "-m", "bringup.fault_campaign.lossy_injector", str(file)]})
    attacker = Attacker(chosen.processes, folder)

    def follow(tick: int, ticks: int) -> None:
        if tick > 0:
            attacker.begin(tick * chosen.scenario.sample_time_s)
        if progress is not None:
            progress(tick, ticks)

    run, problem = None, ""
    probes = start_host_noise(duration_s + 60.0)
    try:
        run = run_graph(
            chosen.scenario, folder, mode="realtime", progress=follow, own=own, say=lambda _: None, care=True
        )
    except BringupError as failure:
        if not any((folder / "bag").glob("*.mcap")):
            raise  # it has not begun: nothing of the plan is to blame
        problem = str(failure)
    finally:
        attacker.end()
        noise = host_noise(probes)
    evidence = gather(chosen, folder, run, problem, noise.stalls)
    return Outcome(chosen, tuple(judge(evidence)), time.monotonic() - started_s)


class Attacker:
    """Sends the signals of a plan to the nodes of the run in `folder`, when their time has come."""

    def __init__(self, faults: tuple[ProcessFault, ...], folder: Path) -> None:
        self._faults = faults
        self._folder = folder
        self._over = threading.Event()
        self._thread: threading.Thread | None = None

    def begin(self, run_s: float) -> None:
        """Count from now, when the run is `run_s` old; later calls do nothing."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._attack, args=(time.monotonic() - run_s,), daemon=True)
            self._thread.start()

    def end(self) -> None:
        """Stop: the run is over."""
        self._over.set()
        if self._thread is not None:
            self._thread.join()

    def _attack(self, started_s: float) -> None:
        for fault in self._faults:
            if self._over.wait(max(started_s + fault.at_s - time.monotonic(), 0.0)):
                return
            pid = node_process(fault.node, self._folder)
            if pid is None:
                continue
            if fault.kind == "kill":
                os.kill(pid, signal.SIGKILL)
                continue
            os.kill(pid, signal.SIGSTOP)
            try:
                self._over.wait(fault.lasts_s)
            finally:
                if node_process(fault.node, self._folder) == pid:
                    os.kill(pid, signal.SIGCONT)


def node_process(node: str, folder: Path) -> int | None:
    """Process of a node of the run whose results go to `folder`, among the children of this process."""
    parameters = os.fsencode(folder / "log" / f"{node}.yaml")
    for pid in Path(f"/proc/self/task/{os.getpid()}/children").read_text().split():
        try:
            words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
        except OSError:
            continue  # gone meanwhile
        if parameters in words:
            return int(pid)
    return None


def gather(
    chosen: Plan, folder: Path, run: GraphRun | None, problem: str, stalls: Sequence[tuple[float, float]]
) -> Evidence:
    """What a run has left, for the checks; `stalls` on the monotonic clock."""
    scenario = chosen.scenario
    design = design_controller(scenario.operating_point, scenario.sample_time_s)
    limits = Limits(design.command_min, design.command_max, design.command_rate * scenario.sample_time_s)
    recording, raw = read_bag(folder / "bag"), read_raw(folder / "bag")
    messages = loop_messages(raw, COMMAND)
    stamps = stamps_ns(messages)
    order = np.argsort(stamps, kind="stable")
    first = first_stamp_ns(raw)
    first_s = first / NANOSECONDS + time.monotonic() - time.time()  # stamps are the wall clock's
    rejected: dict[str, dict[str, int]] = {}
    reports = list(health_reports(raw))
    missed = missed_ticks([values for name, values in reports if name == PLANT], scenario.sample_time_s)
    for name, values in reports:
        for reason, count in HealthReport.read(values).rejected.items():
            by_reason = rejected.setdefault(name, {})
            by_reason[reason] = max(by_reason.get(reason, 0), count)
    return Evidence(
        plan=chosen,
        problem=problem,
        ticks=len(recording.time_s),
        command=np.column_stack(columns(COMMAND, messages))[order],
        command_s=(stamps[order] - first) / NANOSECONDS,
        pressure_kpa=recording.series["plant/evaporator_pressure"] / KPA,
        superheat_k=recording.series["plant/superheat"],
        restarts=run.restarts if run is not None else (),
        rejected=rejected,
        limits=limits,
        left=_left(folder),
        told={each.tick for each in missed},
        stand_ins=_stand_ins(raw),
        stalls=[(due_s - first_s, woke_s - first_s) for due_s, woke_s in stalls],
    )


def _stand_ins(raw: RawBag) -> list[tuple[float, str, int, int]]:
    """See `Evidence.stand_ins`."""
    found = []
    for report in reports_of(raw):
        if report.node in (COMPENSATOR, CONTROLLER):
            most_missing = max(report.health.missing.values(), default=0)
            found.append((report.time_s, report.node, report.health.ticks or 0, most_missing))
    return found


def _left(folder: Path) -> list[str]:
    """Nodes of the run that are still there, as anybody's children."""
    files = {os.fsencode(file): file.stem for file in (folder / "log").glob("*.yaml")}
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # gone meanwhile
            words = (entry / "cmdline").read_bytes().split(b"\0")
            found += [files[word] for word in words if word in files]
    return sorted(found)


def as_dict(outcome: Outcome) -> dict[str, Any]:
    """One seed for JSON."""
    return {
        "seed": outcome.plan.seed,
        "happens": outcome.plan.lines(),
        "verdicts": [asdict(verdict) for verdict in outcome.verdicts],
        "kept": not outcome.broken,
        "seconds": outcome.seconds,
    }
