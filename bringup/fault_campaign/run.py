"""Runs the plans of a campaign through the graph of processes, on the wall clock."""

import contextlib
import json
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import psutil

from ac_common.errors import UserError
from ac_common.files import write_whole
from ac_common.topics import INJECTOR
from ac_experiments.campaign.checks import Verdict, judge
from ac_experiments.campaign.evidence import gather
from ac_experiments.campaign.plan import Plan, ProcessFault, plan
from bringup.benchmarks.figures import host_noise, start_host_noise
from bringup.launch.launch import run_graph
from bringup.launch.user_nodes import UserNodes


@dataclass(frozen=True)
class Outcome:
    """One seed: what was done, and which promises were kept."""

    plan: Plan
    verdicts: tuple[Verdict, ...]
    seconds: float

    @property
    def broken(self) -> list[Verdict]:
        """Return the promises that were not kept."""
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
    lossy = UserNodes({INJECTOR: [sys.executable, "-m", "bringup.fault_campaign.lossy_injector", str(file)]})
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
            chosen.scenario, folder, mode="realtime", progress=follow, user=lossy, say=lambda _: None, care=True
        )
    except UserError as failure:
        if not any((folder / "bag").glob("*.mcap")):
            raise  # it has not begun: nothing of the plan is to blame
        problem = str(failure)
    finally:
        attacker.end()
        noise = host_noise(probes)
    restarts = run.restarts if run is not None else ()
    evidence = gather(chosen, folder / "bag", problem, restarts, _left(folder), noise.stalls)
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
            process = node_process(fault.node, self._folder)
            if process is None:
                continue
            if fault.kind == "kill":
                process.kill()
                continue
            process.suspend()
            try:
                self._over.wait(fault.lasts_s)
            finally:
                with contextlib.suppress(psutil.NoSuchProcess):  # killed meanwhile, as a node that hangs
                    process.resume()


def node_process(node: str, folder: Path) -> psutil.Process | None:
    """Return the process of a node of the run whose results go to `folder`, among the children of this process."""
    parameters = str(folder / "log" / f"{node}.yaml")
    for child in psutil.Process().children():
        with contextlib.suppress(psutil.Error):  # gone meanwhile
            if parameters in child.cmdline():
                return child
    return None


def _left(folder: Path) -> list[str]:
    """Return the nodes of the run that are still there, as anybody's children."""
    files = {str(file): file.stem for file in (folder / "log").glob("*.yaml")}
    lines = [process.info["cmdline"] or [] for process in psutil.process_iter(["cmdline"])]
    return sorted(files[word] for words in lines for word in words if word in files)


def as_dict(outcome: Outcome) -> dict[str, Any]:
    """Return what came of one seed, for JSON."""
    return {
        "seed": outcome.plan.seed,
        "happens": outcome.plan.lines(),
        "verdicts": [asdict(verdict) for verdict in outcome.verdicts],
        "kept": not outcome.broken,
        "seconds": outcome.seconds,
    }
