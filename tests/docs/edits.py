"""What a page says to change in the code, and a copy of the code in which it is changed."""

import os
import re
import shutil
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = (
    "ac_common",
    "ac_design",
    "ac_experiments",
    "ac_plant_node",
    "ac_ros_common",
    "bringup",
    "fault_injector_node",
    "fdi_node",
    "gimc",
    "gimc_controller_node",
)
_BLOCK = re.compile(r'```diff title="([^"]+)"\n(.*?)```', re.DOTALL)


def edits_of(page: Path) -> dict[str, str]:
    """The differences that a page shows, by file; those that it includes are read in."""
    found = {}
    for file, text in _BLOCK.findall(page.read_text()):
        included = re.match(r'--8<-- "(.+)"', text)
        found[file] = (ROOT / included[1]).read_text() if included else text
    return found


def copy_of_the_code(folder: Path) -> Path:
    """All packages, to be changed."""
    for package in PACKAGES:
        shutil.copytree(ROOT / package, folder / package, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def insert(file: Path, difference: str) -> None:
    """Insert the lines with a plus after the line before them, which the file has once."""
    lines = difference.splitlines()
    before = next(line for line, after in pairwise(lines) if after.startswith("+"))[1:]
    added = "".join(f"{line[1:]}\n" for line in lines if line.startswith("+"))
    content = file.read_text()
    assert content.count(f"{before}\n") == 1, before
    file.write_text(content.replace(f"{before}\n", f"{before}\n{added}"))


def run_in(folder: Path, code: str) -> str:
    """What a program prints that imports the copy."""
    others = {key: value for key, value in os.environ.items() if key != "ROS_DOMAIN_ID"}  # a run takes a free one
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        env={**others, "PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        timeout=250,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout
