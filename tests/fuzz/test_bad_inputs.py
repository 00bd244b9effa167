"""Bad files, shortened: by hand `bad_inputs.py` gives 10,000 of each kind, and `guided.py` five minutes of each."""

import platform
import subprocess
import sys
from pathlib import Path

import pytest
from bad_inputs import KINDS, Kind, judge, read_recording, small_bag
from mutations import spoiled_bag

INPUTS = {
    "scenario": 250,
    "override": 250,
    "bag": 300,
    "design": 300,
    "plant": 40,
    "cycle": 300,
    "node": 100,
    "params": 150,
}


@pytest.mark.parametrize("name", KINDS)
def test_bad_input_is_one_clear_line_and_exit_code_2(name: str) -> None:
    # In a process of its own: it forks, which a process that has threads of the middleware must not.
    script = Path(__file__).with_name("bad_inputs.py")
    command = [sys.executable, str(script), "--kind", name, "--inputs", str(INPUTS[name]), "--seed", "1"]
    result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=200)
    assert result.returncode == 0, (result.stdout + result.stderr)[-3000:]
    accepted, refused = (int(word) for word in result.stdout.splitlines()[1].split()[2:4])
    # A fuzzer whose inputs are all good, or all refused at the first byte, tests nothing.
    assert refused > INPUTS[name] // 3
    assert accepted > 0


def test_the_good_bag_is_accepted(tmp_path: Path) -> None:
    file = tmp_path / "good.mcap"
    file.write_bytes(small_bag())
    assert judge(KINDS["bag"], file) == (0, "")


def test_a_traceback_or_a_second_line_would_be_noticed(tmp_path: Path) -> None:
    def broken(file: Path) -> None:
        read_recording(file)
        raise KeyError("deep\ninside")

    def hanging(_file: Path) -> None:
        while True:
            pass

    file = tmp_path / "good.mcap"
    file.write_bytes(small_bag())
    code, problem = judge(Kind("bag", ".mcap", lambda rng: spoiled_bag(b"", rng), broken), file)
    assert (code, "exit code 1" in problem) == (1, True)
    code, problem = judge(Kind("bag", ".mcap", lambda rng: spoiled_bag(b"", rng), hanging), file, patience_s=0.1)
    assert "hung" in problem


@pytest.mark.skipif(platform.machine() != "x86_64", reason="atheris has wheels for x86-64 only")
@pytest.mark.slow
@pytest.mark.parametrize("target", ["messages", "scenario"])
def test_coverage_guided_fuzzing_finds_nothing(target: str) -> None:
    script = Path(__file__).with_name("guided.py")
    command = [sys.executable, str(script), target, "--seconds", "10", "--seed", "1"]
    result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert result.returncode == 0, (result.stdout + result.stderr)[-3000:]
    assert "stat::number_of_executed_units" in result.stderr
