"""A file is either the old one or all of the new one."""

import os
import stat

import pytest

from ac_common.errors import RunError
from ac_common.files import open_whole, write_whole


def test_the_content_arrives_with_the_usual_permissions(tmp_path):
    write_whole(tmp_path / "a.txt", "grün")
    assert (tmp_path / "a.txt").read_bytes() == "grün".encode()
    mask = os.umask(0)
    os.umask(mask)
    assert stat.S_IMODE((tmp_path / "a.txt").stat().st_mode) == 0o666 & ~mask


def test_a_writer_that_fails_half_way_changes_nothing(tmp_path):
    file = tmp_path / "a.txt"
    write_whole(file, "old")

    def write_half() -> None:
        with open_whole(file) as stream:
            stream.write(b"half of the n")
            raise KeyError

    with pytest.raises(KeyError):
        write_half()
    assert file.read_text() == "old"
    assert list(tmp_path.iterdir()) == [file]


def test_where_nothing_can_be_written_one_line_says_so(tmp_path):
    with pytest.raises(RunError, match="cannot be written: No such file"):
        write_whole(tmp_path / "missing" / "a.txt", "new")
