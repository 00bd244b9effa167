"""docs/faults.md is whole: of every fault a picture of sane size, a section, a row, and its place in the matrices."""

import re
from pathlib import Path

import pytest

from ac_common.faults import FAULTS
from ac_design.analysis.isolability import SENSOR_SETS
from docs.tools.fault_pictures import CASES, HEAD, with_table

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "faults.md").read_text(encoding="utf-8")
LARGEST_BYTES = 60_000


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_each_fault_has_picture_section_and_row(case) -> None:
    assert (DOCS / "faults" / f"{case.name}.svg").stat().st_size < LARGEST_BYTES
    assert PAGE.count(f"(faults/{case.name}.svg)") == 1
    (section,) = (part for part in PAGE.split("\n### ") if f"(faults/{case.name}.svg)" in part)
    words = "profile `stuck`. " if case.is_stuck else f"`{case.fault.kind}`. "
    assert f"`{case.fault.kind}`" in section
    assert len(section.split(words)[1].split("![")[0].split()) >= 4  # what a driver would notice
    assert len(re.findall(rf"^\| `{case.fault.kind}` \| {re.escape(case.size)} \|", PAGE, re.MULTILINE)) == 1


def test_the_table_has_the_heads_that_the_command_writes() -> None:
    assert PAGE.count(f"\n{HEAD}\n") == 1


def test_pictures_of_no_other_fault_are_kept() -> None:
    assert {file.stem for file in (DOCS / "faults").iterdir()} == {case.name for case in CASES}


def test_the_matrices_have_all_faults() -> None:
    for sensors in SENSOR_SETS:
        _, _, rest = PAGE.partition(f"**{sensors.name}**\n")
        rows = re.findall(r"^\| \d+ `(\w+)` \|", rest.partition("**")[0].partition("<!--")[0], re.MULTILINE)
        assert tuple(rows) == sensors.faults
    assert set(SENSOR_SETS[-1].faults) == {fault.kind for fault in FAULTS}


def test_a_table_is_exchanged_between_its_comments() -> None:
    marks = "<!-- a: written by docs.tools.fault_pictures -->", "<!-- end of a -->"
    page = f"before {marks[0]} old {marks[1]} after"
    assert with_table(page, "a", "new") == f"before {marks[0]}\n\nnew\n\n{marks[1]} after"
    for broken in ("", page + page):
        with pytest.raises(ValueError, match="once"):
            with_table(broken, "a", "new")
