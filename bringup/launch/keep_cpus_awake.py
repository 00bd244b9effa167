"""Processors that do not doze, where the kernel cannot be asked for that: on each a process that never sleeps.

A processor that has nothing to do is halted. That of a virtual machine is then given to somebody else, and comes back
when its host finds the time. Without a cpuidle driver, as usual there, nobody heeds ``/dev/cpu_dma_latency``. A process
of the policy SCHED_IDLE gets only what no other one wants, needs no permission, and leaves nothing to be halted for.
Not where processor time is rationed, as that of a container may be: these would use up what the loop needs.

``python -m bringup.launch.keep_cpus_awake PROCESSOR`` is one of them.
"""

import contextlib
import os
import sys
from collections.abc import Mapping
from pathlib import Path

from ac_ros_common.process_exit import end_with_parent
from ac_ros_common.realtime import has_idle_driver
from bringup.launch.processes import Child, start

#: Where control groups are, and which of them this process is in.
GROUPS, GROUPS_OF_THIS = Path("/sys/fs/cgroup"), Path("/proc/self/cgroup")
#: In a group's folder: a word that is neither of these is so much processor time, and no more (versions 2 and 1).
RATIONS, UNRATIONED = ("cpu.max", "cpu.cfs_quota_us"), ("max", "-1")


def is_rationed() -> bool:
    """Whether this process's control group, or one around it, may have so much processor time and no more."""
    with contextlib.suppress(OSError):
        for line in GROUPS_OF_THIS.read_text().splitlines():
            _, controllers, path = line.split(":", 2)
            top = GROUPS / controllers if "cpu" in controllers.split(",") else GROUPS
            group = top / path.strip("/")
            if any(_is_rationed(folder) for folder in (group, *group.parents) if folder.is_relative_to(GROUPS)):
                return True
    return False


def _is_rationed(group: Path) -> bool:
    for name in RATIONS:
        with contextlib.suppress(OSError):
            return (group / name).read_text().split()[0] not in UNRATIONED
    return False


def keep_awake(log_folder: Path, environment: Mapping[str, str]) -> list[Child]:
    """Start one on each processor that this process may use, unless the kernel can do without or time is rationed.

    Parameters
    ----------
    log_folder
        Where they log.
    environment
        What they get on top of this process's environment.

    Returns
    -------
    list of Child
        To be stopped; while there are any, nodes find `AWAKE_VARIABLE` in their environment.
    """
    if has_idle_driver() or is_rationed():
        return []
    return [_on(processor, log_folder, environment) for processor in sorted(os.sched_getaffinity(0))]


def _on(processor: int, log_folder: Path, environment: Mapping[str, str]) -> Child:
    return start(
        f"awake_{processor}", ["-m", "bringup.launch.keep_cpus_awake", str(processor)], log_folder, environment
    )


def main() -> None:
    """Be busy with nothing on one processor until told to end."""
    end_with_parent()
    try:
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))  # before anything else: never without it
    except OSError as problem:
        sys.exit(f"SCHED_IDLE: {problem.strerror}")
    os.sched_setaffinity(0, {int(sys.argv[1])})
    while True:
        pass


if __name__ == "__main__":
    main()
