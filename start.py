#!/usr/bin/env python3
"""Make acftc's environment (once), then run a command in it.

    python3 start.py acftc run actuator_fault --out results/actuator_fault
    python3 start.py pytest

Needs Python 3.9 or newer with pip; nothing else, no ROS and no root. It fetches `uv`, which finds (or fetches)
CPython 3.12, and installs what `requirements.txt` pins, hashes checked, into `.venv/` beside this file; what a few
commands need beside (`requirements-extra.txt`, `requirements-dev.txt`) when one of them is called for the first time.
A later call finds the environment ready and only starts the command.
"""

import hashlib
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

from ac_ros_common.installation import without_foreign

HERE = Path(__file__).resolve().parent
VENV = HERE / ".venv"
UV_VERSION = "0.13.9"
LEVELS = ("requirements.txt", "requirements-extra.txt", "requirements-dev.txt")  # each holds all of those before it
RUNTIME, EXTRA, DEVELOPMENT = range(3)
EXTRAS = ("export", "foxglove", "study")  # commands of acftc
DEVELOPERS = ("lint-imports", "mkdocs", "mypy", "pytest", "ruff")
SIZES = ("0.9 GB", "1.2 GB", "2.1 GB")
# Bytecode that nobody runs is not made; of large packages of which little is used, the interpreter makes what it needs.
NO_BYTECODE = "/(tests?|testing|sphinxext|bokeh|cuda|f2py|fontTools|narwhals|plotly|pygments|setuptools)/"
# glibc of Debian 12 and newer, Ubuntu 22.04 and newer: what the ROS wheels are built for.
SYSTEMS = {("Linux", "x86_64"), ("Linux", "aarch64")}


def fail(problem: str, remedy: str) -> "NoReturn":  # noqa: F821  (the name is for readers; Python 3.9 runs this)
    """End with one line: what is wrong, and what to do about it."""
    sys.exit(f"start.py: {problem}; {remedy}")


def call(command: list, problem: str, remedy: str) -> str:
    """Run `command`; what it printed on success, else one clear line after its own output."""
    result = subprocess.run(command, capture_output=True, text=True, cwd=str(HERE))
    if result.returncode != 0:
        sys.stderr.write(result.stderr[-4000:])
        fail(problem, remedy)
    return result.stdout


def find_uv() -> str:
    """Path of `uv`: the user's own, or one that pip puts into `.uv/` (no root, no virtual environment needed)."""
    own = HERE / ".uv" / UV_VERSION
    uv = own / "bin" / "uv"
    if uv.exists():
        return str(uv)
    if shutil.which("uv"):
        return str(shutil.which("uv"))
    call([sys.executable, "-m", "pip", "--version"], "this Python has no pip", "on Debian: apt install python3-pip")
    print("start.py: fetching uv", file=sys.stderr)
    call(
        [sys.executable, "-m", "pip", "install", "--quiet", "--target", str(own), "uv==" + UV_VERSION],
        "pip cannot fetch uv from PyPI",
        "check the network or pip's configuration, or install uv yourself",
    )
    return str(uv)


def level_of(command: list) -> int:
    """Return which of `LEVELS` a command line needs."""
    if command[0] in DEVELOPERS:
        return DEVELOPMENT
    return EXTRA if command[0] == "acftc" and command[1:2] and command[1] in EXTRAS else RUNTIME


def wanted() -> str:
    """Fingerprint of what the environment must hold."""
    files = [HERE / name for name in (*LEVELS, "pyproject.toml", ".python-version")]
    return hashlib.sha256(b"\0".join(file.read_bytes() for file in files) + str(HERE).encode()).hexdigest()


def level_there() -> int:
    """Return which of `LEVELS` the environment holds; -1: none."""
    stamp = VENV / "acftc-environment"
    fingerprint, _, level = stamp.read_text().partition(" ") if stamp.exists() else ("", "", "")
    return int(level) if fingerprint == wanted() and level else -1


def make_environment(level: int) -> None:
    """Bring `.venv/` to what the file of this level pins, and this project into it."""
    there = level_there()
    if there >= level:
        return
    if (platform.system(), platform.machine()) not in SYSTEMS:
        fail(
            f"no ROS 2 wheels exist for {platform.system()} on {platform.machine()}, only for Linux (x86_64, aarch64)",
            "use such a machine or a container",
        )
    uv = find_uv()
    what = "making the environment in .venv" if there < 0 else "adding to the environment what this command needs"
    print(f"start.py: {what} (then {SIZES[level]}, half a minute on a fast line)", file=sys.stderr)
    python = str(VENV / "bin" / "python")
    if there < 0:
        call(
            [uv, "venv", "--quiet", "--clear", "--python", "3.12", str(VENV)],
            "no CPython 3.12 was found or could be fetched",
            "install it (Ubuntu 24.04: apt install python3.12; elsewhere: pyenv install 3.12, uv python install 3.12)",
        )
    pip = [uv, "pip", "install", "--quiet", "--python", python]
    remedy = "see the lines above; a network or disk problem is the usual cause"
    call([*pip, "--require-hashes", "-r", LEVELS[level]], "the pinned packages could not be installed", remedy)
    # A file that does not compile (a template, code for another Python) is none of ours.
    with subprocess.Popen(compiling(VENV / "lib")):
        # With the setuptools that is pinned, not one fetched for this.
        own = [*pip, "--no-deps", "--no-build-isolation", "--editable", "."]
        call(own, "acftc itself could not be installed", remedy)
    (VENV / "COLCON_IGNORE").touch()  # it may stand in a workspace
    (VENV / "acftc-environment").write_text(f"{wanted()} {level}")


def compiling(*further: Path) -> list:
    """Return a command that compiles our own packages, and `further` folders, to bytecode where they are not yet.

    A run starts eight processes at once: without it each would compile the same, and all do again and again where
    PYTHONDONTWRITEBYTECODE is set.
    """
    own = [str(file.parent) for file in sorted(HERE.glob("*/__init__.py"))]
    python = str(VENV / "bin" / "python")
    return [python, "-m", "compileall", "-qq", "-j", "0", "-x", NO_BYTECODE, *own, *map(str, further)]


def main() -> None:
    """Make the environment, then become the command named on the command line."""
    if len(sys.argv) < 2 or sys.argv[1] in ("-h", "--help"):
        print(__doc__)
        return
    make_environment(level_of(sys.argv[1:]))
    bin_dir = VENV / "bin"
    command = bin_dir / sys.argv[1]
    if not command.exists():
        fail(
            f"there is no command {sys.argv[1]!r} in the environment",
            "did you mean acftc, pytest, ruff, mypy or python?",
        )
    # A ROS installation that happens to be sourced would come before the one in the environment.
    if sys.argv[1] == "pytest":  # it starts a thousand processes
        subprocess.run(compiling(), check=False)
    own, _ = without_foreign(os.environ, VENV)
    environment = dict(own, PATH="{}{}{}".format(bin_dir, os.pathsep, os.environ.get("PATH", "")))
    environment["VIRTUAL_ENV"] = str(VENV)
    os.chdir(str(Path.cwd() if sys.argv[1] != "pytest" else HERE))
    os.execve(str(command), [str(command), *sys.argv[2:]], environment)


if __name__ == "__main__":
    main()
