"""Other processes of this machine."""

import os

import psutil


def processes_that_mention(text: str) -> list[str]:
    """Command lines of other running processes that contain `text`."""
    lines = {process.pid: " ".join(process.info["cmdline"] or []) for process in psutil.process_iter(["cmdline"])}
    return [line for pid, line in lines.items() if pid != os.getpid() and text in line]
