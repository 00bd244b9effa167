"""Child processes that never outlive their parent, and the environment that ROS nodes want."""

import contextlib
import errno
import fcntl
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import IO, Any

from ac_common.blas_threads import VARIABLE as BLAS_THREADS
from ac_common.errors import UserError
from ac_ros_common.exit_watchdog import STOOD
from ac_ros_common.installation import check_environment, users_environment
from ac_ros_common.process_exit import DISK_FULL, PARENT_VARIABLE, PATIENCE_S

#: Times of Fast DDS for wherever discovery goes, and the same with messages over 127.0.0.1 alone.
_CONFIG = Path(__file__).parents[1] / "config"
FASTDDS_PROFILE, FASTDDS_THIS_HOST = _CONFIG / "fastdds.xml", _CONFIG / "fastdds_this_host.xml"
_RANGE, _PROFILE = "ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTRTPS_DEFAULT_PROFILES_FILE"
#: Domains that Linux leaves free of ephemeral ports.
DOMAINS = range(102)

#: How often a process group whose leader has ended is looked at, s.
LOOK_S = 0.02


def ros_environment() -> dict[str, str]:
    """Return what the middleware needs where the user has not said otherwise: stay on this host, discover quickly."""
    defaults = {
        _RANGE: "LOCALHOST",
        _PROFILE: str(FASTDDS_PROFILE),
        "AMENT_PREFIX_PATH": sys.prefix,
        BLAS_THREADS: "1",
    }
    wanted = {name: value for name, value in defaults.items() if name not in os.environ}
    if os.environ.get(_RANGE, "LOCALHOST") == "LOCALHOST" and _may_use_this_host_profile():
        # The range LOCALHOST would add shared memory, whatever the profile says; this one says by itself where to stay.
        wanted |= {_RANGE: "SYSTEM_DEFAULT", _PROFILE: str(FASTDDS_THIS_HOST)}
    return wanted


def _may_use_this_host_profile() -> bool:
    """Whether the middleware is Fast DDS and the user has left its profile and its peers to us."""
    fast_dds = os.environ.get("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp").startswith("rmw_fastrtps")
    return fast_dds and _PROFILE not in os.environ and "ROS_STATIC_PEERS" not in os.environ


class Domain:
    """A ROS domain for one run: the user's ROS_DOMAIN_ID, else the first from 0 on that no other run of ours uses."""

    def __init__(self) -> None:
        check_environment()
        chosen = os.environ.get("ROS_DOMAIN_ID")
        for number in [int(chosen)] if chosen is not None else DOMAINS:
            lock = _lock(number)
            if lock is not None:
                self.number, self._lock = number, lock
                return
        which = f"ROS domain {chosen} is" if chosen is not None else "all ROS domains are"
        msg = f"{which} in use by another run on this machine; wait for it or set ROS_DOMAIN_ID to a free one"
        raise UserError(msg)

    def release(self) -> None:
        """Let others have the domain."""
        self._lock.close()


def _lock(number: int) -> IO[Any] | None:
    path = Path(tempfile.gettempdir()) / f"acftc-{os.getuid()}-domain-{number}.lock"
    file = path.open("a")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        file.close()
        return None
    return file


@dataclass
class Child:
    """One node's process, with its output in a log file."""

    name: str
    process: subprocess.Popen[bytes]
    log: Path

    @property
    def end(self) -> str:
        """Return how the process ended: signal or exit code."""
        code = self.process.returncode
        if code is None:
            return "running"
        if code >= 0:
            return f"exit code {code}"
        return signal.Signals(-code).name if -code in {s.value for s in signal.Signals} else f"signal {-code}"

    def last_words(self) -> str:
        """Return the last line that the process wrote."""
        try:
            lines = self.log.read_text(encoding="utf-8", errors="replace").split("\n")
        except OSError:
            return ""
        said = [line.strip() for line in takewhile(lambda line: not line.startswith(STOOD), lines) if line.strip()]
        if said:
            return said[-1]
        return os.strerror(errno.ENOSPC) if self.process.returncode == DISK_FULL else "it wrote nothing"


def start(
    name: str,
    arguments: Sequence[str],
    log_folder: Path,
    environment: Mapping[str, str],
    program: str = sys.executable,
    append: bool = False,
) -> Child:
    """Start ``python arguments...``, or another program, in a process group of its own; `append`: to the log so far.

    A program that is not this Python gets the ROS installation that its user has sourced.
    """
    given = {**os.environ, **environment, PARENT_VARIABLE: str(os.getpid())}
    log = log_folder / f"{name}.log"
    with log.open("ab" if append else "wb") as output:
        process = subprocess.Popen(
            [program, *arguments],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            env=given if program == sys.executable else users_environment(given),
            process_group=0,
        )
    return Child(name, process, log)


def stop(children: Iterable[Child], patience_s: float = PATIENCE_S) -> None:
    """End all children: see `end_groups`."""
    end_groups([child.process for child in children], patience_s)


def end_groups(leaders: Sequence["subprocess.Popen[Any]"], patience_s: float = PATIENCE_S) -> None:
    """End processes that lead groups of their own: ask, wait, and insist; nothing of the groups is left afterwards."""
    for leader in leaders:
        _signal(leader, signal.SIGTERM)  # to the group: a shell that started the node may be gone, and the node not
    deadline = time.monotonic() + patience_s
    for leader in leaders:
        with contextlib.suppress(subprocess.TimeoutExpired):
            leader.wait(max(deadline - time.monotonic(), 0.01))
        while _signal(leader, 0) and time.monotonic() < deadline:
            time.sleep(LOOK_S)  # nothing announces that a group is empty
        _signal(leader, signal.SIGKILL)
        leader.wait()


def _signal(leader: "subprocess.Popen[Any]", number: int) -> bool:
    """Send a signal to a process group; whether there was anybody in it."""
    try:
        os.killpg(leader.pid, number)
    except (ProcessLookupError, PermissionError):
        return False
    return True
