"""The command line as a user meets it: real processes, one line on stderr, exit codes."""

import json
import os
import pty
import re
import select
import shutil
import subprocess
import sys
from pathlib import Path
from unittest.mock import patch

import click
import click.shell_completion
import pytest

import bringup.commands
from bringup.cli import cli
from tests.said import complaints
from tests.small_faults import SENSOR, with_small


def acftc(*arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "bringup.cli", *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, check=False, timeout=120)


def assert_one_line(result: subprocess.CompletedProcess[str], code: int, *words: str) -> None:
    assert result.returncode == code, result.stderr
    assert len(complaints(result.stderr)) == 1, result.stderr
    assert "Traceback" not in result.stderr
    assert "\x1b" not in result.stderr + result.stdout  # no colours into a pipe
    for word in words:
        assert word in result.stderr


def test_help_comes_without_the_heavy_modules():
    probe = """
import sys
from bringup.cli import SECTIONS, main
for command in [[], *([name] for names in SECTIONS.values() for name in names)]:
    try:
        main([*command, "--help"])
    except SystemExit as end:
        assert end.code == 0
heavy = {"numba", "rclpy", "control", "CoolProp", "plotly", "scipy", "matplotlib", "bokeh", "numpy", "dask", "pyarrow"}
heavy &= set(sys.modules)
assert not heavy, heavy
"""
    result = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert "acftc run actuator_fault" in result.stdout


def test_every_command_has_help_with_an_example():
    context = click.Context(cli)
    commands = {name: cli.get_command(context, name) for name in cli.list_commands(context)}
    folder = Path(bringup.commands.__file__).parent
    helpers = {"__init__", "console", "extras", "options", "outcome", "foxglove_bridge", "topic_watch"}
    assert set(commands) == {module.stem for module in folder.glob("*.py")} - helpers
    for name, command in commands.items():
        assert command is not None
        assert command.help, name
        assert f"acftc {name}" in (command.epilog or ""), f"{name} --help shows no example"
        assert len(command.get_short_help_str(200)) <= 60, f"{name}: the list of commands wraps"


def test_acftc_alone_shows_help():
    result = acftc()
    assert result.returncode == 2
    assert result.stderr == acftc("--help").stdout
    assert "Exit codes" in result.stderr


def test_scenarios_lists_the_built_in_ones():
    result = acftc("scenarios", "--json")
    assert result.returncode == 0
    assert {"nominal", "actuator_fault", "sensor_fault"} <= set(json.loads(result.stdout))
    assert "actuator_fault" in acftc("scenarios").stdout


@pytest.mark.parametrize("command", ["run", "simulate"])
def test_bad_input_is_one_line_and_leaves_no_results(command: str, tmp_path: Path):
    out = tmp_path / "out"
    broken = tmp_path / "broken.yaml"
    broken.write_text("name: broken\nduration_s: soon\n")
    file = tmp_path / "file"
    file.write_text("")
    cases = [
        (["actuator_fualt"], ["did you mean 'actuator_fault'"]),
        (["missing.yaml"], ["missing.yaml", "no such scenario file"]),
        ([str(broken)], [str(broken), "duration_s", "'soon'"]),
        (["nominal", "--set", "duraton_s=5"], ["did you mean 'duration_s'"]),
    ]
    for arguments, words in cases:
        assert_one_line(acftc(command, *arguments, "--out", str(out)), 2, *words)
    assert not out.exists()
    for folder in ("/proc/acftc", str(file), str(file / "below")):
        assert_one_line(acftc(command, "nominal", "--out", folder), 2, folder, "cannot be written to")


def test_usage_errors_are_one_line():
    assert_one_line(acftc("simualte"), 2, "did you mean 'simulate'")
    assert_one_line(acftc("simulate"), 2, "SCENARIO", "acftc simulate --help")
    assert_one_line(acftc("simulate", "nominal", "--sett", "a=1"), 2, "--sett")
    assert_one_line(acftc("run", "nominal", "--mode", "fast"), 2, "fast", "lockstep", "realtime")
    assert_one_line(acftc("run", "nominal", "--mode", "realtme"), 2, "did you mean 'realtime'")


