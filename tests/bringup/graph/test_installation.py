"""Another ROS installation in the environment: ours is used all the same, or one line says why that cannot be."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from ac_ros_common.installation import GUARD, LEFT_ASIDE, users_environment, without_foreign
from bringup.launch.processes import start, stop

ROOT = Path(__file__).parents[3]
OWN = Path(sys.prefix)


@pytest.fixture
def foreign(tmp_path: Path) -> Path:
    """What a distribution installs: packages that only its own Python can load, and libraries of the same names."""
    prefix = tmp_path / "opt" / "ros" / "jazzy"
    (prefix / "share" / "ament_index").mkdir(parents=True)
    for package in ("rclpy", "sensor_msgs", "ament_index_python"):
        folder = prefix / "lib" / "python3.12" / "site-packages" / package
        folder.mkdir(parents=True)
        (folder / "__init__.py").write_text("raise ImportError('of another Python')\n")
    (prefix / "lib" / "librcl.so").write_text("no library of ours\n")
    (prefix / "lib" / "librmw_cyclonedds_cpp.so").write_text("")
    return prefix


def sourced(prefix: Path, **further: str) -> dict[str, str]:
    """The environment of a shell in which ``setup.bash`` of `prefix` was sourced; the wheels have not begun yet."""
    plain = {name: value for name, value in os.environ.items() if name not in (GUARD, "LD_LIBRARY_PATH")}
    return {
        **plain,
        "PYTHONPATH": str(prefix / "lib" / "python3.12" / "site-packages"),
        "LD_LIBRARY_PATH": str(prefix / "lib"),
        "AMENT_PREFIX_PATH": str(prefix),
        **further,
    }


def said_by(command: list[str], environment: dict[str, str]) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment, cwd=ROOT, check=False)


PROGRAMS = {
    "acftc": ["acftc", "topics", "--json"],
    "start.py": [sys.executable, "start.py", "acftc", "topics", "--json"],
    "module": [sys.executable, "-m", "bringup.cli", "topics", "--json"],
}


@pytest.mark.ros
@pytest.mark.parametrize("program", PROGRAMS)
def test_a_command_uses_its_own_ros_and_says_so(program: str, foreign: Path) -> None:
    environment = sourced(foreign, RMW_IMPLEMENTATION="rmw_cyclonedds_cpp", PATH=f"{OWN}/bin:{os.environ['PATH']}")
    done = said_by(PROGRAMS[program], environment)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) is not None
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"acftc: uses the ROS 2 of {OWN}, not {foreign} (PYTHONPATH, LD_LIBRARY_PATH")


#: Exit code 2 and the node's own complaint: it came as far as to its design, so its ROS is the right one.
NODES = {
    "fdi_node": "fdi: ",
    "gimc_controller_node": "gimc_controller: ",
    "compensator_node": "compensator: ",
}
MODULES = {"compensator_node": "gimc_controller_node.compensator_node"}


@pytest.mark.ros
@pytest.mark.parametrize("how", ["script", "module"])
@pytest.mark.parametrize("node", NODES)
def test_a_node_started_alone_uses_its_own_ros(node: str, how: str, foreign: Path) -> None:
    command = [str(OWN / "bin" / node)] if how == "script" else [sys.executable, "-m", MODULES.get(node, node)]
    done = said_by(command, sourced(foreign))
    told, *_, complaint = done.stderr.splitlines()
    assert f"uses the ROS 2 of {OWN}" in told
    assert (done.returncode, complaint[: len(NODES[node])]) == (2, NODES[node])
    assert "design_file" in complaint


@pytest.mark.parametrize(
    "command", [["acftc", "run", "nominal"], ["acftc", "topics"], ["acftc", "dash"], ["fault_injector_node"]]
)
@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("ROS_DOMAIN_ID", "999", "ROS_DOMAIN_ID is '999'; allowed: 0 to 232"),
        ("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp", "does not have; allowed: rmw_fastrtps_cpp, or unset it"),
    ],
)
def test_what_no_middleware_can_use_is_one_line(command: list[str], name: str, value: str, said: str) -> None:
    program, *arguments = command
    done = said_by([str(OWN / "bin" / program), *arguments], {**os.environ, name: value})
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert said in line


def test_what_is_the_users_stays(foreign: Path, tmp_path: Path) -> None:
    mine = tmp_path / "mine"
    mine.mkdir()
    packages = foreign / "lib" / "python3.12" / "site-packages"
    given = {"PYTHONPATH": f"{mine}:{packages}", "LD_LIBRARY_PATH": f"{OWN / 'lib'}:{foreign / 'lib'}", "HOME": "/root"}
    kept, dropped = without_foreign(given, OWN)
    assert dropped == {"PYTHONPATH": str(packages), "LD_LIBRARY_PATH": str(foreign / "lib")}
    assert {name: value for name, value in kept.items() if name != LEFT_ASIDE} == {
        "PYTHONPATH": str(mine),
        "LD_LIBRARY_PATH": str(OWN / "lib"),
        "HOME": "/root",
    }
    assert users_environment(kept)["LD_LIBRARY_PATH"] == str(foreign / "lib")


def test_a_program_of_the_users_gets_the_installation_that_was_sourced(
    foreign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept, _ = without_foreign(sourced(foreign), OWN)
    for name in ("PYTHONPATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv(LEFT_ASIDE, kept[LEFT_ASIDE])
    for program, expected in (("/usr/bin/env", str(foreign)), (sys.executable, "None")):
        arguments = [] if program != sys.executable else ["-c", "import os; print(os.environ.get('AMENT_PREFIX_PATH'))"]
        child = start("own", arguments, tmp_path, {}, program)
        child.process.wait(30)
        stop([child])
        assert expected in (tmp_path / "own.log").read_text()
