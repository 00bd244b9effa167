"""Thousands of bad files, each given to what reads it: one clear line, exit code 2, no traceback, never a hang.

    python tests/fuzz/bad_inputs.py                       # 10,000 inputs of each kind
    python tests/fuzz/bad_inputs.py --kind bag --seed 7 --inputs 1000

Every input is made from a good one, the seed and its number, so a failing one can be made again; it is left in the
folder that is printed. The reading goes through the command line's own handling of errors.
"""

import argparse
import contextlib
import io
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import click
import numpy as np
from mutations import spoiled_bag, spoiled_npz, spoiled_text, spoiled_yaml

from ac_common.design_file import from_file, to_bytes
from ac_common.health import health_of
from ac_common.topics import FDI
from ac_design import design_of
from ac_experiments.bags.comparison import by_tick
from ac_experiments.bags.reader import health_reports, read_bag, read_raw, run_of
from ac_experiments.bags.recorder import BagWriter, RecordedTopic
from ac_experiments.metrics import summarise
from ac_experiments.scenario import BUILT_IN, load, schedule
from ac_plant_node import load_parameters
from ac_plant_node.drive_cycle import load_drive_cycle
from bringup import cli
from bringup.launch.process_table import PROCESSES
from bringup.launch.user_nodes import user_nodes
from bringup.replay.replay import _design, _parameters

#: An input that takes longer has made its reader hang, s.
PATIENCE_S = 10.0
#: A line that is longer is no clear line.
LONGEST_LINE = 1000
#: What reading a bad file of some kilobytes may take at most, bytes of address space.
MEMORY = 8 * 2**30
REFERENCE = Path(__file__).parents[1] / "bringup" / "graph" / "reference" / "bag_0.mcap"
#: Ticks of the good bag.
BAG_TICKS = 25

Spoil = Callable[[random.Random], bytes]
Read = Callable[[Path], object]


@dataclass(frozen=True)
class Kind:
    """A kind of input: how a bad one is made, and how it is read."""

    name: str
    suffix: str
    spoil: Spoil
    read: Read


@dataclass
class Outcome:
    """What became of the inputs of one kind."""

    accepted: int = 0
    refused: int = 0
    slowest_s: float = 0.0
    failures: list[str] = field(default_factory=list)


# ------------------------------------------------------------------------------------------------------ what is read


def read_scenario(file: Path) -> None:
    """A scenario file, checked and turned into arrays."""
    _play(load(file))


def read_override(file: Path) -> None:
    """``--set KEY=VALUE``."""
    _play(load("actuator_fault", [file.read_bytes().decode("utf-8", "replace")]))


def _play(scenario: Any) -> None:
    short = scenario.model_copy(update={"duration_s": min(scenario.duration_s, 5.0)})
    plan = schedule(short, np.array([100.0, 0.4, 0.1, 30.0, 0.55, 30.0, 0.0]), np.array([2.5e5, 20.0, 15.0, 1.3e6]))
    for array in (plan.reference, plan.air, plan.faults):
        assert np.isfinite(array).all(), "an accepted scenario gives numbers that are not finite"


def read_recording(file: Path) -> None:
    """A bag, as `acftc report` and `acftc replay` read it, up to the drawing and to starting the node."""
    summarise(read_bag(file))
    raw = read_raw(file)
    health_of(health_reports(raw))
    by_tick(raw, FDI)
    run, scenario = run_of(raw, file)
    with tempfile.TemporaryDirectory() as folder:
        _parameters(scenario, run["passive"], FDI, Path(folder))
        _design(raw, scenario, FDI, Path(folder))


def read_design(file: Path) -> None:
    """A design file of a node."""
    from fdi_node import FaultDetector, FdiDesign

    detector = FaultDetector(from_file(FdiDesign, str(file), 0.1))
    detector.observe(0.0, np.array([2.5e5, 20.0, 15.0]), 30.0)
    detector.commanded(np.array([100.0, 0.4]))


def read_node_parameters(file: Path) -> None:
    """A node's parameter file; in a process of its own, since the parser is the middleware's and not memory-safe."""
    from ac_ros_common.rclpy_init import ArgumentError, init

    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        said, code = b"", 3
        try:
            init(["fdi", "--ros-args", "--params-file", str(file)])
            code = 0
        except ArgumentError as problem:
            said, code = str(problem).encode(errors="replace"), 2
        finally:
            os.write(writing, said[:1000])
            os._exit(code)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        said = pipe.read()
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if status == 2:
        raise ArgumentError(said.decode())
    assert status == 0, f"the process ended with {status}"


# ---------------------------------------------------------------------------------------------------- what is spoiled


@cache
def _scenarios() -> tuple[str, ...]:
    return tuple(path.read_text() for path in sorted(BUILT_IN.glob("*.yaml")))


@cache
def small_bag() -> bytes:
    """The first ticks of the reference bag, as a bag."""
    raw = read_raw(REFERENCE)
    with tempfile.TemporaryDirectory() as folder:
        topics = [RecordedTopic(name, kind, 10, 1.0) for name, kind in raw.types.items()]
        bag = BagWriter(Path(folder) / "bag", topics, {**raw.run, "ticks": BAG_TICKS})
        for number, topic in enumerate(topics):
            for time_ns, data in raw.messages[topic.name][:BAG_TICKS]:
                bag.write(number, data, time_ns, time_ns)
        for name, data in raw.attachments.items():
            bag.attach(name, data)
        bag.close()
        return (Path(folder) / "bag" / "bag_0.mcap").read_bytes()


