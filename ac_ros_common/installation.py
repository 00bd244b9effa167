"""Which ROS 2 this interpreter uses, and an environment in which no other comes first.

A virtual environment with the ROS wheels has a ROS 2 of its own. What a sourced ``setup.bash`` of another one has put
on PYTHONPATH and LD_LIBRARY_PATH would come before it, and the two do not fit together. So a program of ours drops it
and starts itself once more. Without wheels (a colcon workspace) the sourced installation is the one that is used.

Imports no ROS, and nothing that Python 3.9 cannot read: `start.py` uses it, too.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import sysconfig
from pathlib import Path
from typing import TYPE_CHECKING

from ac_common.errors import UserError, shortened

if TYPE_CHECKING:
    from collections.abc import Mapping

#: Set by the wheels in a process that has their libraries on LD_LIBRARY_PATH.
GUARD = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"
#: Remembers, as JSON, what was dropped from the environment: a program of the user's may want it.
LEFT_ASIDE = "ACFTC_LEFT_ASIDE"
#: Set once the user has been told of it.
_TOLD = f"{LEFT_ASIDE}_TOLD"
#: What a sourced installation sets: paths of which some entries may be the user's, and single words.
_PATHS = ("PYTHONPATH", "LD_LIBRARY_PATH", "AMENT_PREFIX_PATH")
_MIDDLEWARE, _DOMAIN = "RMW_IMPLEMENTATION", "ROS_DOMAIN_ID"
#: Exit code of a program that was interrupted.
INTERRUPTED = 130
#: Beyond it the ports that DDS computes from a domain's number do not exist.
LAST_DOMAIN = 232


class EnvironmentProblem(UserError):  # noqa: N818  (reads as what it is)
    """An environment with which no middleware can start; the message is one line."""


def has_wheels() -> bool:
    """Return whether this interpreter's environment holds the ROS wheels."""
    return (Path(sysconfig.get_path("purelib")) / "ros_wheels_bootstrapper").is_dir()


def without_foreign(environment: Mapping[str, str], own: Path) -> tuple[dict[str, str], dict[str, str]]:
    """Return an environment without what belongs to ROS installations other than `own`, and what was dropped of it.

    Parameters
    ----------
    environment : mapping of str to str
    own : Path
        Prefix of the environment that has a ROS 2 of its own.

    Returns
    -------
    tuple of dict, dict
        Entries of a path that stand outside of any installation stay. RMW_IMPLEMENTATION goes with the installation
        that it was set for, unless `own` has such a middleware.
    """
    kept, dropped = dict(environment), {}
    for name in _PATHS:
        entries = [entry for entry in environment.get(name, "").split(os.pathsep) if entry]
        foreign = [entry for entry in entries if _is_foreign(Path(entry), own)]
        if foreign:
            dropped[name] = os.pathsep.join(foreign)
            kept[name] = os.pathsep.join(entry for entry in entries if entry not in foreign)
            if not kept[name]:
                del kept[name]
    middleware = environment.get(_MIDDLEWARE)
    if dropped and middleware and not _library(middleware, own / "lib").exists():
        dropped[_MIDDLEWARE] = kept.pop(_MIDDLEWARE)
    if dropped:
        kept.pop(GUARD, None)
        kept[LEFT_ASIDE] = json.dumps(dropped)
    return kept, dropped


def use_own_ros() -> None:
    """Start this program again without what belongs to another ROS installation, where that is in the way.

    To be called before anything imports rclpy.
    """
    own = Path(sys.prefix)
    if has_wheels():
        kept, dropped = without_foreign(os.environ, own)
        if GUARD in os.environ and str(own / "lib") not in os.environ.get("LD_LIBRARY_PATH", "").split(os.pathsep):
            kept.pop(GUARD, None)  # inherited from another environment's process
            dropped.setdefault(GUARD, "")
        if dropped:
            sys.stdout.flush()
            sys.stderr.flush()
            os.execve(sys.executable, sys.orig_argv, kept)


