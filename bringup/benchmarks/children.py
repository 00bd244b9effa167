"""Which of this process's children run which node."""

import contextlib

import psutil

from bringup.launch.process_table import PROCESSES


def node_processes() -> dict[str, psutil.Process]:
    """Return the process of each node that is a child of this process, by the node's name."""
    found = {}
    for child in psutil.Process().children():
        with contextlib.suppress(psutil.Error):  # gone meanwhile
            words = child.cmdline()
            name = next((name for name, process in PROCESSES.items() if process.module in words), None)
            if name is not None:
                found[name] = child
    return found


def resident_mb(process: psutil.Process) -> float:
    """Return the resident memory of a process."""
    return float(process.memory_info().rss) / 2**20
