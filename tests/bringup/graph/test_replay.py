"""Replay: every node answers its recorded inputs as it did, and a change of behaviour shows."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ac_common.errors import UserError
from bringup.launch.launch import GraphRun
from bringup.replay.replay import replay

pytestmark = pytest.mark.ros


# The reference bag is replayed through every node; these two must agree to the last bit on the machine that recorded.
@pytest.mark.parametrize("node", ["fdi", "ac_plant"])
def test_node_answers_as_recorded(run: GraphRun, node: str) -> None:
    result = replay(run.bag, node)
    assert result.ticks == run.ticks
    assert result.bit_for_bit, result.differences
    assert result.same


def test_changed_behaviour_shows(run: GraphRun) -> None:
    result = replay(run.bag, "fault_injector", parameters={"seed": 8})
    assert not result.same
    assert result.different > 0
    assert any("measured/superheat" in line for line in result.differences)
    assert result.identical > 0  # the truth about the faults does not depend on the noise


def test_bag_cut_short_can_be_replayed(run: GraphRun, tmp_path: Path) -> None:
    (file,) = run.bag.glob("*.mcap")
    part = tmp_path / "part.mcap"
    shutil.copy(file, part)
    with part.open("r+b") as stream:
        stream.truncate(file.stat().st_size // 3)
    result = replay(part, "fdi")
    assert 0 < result.ticks < run.ticks
    assert result.bit_for_bit


def test_wrong_names_are_clear(run: GraphRun, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no node 'fid' can be replayed; allowed: "):
        replay(run.bag, "fid")
    with pytest.raises(UserError, match="no such bag"):
        replay(tmp_path / "nothing", "fdi")


def test_another_plant_is_refused_in_one_line(run: GraphRun, tmp_path: Path) -> None:
    """By the command, as a user meets it; the message names both plants and what to do."""
    (tmp_path / "heavy.yaml").write_text("charge_kg: 0.52\n")
    command = [sys.executable, "-m", "bringup.cli", "--plant", "heavy.yaml", "replay", str(run.bag), "--node", "fdi"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False, timeout=60)
    assert done.returncode == 2
    assert done.stdout == ""
    assert re.fullmatch(
        r"acftc: \S+: recorded with the plant parameters\.yaml [0-9a-f]{16}, "
        r"in use is heavy\.yaml [0-9a-f]{16}; give it with --plant\n",
        done.stderr,
    )
