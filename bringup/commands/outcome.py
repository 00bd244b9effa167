"""What `run` and `simulate` share: the folder of the results, and what is written and said at the end."""

import re
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ac_common.errors import UserError, one_line
from ac_common.health import AS_USUAL
from bringup.commands.console import print_json, print_table, progress_bar, say

if TYPE_CHECKING:
    from ac_experiments.bags.reader import RawBag
    from ac_experiments.recording import Recording
    from ac_experiments.scenario_schema import Scenario

#: Of false alarms and of events the table shows so many each.
MOST_ROWS = 8
#: The page, and the pictures that `ac_experiments.report.page` writes beside it.
_OF_REPORT = re.compile(r"report(\.html|(_fault_\d+|_nodes)?\.(svg|png))")


def load_scenario(scenario: str, overrides: tuple[str, ...], passive: bool) -> "Scenario":
    """Load a scenario with what the command line changes in it."""
    from ac_experiments.scenario import load

    chosen = load(scenario, (*overrides, "passive=true") if passive else overrides)
    length_s = chosen.ticks * chosen.sample_time_s
    if abs(length_s - chosen.duration_s) > 1e-6 * chosen.sample_time_s:
        say(
            f"note: {chosen.duration_s:g} s are no whole number of ticks of {chosen.sample_time_s:g} s; "
            f"{chosen.ticks} ticks are run, {length_s:g} s"
        )
    return chosen


def prepare_folder(folder: Path, force: bool) -> Path:
    """Make the folder of the results; refuse to lose a recording that is there."""
    make_folder(folder)
    bag = folder / "bag"
    if not any(bag.glob("*.mcap")):
        return folder
    if not force:
        msg = f"{bag}: holds the recording of an earlier run; choose another --out, or --force to overwrite it"
        raise UserError(msg)
    strange = [item.name for item in bag.iterdir() if item.suffix not in (".mcap", ".yaml")]
    if strange:
        msg = f"{bag}: holds {strange[0]!r}, which is not part of a recording; move it away first"
        raise UserError(msg)
    for item in bag.iterdir():
        item.unlink()
    bag.rmdir()
    return folder


