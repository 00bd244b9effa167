"""A bag of the loop that another program has recorded: written by `rosbags`, as rosbag2 lays it out."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from ac_common.errors import UserError
from ac_experiments.bags.reader import read_bag, read_raw
from bringup.cli import cli
from bringup.replay.replay import replay

REFERENCE = Path(__file__).parent / "reference"


def recorded(folder: Path, keep: str = "/ac/") -> Path:
    """What `ros2 bag record` would have made of the topics of the reference run: messages alone."""
    raw, types = read_raw(REFERENCE), get_typestore(Stores.ROS2_JAZZY)
    bag = folder / "rosbag2"
    with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {
            name: writer.add_connection(name, raw.types[name], typestore=types) for name in raw.messages if keep in name
        }
        in_order = sorted((ns, name, data) for name in connections for ns, data in raw.messages[name])
        for log_ns, name, data in in_order:
            writer.write(connections[name], log_ns, data)
    return bag


def test_it_is_read_as_far_as_its_topics_go(tmp_path: Path) -> None:
    bag, ours = read_bag(recorded(tmp_path)), read_bag(REFERENCE)
    assert len(bag.time_s) == len(ours.time_s)
    for key, column in ours.series.items():
        assert np.array_equal(bag.series[key], column, equal_nan=True), key
    assert bag.metadata["mode"] == ours.metadata["mode"]
    assert bag.metadata["passive"] == ours.metadata["passive"]
    assert bag.metadata["sample_time_s"] == ours.metadata["sample_time_s"]
    assert bag.metadata["scenario"]["operating_point"] == ours.metadata["scenario"]["operating_point"]


def test_it_has_a_report(tmp_path: Path) -> None:
    done = CliRunner().invoke(cli, ["report", str(recorded(tmp_path)), "--out", str(tmp_path / "r.html")])
    assert done.exit_code == 0, done.exception
    assert (tmp_path / "r.html").stat().st_size > 10_000


@pytest.mark.ros
def test_it_can_be_replayed(tmp_path: Path) -> None:
    result = replay(recorded(tmp_path), "fdi")
    assert result.compared == 6 * result.ticks > 0
    # The design is not in such a bag and is made anew: by a synthesis that may have rounded differently then.
    assert result.largest_relative_difference < 1e-4


def test_one_without_the_loop_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="holds no run of acftc"):
        read_bag(recorded(tmp_path, keep="/clock"))
