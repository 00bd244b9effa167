"""The examples of nodes of your own, run as they say: real processes in the graph over DDS, and a bag read back."""

import json
import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import control
import numpy as np
import pytest
from click.testing import CliRunner
from mcap.reader import make_reader

from ac_common.design_file import from_file
from ac_experiments.bags.reader import read_bag, read_raw
from ac_experiments.metrics import summarise
from ac_experiments.recording import Recording
from ac_experiments.scenario import load
from ac_experiments.simulate import simulate
from ac_plant_node import linearize, operating_point
from bringup.cli import cli
from bringup.launch.processes import Child
from bringup.launch.supervisor import Supervisor
from fdi_node import FaultDetector, FdiDesign
from gimc_controller_node import Compensator, CompensatorDesign
from tests.design_files import design_parameters

pytestmark = pytest.mark.ros

sys.path.insert(0, str(Path(__file__).parents[2] / "examples"))

Shell = Callable[..., str]
Commands = Callable[[str], list[str]]

#: A fault soon, and long enough to be isolated in.
SHORT = ("--set", "duration_s=25", "--set", "faults.0.onset_s=5", "--no-report", "--json")


@contextmanager
def by_hand(command: str, folder: Path, environment: dict[str, str]) -> Iterator[subprocess.Popen[bytes]]:
    """A node that the user starts, and ends: nobody else must."""
    arguments = shlex.split(command)[1:]
    node = subprocess.Popen([sys.executable, *arguments], cwd=folder, env=environment, process_group=0)
    try:
        yield node
        assert node.poll() is None
        node.send_signal(signal.SIGTERM)
        with suppress(subprocess.TimeoutExpired):  # the middleware may not let go; plain rclpy has no way out of that
            assert node.wait(10) == 0
    finally:
        if node.poll() is None:
            os.killpg(node.pid, signal.SIGKILL)


def columns(run: Recording, *names: str) -> np.ndarray:
    return np.column_stack([run.series[name] for name in names])


MEASURED = ("measured/evaporator_pressure", "measured/superheat", "measured/wall_temperature")
COMMAND = ("controller/command:compressor", "controller/command:expansion_valve")


def test_own_plant_is_the_linear_model(shell: Shell, commands: Commands, folder: Path) -> None:
    (command,) = commands("own_plant.py")
    summary = json.loads(shell(command, *SHORT))
    assert summary["faults"][0]["isolated_as"] == "compressor_speed"
    run = read_bag(folder / "results" / "linear_plant" / "bag")
    rest = operating_point("med")
    actuators = ("actuator/command:compressor", "actuator/command:expansion_valve")
    inputs = columns(run, *actuators, "scenario/air:evaporator_air", "scenario/air_inlet_temperature") - rest.inputs
    sampled = control.c2d(linearize("med"), 0.1)
    expected = control.forced_response(sampled, U=inputs.T).outputs[0]
    recorded = run.series["plant/evaporator_pressure"] - rest.outputs[0]
    assert np.abs(recorded).max() > 300  # Pa: the fault has moved it
    np.testing.assert_allclose(recorded, expected, atol=0.01)


def test_own_controller_gives_the_commands(shell: Shell, commands: Commands, folder: Path) -> None:
    from own_controller import PiController

    (command,) = commands("own_controller.py")
    summary = json.loads(shell(command, *SHORT))
    assert summary["faults"][0]["isolated_as"] == "compressor_speed"  # by a detector that knows nothing of it
    run = read_bag(folder / "results" / "pi" / "bag")
    errors = columns(run, "reference/evaporator_pressure", "reference/superheat") - columns(run, *MEASURED[:2])
    controller = PiController(operating_point("med").inputs[:2], 0.1)
    expected = [controller.step(error) for error in errors]
    np.testing.assert_array_equal(columns(run, *COMMAND), expected)


def test_own_q_acts(shell: Shell, commands: Commands, folder: Path) -> None:
    design, run_it = commands("own_q.py")
    shell(design)
    summary = json.loads(shell(run_it, *SHORT))
    alone = summarise(simulate(load("actuator_fault", SHORT[1:4:2]), passive=True))["metrics"]
    assert summary["metrics"]["peak_pressure_error_kpa"] < alone["peak_pressure_error_kpa"]
    bag = folder / "results" / "own_q" / "bag"
    run = read_bag(bag)
    own = from_file(CompensatorDesign, str(folder / "results" / "own_q.npz"), 0.1)
    compensator = Compensator(own)
    f_e = columns(run, *(f"fdi/innovation/{name}" for name in ("evaporator_pressure", "superheat", "wall_temperature")))
    expected = [
        compensator.step(row, status.isolated, status.also_isolated)
        for row, status in zip(f_e, run.status, strict=True)
    ]
    q = columns(run, "compensator/q:compressor", "compensator/q:expansion_valve")
    np.testing.assert_allclose(q, expected, rtol=1e-12, atol=1e-15)
    assert "design/compensator.npz" in read_raw(bag).attachments  # so that the bag can be replayed elsewhere