def make_folder(folder: Path) -> None:
    """Make a folder, or say in one line why nothing can be written there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as problem:
        msg = f"{folder}: cannot be written to: {one_line(problem.strerror)}"
        raise UserError(msg) from None


def beside_bag(bag: Path, name: str) -> Path:
    """Return where a file about a recorded run goes by default: beside its bag, into the folder of the run."""
    folder = bag.resolve()
    return (folder if (folder / "bag").is_dir() else folder.parent) / name


def _nothing() -> None:
    return None


def finish(
    recording: "Recording",
    folder: Path,
    as_json: bool,
    raw: "RawBag | None" = None,
    with_report: bool = True,
    passive: "Callable[[], Recording | None]" = _nothing,
) -> None:
    """Write summary and report of a run, and say where they are.

    `raw` is its bag, with the nodes' health reports; `passive` gives the passive run of the same scenario if there is
    one already.
    """
    from ac_experiments.metrics import summarise, write_summary

    summary = summarise(recording)
    written = [folder / "summary.json"]
    write_summary(summary, written[0])
    with _earlier_report_removed(folder):
        if with_report:
            written.append(folder / "report.html")
            write_page(written[-1], recording, raw, *companion(recording, passive))
    if as_json:
        print_json(summary)
    else:
        _print_summary(summary)
        say(f"wrote {' and '.join(map(str, written))}")


@contextmanager
def _earlier_report_removed(folder: Path) -> Iterator[None]:
    """Remove what is left of an earlier run's report afterwards: what lies beside a summary must tell of the same run.

    Not before: a report that cannot be written leaves what was there as it was.
    """
    earlier = {item: item.stat().st_ino for item in folder.iterdir() if _is_of_report(item)}
    yield
    for item, number in earlier.items():
        if item.stat().st_ino == number:  # a file that was written anew is another one
            item.unlink()


def _is_of_report(item: Path) -> bool:
    return item.is_file() and _OF_REPORT.fullmatch(item.name) is not None


def write_page(path: Path, recording: "Recording", raw: "RawBag | None", beside: "Recording | None", note: str) -> None:
    """Write the report of a run, with what the nodes said of themselves where there is a bag."""
    from ac_experiments.bags.reader import RawBag
    from ac_experiments.report.nodes import first_tick_s, reports_of
    from ac_experiments.report.page import write_report

    is_one_process = recording.metadata["mode"] == "simulate"  # no nodes, so no health of theirs
    told = RawBag() if raw is None or is_one_process else raw
    write_report(path, recording, beside, note, reports_of(told), first_tick_s(told))


def companion(
    recording: "Recording", made: "Callable[[], Recording | None]" = _nothing
) -> "tuple[Recording | None, str]":
    """Give the passive run to show beside an active one with faults, and the sentence that says where it is from.

    `made` gives one that may be it.
    """
    from ac_experiments.scenario import check
    from ac_experiments.simulate import simulate as simulate_loop
    from ac_experiments.versions import same_plant

    if recording.metadata["passive"] or not recording.metadata["scenario"].get("faults"):
        return None, ""
    if not same_plant(recording.metadata.get("software", {})):
        return None, "No passive run beside it: it was recorded with another plant, which `acftc --plant FILE` names."
    scenario = check(recording.metadata["scenario"], "scenario of the recording")
    try:
        with progress_bar("the passive run beside it") as progress:
            passive = made()
            if passive is None or passive.metadata["scenario"] != recording.metadata["scenario"]:
                passive = simulate_loop(scenario, passive=True, progress=progress)
    except UserError as problem:
        return None, f"The passive run beside it could not be simulated: {problem}."
    if not _same_programme(recording, passive):
        return None, "No passive run beside it: faults or references were changed while this one ran."
    return passive, "The passive run beside it was simulated in one process from the same scenario."


def _same_programme(recording: "Recording", other: "Recording") -> bool:
    """Whether faults and references of a recording are those of the other run, as far as they were recorded."""
    import numpy as np

    from ac_common.faults import FAULTS
    from ac_common.signals import Reference, topics_of
    from ac_common.topics import BY_NAME

    faults, references = tuple(fault.truth_topic for fault in FAULTS), topics_of("reference", Reference)
    for key in (key for name in faults + references for key in BY_NAME[name].series):
        values = recording.series[key]
        planned = other.series[key][: len(values)]
        known = np.isfinite(values)
        if not np.allclose(values[known], planned[known[: len(planned)]], rtol=1e-9, atol=1e-9):
            return False
    return True


def _print_summary(summary: dict[str, Any]) -> None:
    from ac_experiments.decisions import told_sure

    rows = [
        ["ticks", f"{summary['ticks']} at {summary['sample_time_s']:g} s, {summary['missed_ticks']} missed"],
        ["speed", _speed(summary)],
    ]
    for fault in summary["faults"]:
        named = "not isolated"
        if fault["isolated_as"] is not None:
            after = fault["isolated_s"] - fault["onset_s"]
            named = f"isolated as {fault['isolated_as']} after {after:.1f} s"
            named += told_sure(fault, fault["isolated_s"], fault["onset_s"], ", sure after {:.1f} s")
        rows.append([f"{fault['size']:g} {fault['unit']} at {fault['onset_s']:g} s", named])
    rows.append(["false alarms", str(summary["false_alarms"])])
    rows += _few([[f"false alarm at {a['time_s']:.1f} s", _alarm(a)] for a in summary["false_alarm_list"]])
    events = [event for event in summary["events"] if event["what"] != AS_USUAL]
    rows += _few([[f"{e['node']} at {e['time_s']:.1f} s", f"{e['what']}{_lasting(e)}"] for e in events])
    units = {"rpm": "rpm", "kpa": "kPa", "k": "K"}
    for key, value in summary["metrics"].items():
        name, _, unit = key.rpartition("_")
        rows.append([name.replace("_", " "), "–" if value is None else f"{value:.3f} {units[unit]}"])
    kind = "passive" if summary["passive"] else "active"
    print_table([summary["scenario"], f"{summary['mode']}, {kind}"], rows)


def _few(rows: list[list[str]]) -> list[list[str]]:
    """Return the first few rows, and how many more there are."""
    more = len(rows) - MOST_ROWS
    return [*rows[:MOST_ROWS], ["", f"and {more} more, see summary.json"]] if more > 0 else rows


def _alarm(alarm: dict[str, Any]) -> str:
    from ac_common.faults import called
    from ac_experiments.decisions import told_sure

    return f"{'detected only' if alarm['kind'] is None else called(alarm['kind'])}{_lasting(alarm)}{told_sure(alarm)}"


def _lasting(spell: dict[str, Any]) -> str:
    return ", to the end" if spell["length_s"] is None else f", for {spell['length_s']:.1f} s"


def _speed(summary: dict[str, Any]) -> str:
    factor = summary["real_time_factor"]
    return "–" if factor is None else f"{factor:.1f} times real time ({summary['wall_seconds']:.2f} s)"
