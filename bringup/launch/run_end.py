"""Follows a run to its end: progress, a loop that stands still, a bag that lacks messages."""

import time
from collections.abc import Callable

from ac_common.errors import RunError
from ac_common.topics import PLANT, RECORDER
from bringup.launch.supervisor import Supervisor

#: A loop whose tick has not moved for so long stands still, s.
STUCK_S = 30.0
#: How long after the last tick the recorder may take to have everything, s.
RECORDER_PATIENCE_S = 10.0


def wait_until_done(supervisor: Supervisor, ticks: int, progress: Callable[[int, int], None] | None) -> None:
    """Wait for the plant's last tick, then until the recorder has every message.

    Raises
    ------
    RunError
        When the loop stands still, or messages are missing in the bag.
    """
    shown = -1
    moved_s = time.monotonic()
    while not _is_finished(supervisor):
        supervisor.spin()
        told = supervisor.health.of_plant().tick
        tick = (supervisor.health.of(RECORDER).ticks or 0) if told is None else told
        if tick != shown:
            shown, moved_s = tick, time.monotonic()
            if progress is not None:
                progress(tick, ticks)
        elif supervisor.state(PLANT) not in ("active", ""):
            moved_s = time.monotonic()  # paused, by whoever has the right to
        elif time.monotonic() - moved_s > STUCK_S:
            msg = f"the loop has stood still at tick {tick} for {STUCK_S:g} s{_refusals(supervisor)}"
            raise RunError(msg)
    deadline = time.monotonic() + RECORDER_PATIENCE_S
    while not supervisor.health.of_recorder().complete:
        if time.monotonic() > deadline:
            msg = f"messages are missing in the bag: {supervisor.health.of_recorder().missing}"
            raise RunError(msg)
        supervisor.spin()
    if progress is not None:
        progress(ticks, ticks)


def _is_finished(supervisor: Supervisor) -> bool:
    """Whether the plant has had its last tick; when it says nothing, whether the bag has."""
    plant = supervisor.health.of_plant()
    return plant.finished or (plant.tick is None and supervisor.health.of_recorder().complete)


def _refusals(supervisor: Supervisor) -> str:
    """Return what the nodes have refused: why a loop may stand still."""
    said = [
        f"{name} refused {report.rejected_inputs} messages, the last: {report.last_rejected}"
        for name, report in ((name, supervisor.health.of(name)) for name in supervisor.health)
        if report.rejected_inputs
    ]
    return "; " + "; ".join(said) if said else ""
