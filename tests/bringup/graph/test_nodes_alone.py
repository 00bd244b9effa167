"""Each node is startable on its own, says what is wrong with its parameters, and ends cleanly."""

import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from ac_common.design_file import DESIGNED
from ac_common.topics import FDI, RECORDER
from bringup.cli import cli
from bringup.launch.process_table import PROCESSES
from bringup.launch.processes import ros_environment, start, stop
from bringup.launch.supervisor import Supervisor
from tests.design_files import design_parameters

pytestmark = pytest.mark.ros

ENDED = (FDI, *(name for name in PROCESSES if name != FDI))


#: Both signals for one node, either for the others: all of them end through the same lines.
ENDS = [(FDI, signal.SIGINT), *((name, (signal.SIGTERM, signal.SIGINT)[i % 2]) for i, name in enumerate(ENDED))]


@pytest.mark.parametrize(("name", "number"), ENDS)
def test_starts_by_itself_and_ends_with_code_0(name: str, number: signal.Signals, tmp_path: Path) -> None:
    parameters = design_parameters(name, tmp_path) | ({"folder": str(tmp_path / "bag")} if name == RECORDER else {})
    own = [word for key, value in parameters.items() for word in ("-p", f"{key}:={value}")]
    arguments = ["-m", PROCESSES[name].module, "--ros-args", "-r", "__ns:=/ac", *own]
    child = start(name, arguments, tmp_path, ros_environment())
    try:
        with Supervisor({name: child}, ros_environment()) as supervisor:
            supervisor.wait_for({name: "active"})
        child.process.send_signal(number)
        assert child.process.wait(10) == 0, child.log.read_text()
    finally:
        stop([child])


@pytest.mark.parametrize("name", DESIGNED)
def test_without_its_design_a_node_says_in_one_line_which_command_makes_it(name: str, tmp_path: Path) -> None:
    result = subprocess.run(
        [sys.executable, "-m", PROCESSES[name].module], capture_output=True, text=True, timeout=60, cwd=tmp_path
    )
    assert result.returncode == 2
    said = f"{name}: no design_file given; `acftc design --out designs` makes one: designs/{name}-med.npz"
    assert result.stderr.strip() == said
    command = shlex.split(said.split("`")[1])
    made = CliRunner().invoke(cli, [*command[1:-1], str(tmp_path / "designs")])
    assert made.exit_code == 0, made.output
    assert (tmp_path / "designs" / f"{name}-med.npz").exists()


def test_health_does_not_wait_by_the_wall_clock() -> None:
    """Which somebody may set back by an hour."""
    code = "import rclpy; from fdi_node.node import FdiNode; rclpy.init(); node = FdiNode(); "
    code += "print(node._health_timer.clock.clock_type.name); node.destroy_node(); rclpy.shutdown()"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True).stdout
    assert said.split() == ["STEADY_TIME"]


@pytest.mark.parametrize(
    ("module", "parameter", "said"),
    [
        ("fault_injector_node", "operating_point:=medium", "allowed: low, med, high"),
        ("fdi_node", "sample_time_s:=3.0", "sample_time_s"),
        ("fdi_node", "sample_time_s:=fast", "sample_time_s"),
        ("fault_injector_node", "noise_std:=[1.0, 2.0]", "allowed: three or four numbers"),
        ("bringup.nodes.scenario", "scenario:=nominul", "nominal"),
        ("ac_plant_node", "mode:=realtme", "allowed: lockstep, realtime"),
    ],
)
def test_bad_parameter_is_one_clear_line(module: str, parameter: str, said: str) -> None:
    result = subprocess.run(
        [sys.executable, "-m", module, "--ros-args", "-p", parameter], capture_output=True, text=True, timeout=60
    )
    assert result.returncode == 2
    assert said in result.stderr
    assert result.stderr.strip().count("\n") == 0, result.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--params-file", "broken.yaml"], "broken.yaml"),
        (["--params-file", "missing.yaml"], "no such file"),
        (["-r", "bogus"], "bogus"),
        (["-p", "design_file:=broken.yaml"], "holds no FdiDesign"),
    ],
)
def test_bad_argument_is_one_clear_line(arguments: list[str], said: str, tmp_path: Path) -> None:
    (tmp_path / "broken.yaml").write_text("/**:\n  ros__parameters:\n    sensors: [[1]\n")
    command = [sys.executable, "-m", "fdi_node", "--ros-args", *arguments]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=tmp_path)
    assert result.returncode == 2
    assert said in result.stderr
    assert result.stderr.strip().count("\n") == 0, result.stderr
