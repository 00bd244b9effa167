"""Which of this process's children run which node."""

import os
from pathlib import Path

from bringup.launch.node_modules import MODULES


def node_pids() -> dict[str, int]:
    """Process of each node that is a child of this process, by the node's name."""
    found = {}
    for pid in Path(f"/proc/self/task/{os.getpid()}/children").read_text().split():
        try:
            words = Path(f"/proc/{pid}/cmdline").read_bytes().decode().split("\0")
        except OSError:
            continue  # gone meanwhile
        name = next((name for name, module in MODULES.items() if module in words), None)
        if name is not None:
            found[name] = int(pid)
    return found


def resident_mb(pid: int) -> float:
    """Resident memory of a process."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20
