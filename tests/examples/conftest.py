"""A folder like the checkout's, where the examples write their results."""

import os
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BIN = Path(sys.executable).parent


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Where the commands run: `examples/` is there as in the checkout."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    return tmp_path


@pytest.fixture
def environment() -> dict[str, str]:
    path = f"{BIN}{os.pathsep}{os.environ['PATH']}"
    return {**os.environ, "PATH": path, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


Shell = Callable[..., str]


@pytest.fixture
def shell(folder: Path, environment: dict[str, str]) -> Shell:
    """Run one command as it is written in an example, with further arguments; what it printed."""

    def run(command: str, *further: str) -> str:
        done = subprocess.run(
            [*shlex.split(command), *further], cwd=folder, env=environment, capture_output=True, text=True, timeout=240
        )
        assert done.returncode == 0, done.stderr[-2000:]
        return done.stdout

    return run


@pytest.fixture
def commands() -> Callable[[str], list[str]]:
    """The indented lines of an example's docstring: the commands that it tells its reader to type."""

    def read(example: str) -> list[str]:
        text = (ROOT / "examples" / example).read_text(encoding="utf-8").split('"""')[1]
        lines = [line.strip() for line in text.splitlines() if line.startswith("    ")]
        return [line.split("   ")[0] for line in lines]

    return read
