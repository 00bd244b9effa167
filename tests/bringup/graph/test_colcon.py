"""The package in a colcon workspace, with the build tools of Ubuntu 24.04; and the launch file that it installs."""

import importlib
import os
import re
import shutil
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from bringup.launch.process_table import PROCESSES

ROOT = Path(__file__).parents[3]
LAUNCH = ROOT / "launch" / "loop.launch.xml"
#: What `apt install python3-setuptools python3-packaging` installs there, and colcon.
TOOLS = ("setuptools==68.1.2", "packaging==24.0", "colcon-core", "colcon-ros", "colcon-recursive-crawl")


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A workspace as the recipe in docs/ros2.md makes it: sources, and an environment that colcon must pass over."""
    folder = tmp_path_factory.mktemp("ws")
    base = Path(os.path.realpath(sys.executable))
    subprocess.run([str(base), "-m", "venv", str(folder / "venv")], check=True, capture_output=True)
    pip = [str(folder / "venv" / "bin" / "python"), "-m", "pip", "install", "--quiet", *TOOLS]
    made = subprocess.run(pip, capture_output=True, text=True, timeout=250, check=False)
    if made.returncode != 0 and not os.environ.get("CI"):
        pytest.skip(f"no build tools to be had: {made.stderr.strip()[-200:]}")
    assert made.returncode == 0, made.stderr
    (folder / "venv" / "COLCON_IGNORE").touch()
    hidden = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info", "results", "build")
    shutil.copytree(ROOT, folder / "src" / "acftc", ignore=hidden)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("option", [[], ["--symlink-install"]], ids=["install", "symlink"])
def test_colcon_builds_it(option: list[str], workspace: Path) -> None:
    for old in ("build", "install", "log"):
        shutil.rmtree(workspace / old, ignore_errors=True)
    plain = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "LD_LIBRARY_PATH")}
    command = [str(workspace / "venv" / "bin" / "python"), "-m", "colcon", "build", *option]
    done = subprocess.run(command, cwd=workspace, capture_output=True, text=True, timeout=250, env=plain, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Finished <<< acftc" in done.stdout
    installed = workspace / "install" / "acftc"
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    assert {file.name for file in (installed / "lib" / "acftc").iterdir()} == set(scripts)
    assert (installed / "share" / "acftc" / "launch" / LAUNCH.name).read_text() == LAUNCH.read_text()
    packages = installed / "lib" / "python3.12" / "site-packages"
    sources = workspace / "build" / "acftc" if option else packages
    if option:  # a change of a source is seen without building again
        assert (sources / "bringup").resolve() == workspace / "src" / "acftc" / "bringup"
    assert (sources / "ac_experiments" / "scenarios" / "nominal.yaml").exists()
    # With the packages that it needs: those of this environment.
    environment = {**os.environ, "PYTHONPATH": f"{sources}:{packages}"}
    program = [sys.executable, str(installed / "lib" / "acftc" / "acftc"), "scenarios"]
    said = subprocess.run(program, capture_output=True, text=True, cwd=workspace, env=environment, check=False)
    assert said.returncode == 0, said.stderr
    assert "actuator_fault" in said.stdout


NODES = list(ET.parse(LAUNCH).getroot().iter("node"))


def test_launch_file_starts_every_node_under_its_name() -> None:
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    assert {node.get("name") for node in NODES} == set(PROCESSES)
    assert all(node.get("pkg") == "acftc" and node.get("exec") in scripts for node in NODES)
    arguments = {argument.get("name") for argument in ET.parse(LAUNCH).getroot().iter("arg")}
    assert set(re.findall(r"\$\(var (\w+)\)", LAUNCH.read_text())) <= arguments


@pytest.mark.parametrize("node", NODES, ids=lambda node: node.get("name"))
def test_launch_file_sets_parameters_that_exist(node: ET.Element) -> None:
    process = PROCESSES[str(node.get("name"))]
    declared = {parameter.name for parameter in importlib.import_module(process.class_module).PARAMETERS}
    assert {str(each.get("name")) for each in node.iter("param")} <= declared
