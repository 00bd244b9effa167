"""The designs of the whole envelope in the graph: the numbers of the simulation, replayed, and after a crash."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from ac_common.design_file import ATTACHMENT, DESIGNED, loaded
from ac_common.faults import ISOLABLE_KINDS
from ac_common.fdi_status import StatusRow
from ac_common.topics import COMPENSATOR, CONTROLLER, FDI, SERIES
from ac_experiments.bags.reader import read_bag, read_raw
from ac_experiments.scenario import check
from ac_experiments.scenario_schema import Scenario
from ac_experiments.simulate import simulate
from bringup.launch.launch import GraphRun, run_graph
from bringup.launch.user_nodes import UserNodes
from bringup.replay.replay import replay
from fdi_node import making
from gimc_controller_node import accommodation
from tests.design_files import design_parameters

pytestmark = pytest.mark.ros

#: The load moves, there are both faults, and the superheat that is wanted is more than the air can give.
DRIVE = {
    "name": "short_drive",
    "design": "envelope",
    "duration_s": 36.0,
    "references": {"superheat_k": [{"at_s": 1, "to": 12.0}]},
    "air": {
        "mass_flow_percent": [{"at_s": 2, "to": 25.0}],
        "inlet_temperature_k": [{"at_s": 1, "to": -6.0, "ramp_s": 10}],
        "condenser_inlet_temperature_k": [{"at_s": 1, "to": 3.0, "ramp_s": 10}],
    },
    "faults": [
        {"kind": "compressor_speed", "size_rpm": 40, "onset_s": 27},
        {"kind": "evaporator_pressure", "size_kpa": 5, "onset_s": 30},
    ],
    "noise": {
        "evaporator_pressure_kpa": 0.2,
        "superheat_k": 0.1,
        "wall_temperature_k": 0.05,
        "condenser_pressure_kpa": 2.0,
        "seed": 7,
    },
}


def numbers(row: StatusRow) -> tuple[float, ...]:
    return (row.time_s, row.detected, row.size, row.onset_s, row.isolated_s, *row.thresholds)


@pytest.fixture(scope="module")
def drive() -> Scenario:
    return check(DRIVE)


@pytest.fixture(scope="module")
def run(drive: Scenario, tmp_path_factory: pytest.TempPathFactory) -> GraphRun:
    return run_graph(drive, tmp_path_factory.mktemp("drive"))


def test_graph_gives_the_numbers_of_the_simulation(run: GraphRun, drive: Scenario) -> None:
    recorded, simulated = read_bag(run.bag), simulate(drive)
    assert recorded.metadata["complete"]
    for key in SERIES:
        np.testing.assert_array_equal(recorded.series[key], simulated.series[key], err_msg=key)
    np.testing.assert_array_equal(*([numbers(row) for row in side.status] for side in (recorded, simulated)))
    said = [row.acted_on for row in recorded.status]
    assert said == [row.acted_on for row in simulated.status]
    # All that the envelope has beside the designs of one point has been at work.
    assert {isolated for isolated, _ in said} & set(ISOLABLE_KINDS)
    assert recorded.series["compensator/q:compressor"].any()
    assert any("superheat reference" in event["what"] for event in simulated.metadata["events"])


@pytest.mark.parametrize("node", [FDI, COMPENSATOR, CONTROLLER])
def test_node_answers_as_recorded(run: GraphRun, node: str) -> None:
    result = replay(run.bag, node)
    assert result.ticks == run.ticks
    assert result.bit_for_bit, result.differences


def test_bag_holds_the_designs_that_were_used(run: GraphRun, tmp_path: Path) -> None:
    raw = read_raw(run.bag)
    kinds = {FDI: making.KINDS, COMPENSATOR: accommodation.KINDS}
    assert {ATTACHMENT.format(node) for node in DESIGNED} <= set(raw.attachments)
    for node, allowed in kinds.items():
        file = tmp_path / f"{node}.npz"
        file.write_bytes(raw.attachments[ATTACHMENT.format(node)])
        design = loaded(allowed, node, str(file), 0.1, wanted="envelope")
        assert type(design).__name__ == allowed[1].holds


@pytest.mark.parametrize(
    ("module", "given", "design", "said"),
    [
        ("fdi_node", COMPENSATOR, "", "holds no FdiDesign: it holds one of the class EnvelopeCompensatorDesign"),
        ("fdi_node", FDI, "paper", "a design of `design: envelope`, in a run with paper"),
        ("gimc_controller_node.compensator_node", FDI, "", "holds no CompensatorDesign: it holds one of the class Env"),
        ("gimc_controller_node", COMPENSATOR, "", "holds no ControllerDesign: it holds one of the class Env"),
    ],
)
def test_a_node_says_in_one_line_that_a_design_is_of_another_kind(
    module: str, given: str, design: str, said: str, tmp_path: Path
) -> None:
    file = design_parameters(given, tmp_path, "envelope")["design_file"]
    arguments = ["-m", module, "--ros-args", "-p", f"design_file:={file}"]
    arguments += ["-p", f"design:={design}"] if design else []
    result = subprocess.run([sys.executable, *arguments], capture_output=True, text=True, timeout=120)
    assert result.returncode == 2
    assert result.stderr.count("\n") == 1
    assert said in result.stderr


def test_a_run_refuses_a_design_of_the_other_kind(tmp_path: Path) -> None:
    """A file of the user's own for one node only, where the others have designs of the envelope."""
    mine = design_parameters(FDI, tmp_path)["design_file"]
    own = tmp_path / "own.yaml"
    own.write_text(f"/ac/fdi: {{ros__parameters: {{design_file: {mine}}}}}\n")
    scenario = check({"name": "mixed", "design": "envelope", "duration_s": 1.0})
    with pytest.raises(ValueError, match="in a run with envelope"):
        run_graph(scenario, tmp_path / "run", user=UserNodes(params_file=own))
