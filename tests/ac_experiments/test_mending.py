"""Bags without their end and bags in several files become one bag, for every reader."""

import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
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
    touched, count, damaged = recover(file)
    assert (touched, damaged) == ([file], {})
    with file.open("rb") as stream:
        assert sum(1 for _ in make_reader(stream).iter_messages()) == count > 100
    assert {each.name for each in tmp_path.iterdir()} == {"cut.mcap"}


def in_order(file: Path) -> list[tuple[int, bytes]]:
    """All messages of a file as they follow each other in it, read by its index."""
    with file.open("rb") as stream:
        found = make_reader(stream).iter_messages(log_time_order=False)
        return [(message.log_time, message.data) for _, _, message in found]


def spoilt(how: str) -> bytes:
    """The reference bag's file with damage: 4 KiB of garbage after two thirds of it, or 64 bytes of a chunk flipped."""
    whole = (REFERENCE / "bag_0.mcap").read_bytes()
    with (REFERENCE / "bag_0.mcap").open("rb") as stream:
        ends = [(stream.tell(), isinstance(each, Chunk)) for each in StreamReader(stream, emit_chunks=True).records]
    cut = whole[: max(end for end, _ in ends if end <= 2 * len(whole) // 3)]
    at = max(end for end, is_chunk in ends if is_chunk and end <= len(whole) // 3) - 200
    flipped = bytes(byte ^ 0xFF for byte in cut[at : at + 64])
    return {
        "garbage at its end": cut + b"\xe5" * 4096,
        "bytes flipped, no end": cut[:at] + flipped + cut[at + 64 :],
        "bytes flipped": whole[:at] + flipped + whole[at + 64 :],
    }[how]


@pytest.mark.parametrize("how", ["garbage at its end", "bytes flipped, no end", "bytes flipped"])
def test_what_is_before_damage_is_kept(how: str, tmp_path: Path) -> None:
    bag = shutil.copytree(REFERENCE, tmp_path / "bag")
    file = bag / "bag_0.mcap"
    file.write_bytes(spoilt(how))
    done = CliRunner().invoke(cli, ["bags", "recover", str(bag)])
    assert done.exit_code == 0, done.exception
    kept, all_of_it = in_order(file), in_order(REFERENCE / "bag_0.mcap")
    # Of the bytes two thirds or one third are before the damage, so about as much of the messages.
    assert len(kept) > len(all_of_it) * (0.6 if how == "garbage at its end" else 0.25)
    assert kept == all_of_it[: len(kept)]
    assert f"bag_0.mcap is damaged: its first {len(kept)} messages were kept" in done.output
    assert (bag / "bag_0.mcap.damaged").read_bytes() == spoilt(how)
    assert not read_raw(bag).complete
    assert "was whole" in CliRunner().invoke(cli, ["bags", "recover", str(bag)]).output


def test_a_damaged_chunk_is_not_copied_under_a_new_checksum(tmp_path: Path) -> None:
    """Of chunks without compression nothing but the checksum tells; both files have their ends."""
    bag = tmp_path / "bag"
    bag.mkdir()
    for number in range(2):
        with (bag / f"bag_{number}.mcap").open("wb") as stream:
            writer = Writer(stream, compression=CompressionType.NONE)
            writer.start()
            channel = writer.register_channel("/number", "cdr", writer.register_schema("a/msg/Number", "ros2msg", b""))
            writer.add_message(channel, number, b"%d is what was sent" % number, number)
            writer.finish()
    first = bag / "bag_0.mcap"
    first.write_bytes(first.read_bytes().replace(b"0 is what was sent", b"7 is what was sent"))
    touched, count, damaged = recover(bag)
    assert ([file.name for file in touched], count, damaged) == (["bag_0.mcap", "bag_1.mcap"], 1, {first: 0})
    raw = read_raw(bag)
    assert [data for _, data in raw.messages["/number"]] == [b"1 is what was sent"]
    assert not raw.complete


def test_what_is_no_bag_is_one_line_and_stays(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no such bag"):
        recover(tmp_path / "nothing")
    with pytest.raises(UserError, match="no bag in this folder"):
        recover(tmp_path)
    shutil.copy(__file__, tmp_path / "text.mcap")
    with pytest.raises(UserError, match="not a readable bag") as refused:
        recover(tmp_path / "text.mcap")
    assert "\n" not in str(refused.value)
    assert (tmp_path / "text.mcap").read_bytes() == Path(__file__).read_bytes()
