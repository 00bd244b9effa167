"""A design is taken from the cache only when everything that decides it is the same."""

import importlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from ac_common.cache import cached, source_fingerprint
from ac_design import FdiWeights
from ac_design.store import cached_design
from ac_plant_node.parameters.file import PLANT_VARIABLE

SYNTHESIS = """
import numpy as np
calls = []
def synthesise(point, sample_time_s, *weights):
    calls.append((point, sample_time_s, *weights))
    return {"number": np.array(len(calls))}
"""


@pytest.fixture
def design(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Ask for a design; the number of its synthesis."""
    (tmp_path / "counting_synthesis.py").write_text(SYNTHESIS)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("ACFTC_CACHE_DIR", str(tmp_path / "cache"))
    yield lambda *what: int(cached_design("test", "counting_synthesis", *what)["number"])
    sys.modules.pop("counting_synthesis", None)


def test_the_same_content_is_computed_once(design):
    assert [design("med", 0.1, FdiWeights()) for _ in range(3)] == [1, 1, 1]


def test_point_sample_time_and_weights_make_designs_of_their_own(design):
    assert design("med", 0.1, FdiWeights()) == 1
    assert design("low", 0.1, FdiWeights()) == 2
    assert design("med", 0.05, FdiWeights()) == 3
    assert design("med", 0.1, FdiWeights(superheat="derived")) == 4
    assert design("med", 0.1, FdiWeights()) == 1


def test_a_changed_plant_never_meets_a_stale_design(design, tmp_path, monkeypatch):
    assert design("med", 0.1) == 1
    own = tmp_path / "own.yaml"
    monkeypatch.setenv(PLANT_VARIABLE, str(own))
    own.write_text("charge_kg: 0.50\n")  # as shipped
    assert design("med", 0.1) == 1
    own.write_text("charge_kg: 0.51\n")
    assert design("med", 0.1) == 2


def test_a_changed_line_of_code_never_meets_a_stale_design(tmp_path, monkeypatch):
    package = tmp_path / "some_package"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "synthesis.py").write_text("gamma = 1.0\n")
    (package / "node.py").write_text("print('moves messages')\n")
    monkeypatch.syspath_prepend(tmp_path)
    before = source_fingerprint("some_package")
    (package / "node.py").write_text("print('moves them otherwise')\n")
    assert source_fingerprint("some_package") == before
    (package / "synthesis.py").write_text("gamma = 2.0\n")
    assert source_fingerprint("some_package") != before


def test_a_single_module_is_told_by_its_own_text_alone(tmp_path, monkeypatch):
    package = tmp_path / "another_package"
    package.mkdir()
    for name in ("__init__", "constants", "others"):
        (package / f"{name}.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)
    before = source_fingerprint("another_package.constants")
    (package / "others.py").write_text("gamma = 1.0\n")
    assert source_fingerprint("another_package.constants") == before
    (package / "constants.py").write_text("N = 5\n")
    assert source_fingerprint("another_package.constants") != before


def test_a_damaged_file_is_computed_anew(design, tmp_path):
    assert design("med", 0.1) == 1
    (file,) = (tmp_path / "cache").glob("*.npz")
    file.write_bytes(file.read_bytes()[:50])
    assert design("med", 0.1) == 2
    assert np.load(file)["number"] == 2


COMPILED = """
from ac_common.compiled import compiler
@compiler("compiled_somewhere")
def twice(x):
    return 2.0 * x
"""


def test_a_copy_of_the_sources_shares_what_is_compiled(tmp_path, monkeypatch):
    monkeypatch.setenv("ACFTC_CACHE_DIR", str(tmp_path / "cache"))
    found = {}
    for place, text in (("first", COMPILED), ("copy", COMPILED), ("changed", COMPILED.replace("2.0", "3.0"))):
        (tmp_path / place).mkdir()
        (tmp_path / place / "compiled_somewhere.py").write_text(text)
        with monkeypatch.context() as patch:
            patch.syspath_prepend(tmp_path / place)
            patch.delitem(sys.modules, "compiled_somewhere", raising=False)
            twice = importlib.import_module("compiled_somewhere").twice
            found[place] = twice(4.0), sum(twice.stats.cache_hits.values())
    sys.modules.pop("compiled_somewhere", None)
    assert found == {"first": (8.0, 0), "copy": (8.0, 1), "changed": (12.0, 0)}


def test_where_nothing_can_be_written_it_is_compiled_all_the_same(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    (tmp_path / "compiled_somewhere.py").write_text(COMPILED)
    monkeypatch.setenv("ACFTC_CACHE_DIR", str(tmp_path / "file" / "below"))
    monkeypatch.syspath_prepend(tmp_path)
    twice = importlib.import_module("compiled_somewhere").twice
    sys.modules.pop("compiled_somewhere", None)
    assert twice(4.0) == 8.0


@pytest.mark.slow
def test_everything_goes_into_the_folder_that_the_user_names(tmp_path):
    """Property tables and compiled code, by a command that has to make both."""
    named, usual = tmp_path / "named", tmp_path / "usual"
    root = Path(source_fingerprint.__code__.co_filename).parents[1]
    beside_the_sources = sorted(root.glob("ac_*/**/__pycache__/*.nb[ci]"))
    places = {"ACFTC_CACHE_DIR": str(named), "XDG_CACHE_HOME": str(usual), "HOME": str(tmp_path / "home")}
    command = [sys.executable, "-m", "bringup.cli", "equilibria", "--json"]
    subprocess.run(command, env={**os.environ, **places}, cwd=root, capture_output=True, check=True, timeout=280)
    assert [file.suffix for file in named.glob("tables-R134a-*")] == [".npz"]
    assert list(named.glob("compiled-*/**/*.nbi"))
    assert not usual.exists()
    assert not (tmp_path / "home").exists()
    assert sorted(root.glob("ac_*/**/__pycache__/*.nb[ci]")) == beside_the_sources


def test_a_folder_that_cannot_be_written_costs_only_time(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("ACFTC_CACHE_DIR", str(tmp_path / "file" / "below"))
    assert cached("test", {}, lambda: {"number": np.array(3)})["number"] == 3
