"""docs/how-to/new-topic.md keeps its word: two files, and the topic is in the bag."""

from pathlib import Path

import pytest

from tests.docs.edits import ROOT, copy_of_the_code, edits_of, insert, run_in

PAGE = ROOT / "docs" / "how-to" / "new-topic.md"

PROGRAM = """
import numpy as np
from ac_common.topics import BY_NAME, SERIES
from ac_experiments.bags.reader import read_bag
from ac_experiments.scenario import check
from ac_experiments.simulate import simulate
from bringup.launch.launch import run_graph

noise = {"superheat_k": 0.1, "seed": 3}
scenario = check({"name": "new", "duration_s": 3, "noise": noise})
run = run_graph(scenario, "out")
series = read_bag(run.bag).series
off = series["measured/superheat"] - series["plant/superheat"]
assert np.isfinite(off).all() and off.std() > 0.01
np.testing.assert_array_equal(series["measured/superheat_error"], off)
assert "measured/superheat_error" in SERIES and BY_NAME["measured/superheat_error"].unit == "K"
assert "measured/superheat" in simulate(scenario).series
print("recorded")
"""


@pytest.mark.ros
def test_two_files_bring_a_topic_into_the_bag(tmp_path: Path) -> None:
    edits = edits_of(PAGE)
    assert len(edits) == 2
    folder = copy_of_the_code(tmp_path)
    for name, difference in edits.items():
        insert(folder / name, difference)
    assert run_in(folder, PROGRAM).strip().splitlines()[-1] == "recorded"
