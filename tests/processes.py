"""Other processes of this machine."""

import os
from pathlib import Path


def processes_that_mention(text: str) -> list[str]:
    """Command lines of other running processes that contain `text`."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal() and int(entry.name) != os.getpid():
            try:
                line = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
            except OSError:
                continue  # gone meanwhile
            if text in line:
                found.append(line)
    return found
