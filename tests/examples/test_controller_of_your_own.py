"""A controller of another class, `examples/scheduled_pi.py`: one file and one line, in one process and in the graph."""

import json
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from ac_common.errors import UserError
from ac_design import design_controller
from ac_experiments.bags.reader import read_bag
from ac_experiments.metrics import summarise
from ac_experiments.scenario import check, load
from ac_experiments.simulate import simulate
from bringup.cli import cli
from gimc_controller_node import Controller
from gimc_controller_node.making import check_controller, make_controller

Shell = Callable[..., str]
Commands = Callable[[str], list[str]]
PATH = "examples.scheduled_pi.ScheduledPi"
SHORT = ("duration_s=25", "faults.0.onset_s=5")
COMMAND = ("controller/command:compressor", "controller/command:expansion_valve")


@pytest.mark.ros
def test_the_graph_runs_it_and_gives_the_numbers_of_the_simulation(
    shell: Shell, commands: Commands, folder: Path
) -> None:
    simulated, run = commands("scheduled_pi.py")
    short = [word for change in SHORT for word in ("--set", change)]
    summary = json.loads(shell(run, *short, "--no-report", "--json"))
    assert summary["faults"][0]["isolated_as"] == "compressor_speed"  # by a detector that knows nothing of it
    same = json.loads(shell(simulated, *short, "--no-report", "--json"))
    assert same["metrics"] == summary["metrics"]
    recorded = read_bag(folder / "results" / "scheduled" / "bag")
    here = simulate(load("actuator_fault", (f"controller={PATH}", *SHORT)))
    for key in COMMAND:
        np.testing.assert_array_equal(recorded.series[key], here.series[key])
    k0 = simulate(load("actuator_fault", SHORT))
    assert np.abs(here.series[COMMAND[0]] - k0.series[COMMAND[0]]).max() > 0.1  # rad/s: it is not K0


@pytest.mark.parametrize("point", ["low", "med", "high"])
def test_it_holds_both_outputs_at_each_point(point: str) -> None:
    """What the schedule is for: the same steps at a plant whose gain is eight times another's."""
    scenario = {
        "name": "steps",
        "operating_point": point,
        "duration_s": 400.0,
        "passive": True,
        "controller": PATH,
        "references": {"evaporator_pressure_kpa": [{"at_s": 5, "to": 5.0}], "superheat_k": [{"at_s": 200, "to": 1.0}]},
    }
    metrics = summarise(simulate(check(scenario)))["metrics"]
    assert abs(metrics["steady_pressure_error_kpa"]) < 0.05
    assert abs(metrics["steady_superheat_error_k"]) < 0.05


def test_what_stands_around_k0_stands_around_it() -> None:
    design = design_controller("med", 0.1)
    controller = make_controller(design, PATH)
    rest, far = np.array([251.2e3, 20.0]), np.array([100e3, 60.0])
    commands = [controller.step(rest, far, None) for _ in range(50)]
    commands += [controller.on_missed_inputs() for _ in range(20)]
    commands += [controller.step(far, rest, None) for _ in range(50)]
    moves = np.abs(np.diff([design.command_rest, *commands], axis=0))
    assert np.all(moves <= design.command_rate * design.sample_time_s + 1e-12)
    assert np.all((commands >= design.command_min) & (commands <= design.command_max))
    assert "reference too low" in controller.does


class Broken(Controller):
    """Fails in its first step."""

    def __init__(self, design: object) -> None:
        self.design = design

    def step(self, reference: object, measurement: object, q: object) -> None:  # noqa: ARG002
        raise ArithmeticError("no gain")


class Shapeless(Broken):
    """Gives one number."""

    def step(self, reference: object, measurement: object, q: object) -> float:  # noqa: ARG002
        return 1.0


class NoController:
    """Has none of the methods."""


HERE = "tests.examples.test_controller_of_your_own"
MISTAKES = [
    ("examples.nothing.ScheduledPi", "there is no module 'examples.nothing'"),
    ("examples.scheduled_pi.SheduledPi", "has no class 'SheduledPi', did you mean 'ScheduledPi'?"),
    (
        f"{HERE}.NoController",
        "no step, sent, warm_restart; derive it from gimc_controller_node.Controller",
    ),
    (f"{HERE}.Broken", "ArithmeticError: no gain"),
    (f"{HERE}.Shapeless", "step gave 1.0; needed: two finite numbers"),
]


@pytest.mark.parametrize(("path", "said"), MISTAKES)
def test_a_class_that_is_no_controller_is_one_line(path: str, said: str) -> None:
    with pytest.raises(UserError) as problem:
        check_controller(path, design_controller("med", 0.1))
    assert said in str(problem.value)
    assert "\n" not in str(problem.value)


@pytest.mark.parametrize("command", ["simulate", "run"])
@pytest.mark.parametrize(("path", "said"), [*MISTAKES[:2], ("trakcing", "did you mean 'tracking'?")])
def test_bad_input_is_told_before_anything_is_started(command: str, path: str, said: str, tmp_path: Path) -> None:
    arguments = [command, "nominal", "--set", f"controller={path}", "--out", str(tmp_path)]
    result = CliRunner().invoke(cli, arguments)
    assert isinstance(result.exception, UserError)
    assert result.exception.exit_code == 2
    assert said in str(result.exception)


@pytest.mark.ros
def test_the_node_alone_says_it_in_one_line(tmp_path: Path) -> None:
    from ac_common.topics import CONTROLLER
    from ac_design import write_designs

    file = write_designs(tmp_path, "med", 0.1)[CONTROLLER]
    command = f"-m gimc_controller_node --ros-args -p design_file:={file} -p controller_class:=examples.nothing.Pi"
    done = subprocess.run(
        [sys.executable, *shlex.split(command)], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2
    assert "there is no module 'examples.nothing'" in done.stderr
    assert done.stderr.strip().count("\n") == 0, done.stderr