def test_own_filter_gives_the_residuals(
    shell: Shell, commands: Commands, folder: Path, environment: dict[str, str]
) -> None:
    """Also: a managed node that the user has started takes part, and is left as it was found."""
    design, run_it = commands("own_filter.py")
    shell(design)
    file = design_parameters("compensator", folder)["design_file"]
    managed = "python -m gimc_controller_node.compensator_node --ros-args -r __ns:=/ac -p autostart:=false"
    managed += f" -p design_file:={file}"
    with by_hand(managed, folder, environment) as node:
        further = ("--set", "faults.0.size_rpm=150", "--set", "faults.1.onset_s=20", "--without", "compensator")
        shell(run_it, *SHORT, *further)
        with Supervisor({"compensator": Child("compensator", node, folder)}, environment) as supervisor:
            supervisor.wait_for({"compensator": "unconfigured"})
    run = read_bag(folder / "results" / "own_filter" / "bag")
    detector = FaultDetector(from_file(FdiDesign, str(folder / "results" / "own_filter.npz"), 0.1))
    rows = zip(run.time_s, columns(run, *MEASURED), run.series["plant/air_inlet_temperature"], columns(run, *COMMAND),
               strict=True)  # fmt: skip
    expected = []
    for time_s, measured, air, command in rows:
        expected.append(detector.observe(time_s, measured, air).residual)
        detector.commanded(command)
    residual = columns(run, "fdi/residual/compressor_speed:compressor", "fdi/residual/evaporator_pressure")
    np.testing.assert_allclose(residual, expected, rtol=1e-9, atol=1e-9)
    assert run.status[-1].isolated == "compressor_speed"


def test_a_plain_node_stands_in_for_the_plant(
    shell: Shell, commands: Commands, folder: Path, environment: dict[str, str]
) -> None:
    start, run_it = commands("own_bench.py")
    with by_hand(start, folder, environment):
        summary = json.loads(shell(run_it, "--set", "duration_s=4", "--no-report", "--json", "--out", "bench"))
    assert summary["ticks"] == 40
    run = read_bag(folder / "bench" / "bag")
    # Time counts from when the scenario begins, not from when the bench did: nothing is cut off at the end.
    assert np.isfinite(run.series["reference/superheat"][0])
    assert np.isfinite(run.series["actuator/command:compressor"][20:]).any()
    assert run.metadata["unreadable"] == 0
    with next((folder / "bench" / "bag").glob("*.mcap")).open("rb") as file:
        recorded = make_reader(file).get_summary()
    counts = {recorded.channels[n].topic: count for n, count in recorded.statistics.channel_message_counts.items()}
    assert counts["/ac/actuator/command"] >= 40  # the scenario's ticks count from when the loop is closed
    assert np.nanmax(np.abs(run.series["plant/evaporator_pressure"] - 251.2e3)) < 500


def test_a_plain_node_that_is_told_to_end_within_a_tick_ends_well(folder: Path, environment: dict[str, str]) -> None:
    program = """
import own_bench, rclpy
read = own_bench.Hardware.read
own_bench.Hardware.read = lambda hardware: (rclpy.shutdown(), read(hardware))[1]
own_bench.main()
"""
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=folder / "examples", env=environment, capture_output=True, timeout=60
    )
    assert (done.returncode, done.stderr) == (0, b"")


def test_a_bench_that_does_not_come_is_told_what_is_missing(folder: Path, environment: dict[str, str]) -> None:
    command = ["run", "nominal", "--mode", "realtime", "--passive", "--without", "ac_plant", "--out", "bench"]
    with subprocess.Popen(
        [sys.executable, "-m", "bringup.cli", *command], cwd=folder, env=environment, stderr=subprocess.PIPE, text=True
    ) as run:
        assert run.stderr is not None
        said = next(line for line in run.stderr if "waiting for your ac_plant" in line)
        run.send_signal(signal.SIGINT)
        run.communicate(timeout=60)
    assert "/ac/plant/evaporator_pressure: no publisher (sensor_msgs/msg/FluidPressure, reliable)" in said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--node", "ac_plan=true"], "did you mean 'ac_plant'?"),
        (["--node", "recorder=true"], "no node 'recorder' can be replaced"),
        (["--node", "fdi"], "no command"),
        (["--node", "fdi=no_such_program"], "is not an executable"),
        (["--node", "fdi=python nothing.py"], "there is no file nothing.py"),
        (["--node", "fdi=true", "--node", "fdi=true"], "has a command already"),
        (["--node", "fdi=true", "--without", "fdi"], "either you start it or acftc does"),
        (["--params-file", "nothing.yaml"], "No such file"),
        (["--params-file", "list.yaml"], "holds no mapping"),
        (["--params-file", "node.yaml"], "no node '/ac/fdy'"),
        (["--params-file", "name.yaml"], "did you mean 'design_file'?"),
        (["--params-file", "date.yaml"], "is no YAML"),
        (["--params-file", "loop.yaml"], "nested too deeply"),
    ],
)
def test_a_mistake_is_one_line(
    arguments: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("list.yaml").write_text("- 1\n")
    Path("node.yaml").write_text("/ac/fdy: {ros__parameters: {sensors: 2}}\n")
    Path("name.yaml").write_text("/ac/fdi: {ros__parameters: {design_fiel: x}}\n")
    Path("date.yaml").write_text("/ac/fdi: {ros__parameters: {sensors: 2024-13-45}}\n")
    Path("loop.yaml").write_text("/ac/fdi: {ros__parameters: &a {sensors: *a}}\n")
    result = CliRunner().invoke(cli, ["run", "nominal", *arguments])
    assert said in str(result.exception)
    assert "\n" not in str(result.exception)