def test_an_earlier_recording_is_not_overwritten(tmp_path: Path):
    bag = tmp_path / "bag"
    bag.mkdir()
    (bag / "bag_0.mcap").write_bytes(b"precious")
    assert_one_line(acftc("run", "nominal", "--out", str(tmp_path)), 2, str(bag), "--force")
    assert (bag / "bag_0.mcap").read_bytes() == b"precious"


def test_without_a_report_that_of_an_earlier_run_goes_and_what_is_the_users_stays(tmp_path: Path):
    for name in ("report.html", "report.svg", "report_fault_1.png", "report_nodes.svg", "report_final.png", "notes.md"):
        (tmp_path / name).write_text("earlier")
    result = acftc("simulate", "nominal", "--set", "duration_s=1", "--no-report", "--no-bag", "--out", str(tmp_path))
    assert result.returncode == 0, result.stderr
    assert {item.name for item in tmp_path.iterdir()} == {"report_final.png", "notes.md", "summary.json"}
    assert "report.html" not in result.stdout + result.stderr


def test_a_report_takes_the_place_of_an_earlier_one_once_it_can_be_written(tmp_path: Path):
    run = ("simulate", "nominal", "--set", "duration_s=1", "--no-bag", "--out", str(tmp_path))
    for name in ("report.html", "report.svg", "report_fault_2.png"):
        (tmp_path / name).write_text("earlier")
    (tmp_path / "report.png").mkdir()  # so the new one cannot be
    assert acftc(*run).returncode == 1
    assert (tmp_path / "report.html").read_text() == (tmp_path / "report_fault_2.png").read_text() == "earlier"
    (tmp_path / "report.png").rmdir()
    assert acftc(*run).returncode == 0
    assert (tmp_path / "report.html").stat().st_size > 100_000
    assert not (tmp_path / "report_fault_2.png").exists()


def test_the_table_says_when_the_name_of_a_fault_was_sure(tmp_path: Path) -> None:
    file, out = tmp_path / "small.json", tmp_path / "out"
    file.write_text(with_small(SENSOR).model_dump_json(exclude_none=True))
    result = acftc("simulate", str(file), "--no-report", "--out", str(out))
    assert result.returncode == 0, result.stderr
    told = r"isolated as evaporator_pressure after \d+\.\d s, sure after \d+\.\d s"
    assert re.search(told, " ".join(result.stdout.split())), result.stdout
    again = json.loads(acftc("report", str(out / "bag"), "--json").stdout)
    assert again["faults"] == json.loads((out / "summary.json").read_text())["faults"]


def test_an_unexpected_error_is_one_line_and_the_traceback_is_kept(tmp_path: Path):
    probe = """
import bringup.cli

@bringup.cli.cli.command()
def boom():
    raise KeyError("deep\\ninside")

bringup.cli.main(["boom"])
"""
    result = subprocess.run(
        [sys.executable, "-c", probe], capture_output=True, text=True, check=False, env={"TMPDIR": str(tmp_path)}
    )
    assert_one_line(result, 1, "unexpected error", "KeyError", str(tmp_path))
    (log,) = tmp_path.glob("acftc-*.log")
    assert "Traceback" in log.read_text()


@pytest.mark.parametrize("problem", ["ValueError('deep inside')", "gimc.SynthesisError('not stabilisable')"])
def test_a_value_error_that_was_not_written_for_the_user_is_a_mistake_of_ours(problem: str, tmp_path: Path):
    probe = f"""
import gimc
import bringup.cli

@bringup.cli.cli.command()
def boom():
    raise {problem}

bringup.cli.main(["boom"])
"""
    result = subprocess.run(
        [sys.executable, "-c", probe], capture_output=True, text=True, check=False, env={"TMPDIR": str(tmp_path)}
    )
    assert_one_line(result, 1, "unexpected error", "Error: ")


