"""A process that does something for a scenario beside, on a processor that would be idle.

Nobody depends on it: what it has not made is made by who asks for it. So it says nothing when it fails.
"""

import json
import os
import pickle
import subprocess
import sys
import tempfile
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from ac_common import collector
from ac_common.design_file import ENVELOPE
from ac_common.topics import COMPENSATOR, CONTROLLER, FDI
from ac_experiments.designs import design_for, write_designs_of
from ac_experiments.scenario import check
from ac_experiments.scenario_schema import Scenario
from ac_plant_node.rest import prepare
from ac_ros_common.process_exit import PARENT_VARIABLE, end_with_parent
from bringup.launch.processes import end_groups

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from ac_experiments.recording import Recording


class Beside:
    """Does one of `TASKS` from `start` until it is done or the context is left."""

    def __init__(self, task: str) -> None:
        self._task = task
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        self._given, self._made = tempfile.TemporaryFile(), tempfile.TemporaryFile()  # pipes would have to be served
        return self

    def __exit__(
        self, kind: type[BaseException] | None, problem: BaseException | None, where: TracebackType | None
    ) -> None:
        if self._process is not None and self._process.poll() is None:
            end_groups([self._process], patience_s=0.0)
        self._given.close()
        self._made.close()

    def start(self, scenario: Scenario) -> None:
        """Start, unless that has been done."""
        if self._process is not None:
            return
        self._given.write(scenario.model_dump_json().encode())
        self._given.seek(0)
        self._process = subprocess.Popen(
            [sys.executable, "-m", __name__, self._task],
            stdin=self._given,
            stdout=self._made,
            stderr=subprocess.DEVNULL,
            env={**os.environ, PARENT_VARIABLE: str(os.getpid())},
            process_group=0,
        )

    def result(self) -> Any:
        """Return what has been made, once it is done; None when it failed or was never started."""
        if self._process is None or self._process.wait() != 0:
            return None
        self._made.seek(0)
        return pickle.load(self._made)


def prepare_nodes(scenario: Scenario, folder: "Path") -> None:
    """Put into the cache what nodes load, which takes half a minute the first time, and into `folder` their designs.

    Raises
    ------
    UserError
        As `ac_experiments.designs.write_designs_of`.
    """
    with collector.paused(), Beside(_OBSERVER) as observer:
        is_first = scenario.design == ENVELOPE and not _observer_is_compiled()
        if is_first:
            observer.start(scenario)
        prepare(scenario.operating_point)
        if is_first:  # meanwhile there is time for what no node needs, but the simulation beside the run
            for node in (CONTROLLER, COMPENSATOR):
                design_for(node, scenario).try_out()
        observer.result()
    write_designs_of(scenario, folder)


def _observer_is_compiled() -> bool:
    from fdi_node.envelope.ahead import is_compiled

    return is_compiled()


def _compile_observer(scenario: Scenario) -> None:
    from fdi_node.envelope.ahead import compile_first, compile_rest

    compile_first()
    compile_rest(design_for(FDI, scenario))


def _simulate_passive(scenario: Scenario) -> "Recording":
    from ac_experiments.simulate import simulate

    os.nice(19)  # the loop goes first
    return simulate(scenario, passive=True, compile_loop=False)


_OBSERVER, PASSIVE = "observer", "passive"
TASKS: "dict[str, Callable[[Scenario], Any]]" = {_OBSERVER: _compile_observer, PASSIVE: _simulate_passive}
"""What can be done beside: compile the observer; simulate the passive run of a scenario."""


def main() -> None:
    """Do a task for the scenario on stdin; what it makes goes to stdout."""
    end_with_parent()
    with collector.paused():
        made = TASKS[sys.argv[1]](check(json.load(sys.stdin)))
    pickle.dump(made, sys.stdout.buffer)


if __name__ == "__main__":
    main()
