"""YAML as users write it, and as other programs read what acftc writes."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ruamel.yaml import YAML

import ac_common
from ac_common.errors import UserError
from ac_common.yaml_file import LARGEST_FILE, parsed, shipped, text_of, yaml_text

#: As YAML can write it: no control characters but those of lines, no half of a pair.
TEXT = st.text(st.characters(blacklist_categories=("Cs", "Cc"), whitelist_characters="\n"), max_size=20)
WORDS = st.sampled_from(["yes", "No", "on", "null", "~", "1e3", "0o17", "017", "1:30", "2024-01-01", ".nan", "=", "<<"])
CONTENT = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | TEXT | WORDS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXT | WORDS, inner, max_size=4),
    max_leaves=12,
)


@given(CONTENT)
def test_what_is_written_is_read_back(content: object) -> None:
    assert parsed(yaml_text(content), "text") == content


@given(CONTENT)
def test_readers_of_yaml_1_1_read_the_same(content: object) -> None:
    reader = YAML(typ="safe", pure=True)
    reader.version = "1.1"
    assert reader.load(yaml_text(content)) == content


def test_what_comes_with_the_program_is_read_the_same_by_the_quick_reader() -> None:
    root = Path(ac_common.__file__).parents[1]
    files = [*root.glob("ac_*/**/scenarios/*.yaml"), *root.glob("ac_*/**/parameters.yaml")]
    assert len(files) > 10
    for file in files:
        assert shipped(file) == parsed(text_of(file), str(file))


def test_numbers_are_those_of_yaml_1_2() -> None:
    assert parsed("[1e3, .5, 010, 0x1F, yes, 1:30]", "text") == [1000.0, 0.5, 10, 31, "yes", "1:30"]
    assert math.isnan(parsed(".nan", "text"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: 1\nb: 2\na: 3", "key 'a' is given twice in line 3, column 1"),
        ("a: [1,", "in line 1, column 7"),
        pytest.param("- " * 3000, "nested too deeply", id="deep"),
        ("a: 2024-13-45", "month must be in 1..12"),
        ("a: !!python/object:os.system x", "could not determine a constructor"),
        ("a: 1\n---\nb: 2", "another document in line 2"),
    ],
)
def test_what_is_wrong_is_one_line_with_its_place(text: str, said: str) -> None:
    with pytest.raises(UserError, match=r"^file: ") as refused:
        parsed(text, "file")
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_file_without_end_is_refused(tmp_path) -> None:
    (tmp_path / "long.yaml").write_text("#" * (LARGEST_FILE + 1))
    with pytest.raises(UserError, match=f"too long; allowed: {LARGEST_FILE} characters"):
        text_of(tmp_path / "long.yaml")
