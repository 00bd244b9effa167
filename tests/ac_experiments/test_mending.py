"""Bags without their end and bags in several files become one bag, for every reader."""

import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from ac_common.errors import UserError
from ac_experiments.bags.mending import mend, recover
from ac_experiments.bags.reader import read_bag, read_raw
from ac_experiments.bags.recorder import BagWriter, RecordedTopic
from bringup.cli import cli

REFERENCE = Path(__file__).parents[1] / "bringup" / "graph" / "reference"


def in_two_files(folder: Path, killed: bool) -> Path:
    """The reference bag as a recorder leaves it that was killed half way and started again."""
    raw = read_raw(REFERENCE)
    bag = folder / "bag"
    names = list(raw.messages)
    topics = [RecordedTopic(name, raw.types[name], 10) for name in names]
    found = [(ns, names.index(name), data) for name in names for ns, data in raw.messages[name]]
    in_order = sorted(found, key=lambda item: item[:2])
    half = len(in_order) // 2
    for part, append in ((in_order[:half], False), (in_order[half:], True)):
        writer = BagWriter(bag, topics, raw.run, append=append)
        for log_ns, number, data in part:
            writer.write(number, data, log_ns, log_ns)
        writer.close()
    if killed:
        first = bag / "bag_0.mcap"
        first.write_bytes(first.read_bytes()[:-200])  # its end is gone, its messages are not
    return bag


def assert_is_one_bag(bag: Path) -> None:
    (file,) = bag.glob("*.mcap")
    ours, theirs = read_raw(REFERENCE), read_raw(bag)
    assert theirs.messages == ours.messages
    count = sum(map(len, ours.messages.values()))
    with file.open("rb") as stream:  # what PlotJuggler and Foxglove read: this file and its index
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == count
    assert len({channel.topic for channel in summary.channels.values()}) == len(summary.channels)
    with AnyReader([bag]) as reader:
        assert sum(connection.msgcount for connection in reader.connections) == count
        assert sum(1 for _ in reader.messages()) == count


@pytest.mark.parametrize("killed", [True, False])
def test_several_files_become_one_at_the_end_of_a_run(killed: bool, tmp_path: Path) -> None:
    bag = in_two_files(tmp_path, killed)
    assert [file.name for file in mend(bag)] == ["bag_0.mcap"][:killed]
    assert_is_one_bag(bag)
    assert read_bag(bag).metadata["complete"] is not killed


@pytest.mark.parametrize("has_metadata", [True, False])
def test_recover_gives_a_bag_its_index_and_metadata(has_metadata: bool, tmp_path: Path) -> None:
    bag = in_two_files(tmp_path, killed=True)
    if not has_metadata:
        (bag / "metadata.yaml").unlink()
    done = CliRunner().invoke(cli, ["bags", "recover", str(tmp_path)])
    assert done.exit_code == 0, done.exception
    assert "made whole from bag_0.mcap, bag_1.mcap" in done.output
    assert_is_one_bag(bag)
    assert "was whole" in CliRunner().invoke(cli, ["bags", "recover", str(bag)]).output


def test_recover_takes_a_bare_file(tmp_path: Path) -> None:
    file = tmp_path / "cut.mcap"
    whole = (REFERENCE / "bag_0.mcap").read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    touched, count = recover(file)
    assert touched == [file]
    with file.open("rb") as stream:
        assert sum(1 for _ in make_reader(stream).iter_messages()) == count > 100
    assert {each.name for each in tmp_path.iterdir()} == {"cut.mcap"}


def test_what_is_no_bag_is_one_line_and_stays(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no such bag"):
        recover(tmp_path / "nothing")
    with pytest.raises(UserError, match="no bag in this folder"):
        recover(tmp_path)
    shutil.copy(__file__, tmp_path / "text.mcap")
    with pytest.raises(UserError, match="not a readable bag"):
        recover(tmp_path / "text.mcap")
    assert (tmp_path / "text.mcap").read_bytes() == Path(__file__).read_bytes()
