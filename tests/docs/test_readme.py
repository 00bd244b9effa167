"""Every command of the README is run, and every command in the documentation is one (figures: `test_figures.py`).

The two long commands are not run in full here. The first is run with a shorter scenario; `tests/gimc_controller_node`
runs the whole scenario, and `tests/bringup/graph` the whole graph. The second is `pytest` itself. The site is built in
`test_site.py`.
"""

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import click
import pytest

from bringup.cli import cli

ROOT = Path(__file__).parents[2]
BIN = Path(sys.executable).parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMANDS = [line.split("  #")[0].strip() for line in re.findall(r"^    (python3 start\.py .*)$", README, re.MULTILINE)]
SHORTER = {"run": ["--set", "duration_s=6", "--set", "faults.0.onset_s=2"], "study": ["--runs", "8"]}
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]


def test_readme_has_the_two_commands_first() -> None:
    assert COMMANDS[:2] == [
        "python3 start.py acftc run on_the_road --out results/on_the_road --force",
        "python3 start.py pytest -n 2",
    ]


@pytest.mark.ros
@pytest.mark.parametrize("command", [c for c in COMMANDS if c.split()[2] not in ("pytest", "mkdocs")])
def test_readme_command_runs(command: str, tmp_path: Path) -> None:
    """What `start.py` does when the environment is there: run a program of it, here, with these arguments."""
    program, *arguments = shlex.split(command)[2:]
    further = SHORTER.get(arguments[0], [])
    path = f"{BIN}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path}
    environment.pop("ROS_DOMAIN_ID", None)  # a run takes the first domain that is free
    called = [BIN / program, *arguments, *further]
    done = subprocess.run(called, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr[-2000:]
    for option, value in pairwise(arguments):
        if option == "--out":
            page, numbers = ("study", "study") if arguments[0] == "study" else ("report", "summary")
            assert (tmp_path / value / f"{page}.html").stat().st_size > 100_000
            assert (tmp_path / value / f"{numbers}.json").exists()


def test_start_runs_a_command_in_the_folder_it_is_called_in(tmp_path: Path) -> None:
    sys.path.insert(0, str(ROOT))
    from start import wanted

    stamp = ROOT / ".venv" / "acftc-environment"
    if (
        not stamp.exists()
        or stamp.read_text(encoding="utf-8").split()[0] != wanted()
        or Path(sys.prefix) != ROOT / ".venv"
    ):
        pytest.skip("start.py would make the environment anew, under the feet of the other tests")
    where = [sys.executable, str(ROOT / "start.py"), "python", "-c", "import os; print(os.getcwd())"]
    done = subprocess.run(where, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == str(tmp_path)


def documented() -> Iterator[Any]:
    """Every line of a code block of the documentation that calls `acftc`."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8").replace("\\\n", " ")
        for line in re.findall(r"^(?:    )?(?:python3 start\.py )?(acftc .+)$", text, re.MULTILINE):
            yield pytest.param(re.split(r" {2,}| [|>] ", line)[0], id=f"{page.stem}: {line[:60]}")


@pytest.mark.parametrize("command", list(documented()))
def test_documented_command_exists(command: str) -> None:
    if command.startswith(("acftc --help", "acftc --version")):
        return
    _, *words = shlex.split(command)
    if words[0] == "--plant":
        words = words[2:]
    name, *arguments = [word for word in words if word != "--help"]
    with click.Context(cli, info_name="acftc") as context:
        found = cli.get_command(context, name)
        assert found is not None, f"there is no command {name!r}"
        found.make_context(name, arguments, parent=context)  # parses and checks; does not run