def test_what_the_packages_refuse_is_one_line_with_the_code_of_bad_input(tmp_path: Path):
    car = tmp_path / "car.yaml"
    car.write_text("refrigerant: R134a\nn_e: {value: fast}\n")
    assert_one_line(acftc("--plant", str(car), "equilibria"), 2, str(car))
    cycle = tmp_path / "cycle.csv"
    cycle.write_text("time,speed (mph)\n0,1\n")
    drive = f"air={{drive_cycle: {{file: {cycle}}}}}"
    assert_one_line(acftc("simulate", "nominal", "--set", drive, "--out", str(tmp_path / "out")), 2, "two lines")
    points = tmp_path / "points.yaml"
    points.write_text("points: [{name: low}]\n")
    assert_one_line(acftc("calibrate", "--points", str(points)), 2, str(points))
    assert_one_line(acftc("campaign", "--seed", "1", "--duration", "3"), 2, "allowed: 12 to 3600 s")


def test_a_synthesis_that_fails_names_the_design(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    import ac_design.controller
    import gimc
    from ac_common.errors import UserError
    from ac_design import design_controller

    def refuse(*_: object) -> None:
        raise gimc.SynthesisError("not stabilisable")

    monkeypatch.setenv("ACFTC_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(ac_design.controller, "synthesise", refuse)
    with pytest.raises(UserError, match="design of the controller at med: not stabilisable"):
        design_controller("med", 0.1)


def test_equilibria_stand_beside_table_i():
    result = acftc("equilibria", "--json")
    assert result.returncode == 0, result.stderr
    points = json.loads(result.stdout)
    assert list(points) == ["low", "med", "high"]
    for point in points.values():
        assert point["evaporator_pressure_kpa"] == pytest.approx(point["table_i_evaporator_pressure_kpa"], abs=0.05)
        assert point["superheat_k"] == pytest.approx(20.0, abs=0.02)
    assert "302.2" in acftc("equilibria").stdout


@pytest.mark.parametrize(
    ("line", "completed"),
    [
        ("acftc re", ["report", "replay", "reproduce"]),
        ("acftc run actu", ["actuator_fault"]),
        ("acftc replay bag --node f", ["fault_injector", "fdi"]),
        ("acftc simulate actuator_fault --set faults.0.s", ["faults.0.seed=", "faults.0.size_rpm="]),
        ("acftc run --mode re", ["realtime"]),
    ],
)
@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_shell_completes(shell: str, line: str, completed: list[str]):
    words = line.split()
    number = words[-1] if shell == "fish" else str(len(words) - 1)
    given = {"_ACFTC_COMPLETE": f"{shell}_complete", "COMP_WORDS": line, "COMP_CWORD": number}
    group = click.shell_completion.get_completion_class(shell)
    with patch.dict(os.environ, given):
        arguments, incomplete = group(cli, {}, "acftc", "_ACFTC_COMPLETE").get_completion_args()
        found = group(cli, {}, "acftc", "_ACFTC_COMPLETE").get_completions(arguments, incomplete)
    assert [item.value for item in found] == completed


#: How each shell is started without its user's settings, told to complete, and made to show what it would have run.
SHELLS = {
    "bash": ("--norc --noprofile -i", 'eval "$(acftc completion bash)"; acftc() { printf "<%s>" "$@" end; }'),
    "zsh": (
        "-f -i",
        'autoload -U compinit; compinit -u -D; eval "$(acftc completion zsh)"; acftc() { printf "<%s>" "$@" end; }',
    ),
    "fish": ("--no-config -i", 'acftc completion fish | source; function acftc; printf "<%s>" $argv end; end'),
}


@pytest.mark.parametrize("shell", SHELLS)
def test_a_real_shell_completes_on_tab(shell: str) -> None:
    if not shutil.which(shell):
        pytest.skip(f"no {shell} here")
    flags, setup = SHELLS[shell]
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}", "TERM": "xterm"}
    ours, theirs = pty.openpty()
    streams = {"stdin": theirs, "stdout": theirs, "stderr": theirs}
    command = ["setsid", "--ctty", shell, *flags.split()]  # the terminal is its own: fish insists
    with subprocess.Popen(command, **streams, env=environment) as child:
        os.close(theirs)
        try:
            for typed, shown in (
                (f"{setup}; echo re''ady\n", "ready"),
                ("acftc sim\tnominal\n", "<simulate><nominal><end>"),
                ("acftc run sensor_fault_\t\n", "<run><sensor_fault_derived><end>"),
                ("acftc run nominal --set dur\t7\n", "<run><nominal><--set><duration_s=7><end>"),
            ):
                os.write(ours, typed.encode())
                read_until(ours, shown)
        finally:
            child.kill()
            os.close(ours)


def read_until(terminal: int, words: str) -> None:
    """Read what is written to a terminal until it holds some words."""
    written = ""
    while words not in written:
        readable, _, _ = select.select([terminal], [], [], 60.0)
        assert readable, written
        written += os.read(terminal, 65536).decode(errors="replace")


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_prints_what_the_shell_reads(shell: str):
    result = acftc("completion", shell)
    assert result.returncode == 0
    assert "_ACFTC_COMPLETE" in result.stdout
    if shutil.which(shell):
        subprocess.run([shell, "-n"], input=result.stdout, text=True, check=True)


def on_a_terminal(*arguments: str, **environment: str) -> str:
    """What Python writes with these arguments (else `acftc scenarios`) when its output is a terminal."""
    ours, theirs = pty.openpty()
    command = [sys.executable, *(arguments or ("-m", "bringup.cli", "scenarios"))]
    with subprocess.Popen(command, stdout=theirs, stderr=theirs, env={**os.environ, **environment}) as child:
        os.close(theirs)
        written = b""
        while True:
            try:
                part = os.read(ours, 65536)
            except OSError:  # the child is gone
                break
            written += part
    os.close(ours)
    assert child.returncode == 0
    return written.decode()


def test_styles_are_for_terminals_that_want_them():
    styled, colour = re.compile(r"\x1b\["), re.compile(r"\x1b\[[\d;]*[349][0-7]m")
    assert styled.search(on_a_terminal(TERM="xterm-256color"))
    assert not colour.search(on_a_terminal(TERM="xterm-256color", NO_COLOR="1"))
    assert not styled.search(on_a_terminal(TERM="dumb"))


def test_a_remark_does_not_end_up_in_the_line_of_a_progress_bar():
    code = "from bringup.commands.console import progress_bar, say\n"
    code += "with progress_bar('a run') as progress:\n    progress(1, 2)\n    say('node fdi died')\n    progress(2, 2)"
    plain = re.sub(r"\x1b\[[\d;]*m", "", on_a_terminal("-c", code, TERM="xterm-256color"))  # no colours
    written = re.sub(r"\x1b\[[\d;?]*[A-Za-z]|\r", "\n", plain)  # whatever else moves the cursor ends a line
    assert "a run" in written
    assert "node fdi died" in written.splitlines()


def test_a_missing_or_wrong_node_names_the_nearest():
    assert_one_line(acftc("replay", "bag", "--node", "gimc_controler"), 2, "did you mean 'gimc_controller'")


def test_a_bag_that_is_none_is_one_line(tmp_path: Path):
    missing, strange = tmp_path / "missing", tmp_path / "strange"
    strange.mkdir()
    (strange / "bag_0.mcap").write_bytes(b"not an mcap file")
    for command in (["report"], ["replay", "--node", "fdi"]):
        assert_one_line(acftc(*command, str(missing)), 2, str(missing))
        assert_one_line(acftc(*command, str(strange)), 2, str(strange))
    assert not (tmp_path / "report.html").exists()
