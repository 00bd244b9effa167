"""docs/how-to/new-fault.md keeps its word: one entry makes a fault, and no other source file knows it."""

import re
import subprocess
from pathlib import Path

from ac_common.faults import BY_KIND
from tests.docs.edits import PACKAGES, ROOT, copy_of_the_code, edits_of, run_in

PAGE = ROOT / "docs" / "how-to" / "new-fault.md"
MOST_FILES = 8

#: A fault that nobody has thought of: the bias of another sensor, as one entry.
ENTRY = """
    Fault(
        kind="wall_bias", symbol="f_wb", place=Place.SENSOR, signal="wall_temperature", unit="K", si=1.0, si_unit="K",
        size_key="size_k", largest=15.0, typical=2.0, name="wall thermocouple", subject="the wall thermocouple",
        verb="read", more="too high", less="too low", adds="added to the measured wall temperature", has_filter=False,
    ),
)

#: Names of all faults"""

PROGRAM = """
from ac_experiments.report.page import render
from ac_experiments.report.panels import panels_of
from ac_experiments.metrics import summarise
from ac_experiments.scenario import check
from ac_experiments.simulate import simulate
from ac_common.topics import BY_NAME
from bringup.dash.plots import TIME_PLOTS
from bringup.dash.rows import NAMES
from fault_injector_node.node import PARAMETERS

fault = {"kind": "wall_bias", "size_k": 2.5, "onset_s": 2.0, "profile": "ramp", "rise_s": 1.0}
run = simulate(check({"name": "new", "duration_s": 6, "faults": [fault]}))
(found,) = summarise(run)["faults"]
assert (found["kind"], found["size"], found["unit"]) == ("wall_bias", 2.5, "K"), found
off = run.series["measured/wall_temperature"] - run.series["plant/wall_temperature"]
assert abs(off[-1] - 2.5) < 1e-9, off
assert (run.series["fault/wall_bias"] == run.series["scenario/faults:wall_bias"]).all()
page = render(run)
assert "the wall thermocouple begins to read 2.5 K too high" in page
assert "f<sub>wb</sub> wall thermocouple" in page
assert "Fault of the wall thermocouple" in [panel.title for panel in panels_of(run, both=False)]
assert "f_wb" in NAMES and "f_wb" in [line.name for plot in TIME_PLOTS for line in plot.lines]
assert {"wall_bias.size_k", "wall_bias.profile"} <= {parameter.name for parameter in PARAMETERS}
assert "fdi/residual/wall_bias" not in BY_NAME
print("all there")
"""


def listed_files() -> list[str]:
    """Source files in the page's list of what there is to do."""
    section = PAGE.read_text().split("## What else there is to do")[1].split("\n## ")[0]
    return re.findall(r"^\| `([^`]+)` \|", section, re.MULTILINE)


def test_the_page_names_all_source_files_that_know_the_example() -> None:
    files = listed_files()
    assert 1 <= len(files) <= MOST_FILES
    command = ["git", "ls-files", *(f"{package}/" for package in PACKAGES)]
    sources = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    # Not the key of a scenario that says how the superheat is measured, which has the same name.
    words = re.compile(r'kind="superheat_sensor"|f_SH\b|fault/superheat_sensor|superheat_sensor\.[a-z]+_?[a-z]*:')
    knows = [name for name in sources if words.search((ROOT / name).read_text(errors="ignore"))]
    assert sorted(knows) == sorted(files)


def test_the_page_shows_the_entry_as_it_is() -> None:
    (difference,) = edits_of(PAGE).values()
    entry = "".join(f"{line[1:]}\n" for line in difference.splitlines() if line.startswith("+"))
    assert entry in (ROOT / "ac_common" / "faults.py").read_text()
    assert BY_KIND["superheat_sensor"].symbol == "f_SH"


def test_one_entry_brings_a_fault_into_scenario_run_report_and_live_page(tmp_path: Path) -> None:
    folder = copy_of_the_code(tmp_path)
    registry = folder / "ac_common" / "faults.py"
    before = registry.read_text()
    registry.write_text(before.replace(")\n\n#: Names of all faults", ENTRY.lstrip("\n"), 1))
    assert registry.read_text() != before
    assert run_in(folder, PROGRAM).strip() == "all there"