@cache
def _design_file() -> bytes:
    return to_bytes(design_of(FDI, "med", 0.1))


@cache
def _plant_parameters() -> str:
    import ac_plant_node.parameters

    return Path(ac_plant_node.parameters.__file__).with_name("parameters.yaml").read_text()


_CYCLE = "Test cycle\ntime,speed (mph)\n" + "".join(f"{t},{t % 50}\n" for t in range(60))
_OWN_PARAMETERS = """
/ac/fdi: {ros__parameters: {design_file: mine.npz, memory_file: ""}}
/ac/gimc_controller: {ros__parameters: {protection: {release_s: 20.0, lowest_superheat_k: 2.0}}}
"""
_OVERRIDES = ("faults.0.size_rpm=60", "duration_s=20", "references.superheat_k.0.to=1", "noise={seed: 3}", "name=x")


def _spoiled_override(rng: random.Random) -> bytes:
    return spoiled_text(rng.choice(_OVERRIDES), rng).encode("utf-8", "surrogatepass")


def _spoiled_node_file(rng: random.Random) -> bytes:
    return spoiled_yaml(PROCESSES[FDI].parameter_file.read_text(), rng)


KINDS = {
    kind.name: kind
    for kind in (
        Kind("scenario", ".yaml", lambda rng: spoiled_yaml(rng.choice(_scenarios()), rng), read_scenario),
        Kind("override", ".txt", _spoiled_override, read_override),
        Kind("bag", ".mcap", lambda rng: spoiled_bag(small_bag(), rng), read_recording),
        Kind("design", ".npz", lambda rng: spoiled_npz(_design_file(), rng), read_design),
        Kind("plant", ".yaml", lambda rng: spoiled_yaml(_plant_parameters(), rng), load_parameters),
        Kind(
            "cycle",
            ".csv",
            lambda rng: spoiled_text(_CYCLE, rng).encode("utf-8", "surrogatepass"),
            load_drive_cycle,
        ),
        Kind("node", ".yaml", _spoiled_node_file, read_node_parameters),
        Kind(
            "params", ".yaml", lambda rng: spoiled_yaml(_OWN_PARAMETERS, rng), lambda file: user_nodes(params_file=file)
        ),
    )
}


# ------------------------------------------------------------------------------------------------------------ judging


class HangError(BaseException):
    """An input took too long; no handler of ordinary errors may swallow this."""


@contextlib.contextmanager
def _patience(patience_s: float) -> Iterator[None]:
    def late(*_: object) -> None:
        raise HangError

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, patience_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def judge(kind: Kind, file: Path, patience_s: float = PATIENCE_S) -> tuple[int, str]:
    """Read one file as the command line would: its exit code, and what is wrong with the way it was refused."""

    @click.command()
    def reading() -> None:
        kind.read(file)

    cli.cli.commands["reading"] = reading
    said = io.StringIO()
    code: Any = 0
    try:
        with _patience(patience_s), contextlib.redirect_stderr(said), warnings.catch_warnings():
            warnings.simplefilter("error")
            cli.main(["reading"])
    except SystemExit as end:
        code = end.code
    except HangError:
        return 2, f"hung for more than {patience_s:g} s"
    finally:
        del cli.cli.commands["reading"]
    line = said.getvalue()
    if code == 0:
        return 0, f"accepted, but said {line!r}" if line else ""
    if code != 2:
        return code, f"exit code {code}: {line.strip()[:300]}"
    if line.count("\n") != 1 or "Traceback" in line or len(line) > LONGEST_LINE:
        return code, f"not one clear line: {line[:300]!r}"
    return code, ""


def attack(kind: Kind, inputs: int, seed: int, folder: Path, first: int = 0) -> Outcome:
    """Give `inputs` bad files to the reader of a kind; the failing ones stay in `folder`."""
    outcome = Outcome()
    for number in range(first, first + inputs):
        file = folder / f"{kind.name}-{seed}-{number}{kind.suffix}"
        file.write_bytes(kind.spoil(random.Random(f"{seed}/{kind.name}/{number}")))
        started_s = time.monotonic()
        code, problem = judge(kind, file)
        outcome.slowest_s = max(outcome.slowest_s, time.monotonic() - started_s)
        outcome.accepted += code == 0
        outcome.refused += code != 0
        if problem:
            outcome.failures.append(f"{file.name}: {problem}")
        else:
            file.unlink()
    return outcome


def main() -> int:
    """Attack and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=10_000, help="of each kind (default 10000)")
    parser.add_argument("--kind", choices=list(KINDS), help="only this kind")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first input (default 0)")
    options = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    folder = Path(tempfile.mkdtemp(prefix="acftc-fuzz-"))
    print(f"{'kind':10} {'inputs':>7} {'accepted':>8} {'refused':>8} {'failures':>8} {'slowest':>8}")
    failures = []
    for name in [options.kind] if options.kind else list(KINDS):
        outcome = attack(KINDS[name], options.inputs, options.seed, folder, options.first)
        failures += outcome.failures
        print(
            f"{name:10} {options.inputs:7} {outcome.accepted:8} {outcome.refused:8} {len(outcome.failures):8} "
            f"{outcome.slowest_s:6.2f} s",
            flush=True,
        )
    for line in failures[:40]:
        print(line)
    if failures:
        print(f"the files are in {folder}")
        return 1
    shutil.rmtree(folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
