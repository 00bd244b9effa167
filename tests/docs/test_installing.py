"""What `start.py` installs: pinned, hashed, from no named index, and for each command what it needs."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import click
import pytest
import yaml

import start
from bringup.cli import cli

ROOT = Path(__file__).parents[2]


def pins(name: str) -> dict[str, str]:
    """Name and version (with marker) of each package that a file pins."""
    found = re.findall(r"^([\w.-]+)(?:\[\w+\])?==(.+) \\$", (ROOT / name).read_text(), flags=re.MULTILINE)
    return dict(found)


@pytest.mark.parametrize("name", start.LEVELS)
def test_pins_have_hashes_and_name_no_index(name: str) -> None:
    text = (ROOT / name).read_text()
    assert len(pins(name)) > 100
    assert "://" not in text
    assert "--index" not in text
    for block in re.split(r"\n(?=\S)", text.strip()):
        assert "--hash=sha256:" in block


def test_each_level_holds_those_before_it() -> None:
    runtime, extra, development = (pins(name) for name in start.LEVELS)
    assert runtime.items() < extra.items() < development.items()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    extras = {
        re.split(r"[<>=\[]", text)[0].lower()
        for texts in project["project"]["optional-dependencies"].values()
        for text in texts
    }
    assert extras <= set(extra)
    assert not extras & set(runtime)


def test_commands_get_what_they_need_and_no_more() -> None:
    assert start.level_of(["acftc", "run", "actuator_fault"]) == start.RUNTIME
    assert start.level_of(["acftc"]) == start.level_of(["python", "foxglove"]) == start.RUNTIME
    for command in start.EXTRAS:
        assert start.level_of(["acftc", command]) == start.EXTRA
        assert command in cli.list_commands(click.Context(cli))
    for tool in start.DEVELOPERS:
        assert start.level_of([tool]) == start.DEVELOPMENT
        assert (Path(sys.prefix) / "bin" / tool).exists()


def test_extra_command_without_its_packages_says_what_to_do() -> None:
    hide = (
        "import importlib.util as u; find = u.find_spec\n"
        "u.find_spec = lambda name, package=None: None if name == 'foxglove' else find(name, package)\n"
        "import sys; sys.argv[1:] = ['foxglove']\n"
        "from bringup.cli import entry; entry()"
    )
    done = subprocess.run([sys.executable, "-c", hide], capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "needs foxglove-sdk" in line
    assert "python3 start.py acftc foxglove" in line


def test_workflow_and_container_do_what_the_readme_does() -> None:
    commands = re.findall(r"^    (python3 start\.py .+)$", (ROOT / "README.md").read_text(), flags=re.MULTILINE)[:2]
    run = (ROOT / ".ci" / "run").read_text()
    assert commands[1] in run  # the tests
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text())
    (job,) = workflow["jobs"].values()
    assert [step["run"] for step in job["steps"] if "run" in step] == [".ci/run"]
    container = (ROOT / "Dockerfile").read_text()
    instructions = re.findall(r"^([A-Z]+) (.+)$", container, flags=re.MULTILINE)
    assert instructions[0][0] == "FROM"
    first = commands[0].partition(" --out")[0]
    assert any(name == "RUN" and what.startswith(first) for name, what in instructions)
    ignored = (ROOT / ".dockerignore").read_text().split()
    assert {".git", ".venv", "results"} <= set(ignored)


def test_bytecode_is_made_of_our_packages_and_what_is_added(tmp_path: Path) -> None:
    (tmp_path / "more.py").write_text("more = 1\n")
    command = [sys.executable, *start.compiling(tmp_path)[1:]]
    assert subprocess.run(command, check=False).returncode == 0
    assert list(tmp_path.glob("__pycache__/more.*.pyc"))
    assert {str(ROOT / name) for name in ("ac_common", "bringup", "gimc")} < set(command)