def program_name() -> str:
    """Return what this program is called in messages: the package, when that was started with ``python -m``."""
    program = Path(sys.argv[0])
    return program.parent.name if program.name == "__main__.py" else program.name


def begin_node() -> None:
    """Do what a node's program has to do before anything imports rclpy; what cannot be ends it with code 2."""
    use_own_ros()
    signal.signal(signal.SIGINT, lambda *_: os._exit(INTERRUPTED))  # while it loads there is nothing to close
    try:
        check_environment()
    except EnvironmentProblem as problem:
        print(f"{program_name()}: {problem}", file=sys.stderr, flush=True)
        sys.exit(problem.exit_code)


def check_environment() -> None:
    """Refuse a middleware that is not there and a domain that cannot be: the middleware's own words help nobody.

    Raises
    ------
    EnvironmentProblem
        One line.
    """
    domain = os.environ.get(_DOMAIN)
    if domain is not None and (not domain.isdecimal() or int(domain) > LAST_DOMAIN):
        raise EnvironmentProblem(f"{_DOMAIN} is {shortened(repr(domain))}; allowed: 0 to {LAST_DOMAIN}")
    name = os.environ.get(_MIDDLEWARE)
    if not name:
        return
    folders = [Path(entry) for entry in os.environ.get("LD_LIBRARY_PATH", "").split(os.pathsep) if entry]
    if any(_library(name, folder).exists() for folder in folders):
        return
    found = {file.stem.removeprefix("lib") for folder in folders for file in folder.glob("librmw_*_cpp.so")}
    there = sorted(name for name in found if "__" not in name and not name.endswith("_shared_cpp"))
    if there:
        raise EnvironmentProblem(
            f"{_MIDDLEWARE} is {shortened(repr(name))}, which {installation()} does not have; "
            f"allowed: {', '.join(there)}, or unset it"
        )


def installation() -> str:
    """Return which ROS 2 is in use, for messages."""
    if has_wheels():
        return f"the ROS 2 of {sys.prefix}"
    return f"the ROS 2 of {os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)[-1] or 'this system'}"


def left_aside() -> str:
    """Return in one line which ROS is in use instead of which, once; empty when there is nothing to tell."""
    dropped = json.loads(os.environ.get(LEFT_ASIDE, "{}"))
    if not dropped or os.environ.get(_TOLD):
        return ""
    os.environ[_TOLD] = "1"
    prefixes = {
        str(_prefix(Path(entry))) for name in _PATHS for entry in dropped.get(name, "").split(os.pathsep) if entry
    }
    return f"uses {installation()}, not {', '.join(sorted(prefixes))} ({', '.join(dropped)} left aside)"


def users_environment(environment: Mapping[str, str]) -> dict[str, str]:
    """Return an environment with what `use_own_ros` had dropped put back: for a program of the user's own."""
    dropped = json.loads(environment.get(LEFT_ASIDE, "{}"))
    if not dropped:
        return dict(environment)
    given = {name: value for name, value in environment.items() if name not in (GUARD, LEFT_ASIDE, _TOLD)}
    return {**given, **dropped}


def _is_foreign(entry: Path, own: Path) -> bool:
    prefix = _prefix(entry)
    if prefix is None or prefix.resolve() == own.resolve():
        return False
    return prefix.resolve() not in Path(__file__).resolve().parents  # a workspace that this program is from


def _prefix(entry: Path) -> Path | None:
    """Return the prefix of the ROS installation or workspace that a folder belongs to; None: it belongs to none."""
    for folder in (entry, *entry.parents):
        if (folder / "share" / "ament_index").is_dir():
            return folder
    return entry if (entry / "rclpy").is_dir() or (entry / "librcl.so").exists() else None


def _library(middleware: str, folder: Path) -> Path:
    return folder / f"lib{middleware}.so"
