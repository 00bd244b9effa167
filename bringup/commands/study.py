"""`acftc study`: many drawn runs, and what they amount to."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ac_common.errors import RunError, UserError
from bringup.commands.console import print_json, print_table, progress_bar, say
from bringup.commands.extras import need
from bringup.commands.options import examples, force_option, json_option, path_option
from bringup.commands.outcome import finish, make_folder, prepare_folder

if TYPE_CHECKING:
    from ac_experiments.bags.reader import RawBag
    from ac_experiments.study.cases import Case
    from ac_experiments.study.results import Store

_ALONE = ("-h", "--help", "--list")


class StudyGroup(click.Group):
    """A group whose first word may also be the study itself: `acftc study small_faults` runs it."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Put `run` before what begins with no command of the group."""
        if args and args[0] not in self.commands and args[0] not in _ALONE:
            args = ["run", *args]
        return super().parse_args(ctx, args)


workers_option = click.option(
    "--workers",
    metavar="N",
    type=click.IntRange(1, 4096),
    help="Worker processes on this machine. Default: one a core.",
)
scheduler_option = click.option(
    "--scheduler", metavar="ADDRESS", help="A Dask scheduler to use, tcp://HOST:PORT. Default: workers of this machine."
)


study_set_option = click.option(
    "--set",
    "overrides",
    metavar="KEY=VALUE",
    multiple=True,
    help="Set what is the same in all runs, for instance design=paper. May be given again.",
)


@click.group(
    cls=StudyGroup,
    invoke_without_command=True,
    epilog=examples(
        "acftc study --list # the built-in studies",
        "acftc study small_faults --out results/small # results/small/study.html shows what came of it",
        "acftc study small_faults --out results/small --resume # after Ctrl-C, a full disk, a crash",
        "acftc study my_study.yaml --out s3://bucket/mine --scheduler tcp://head:8786",
        "acftc study rerun results/small 123 # with report; --graph: through the nodes",
        "acftc study compare results/before results/after",
        "acftc study worst small_faults --metric near_false_alarm --out results/worst",
    ),
    short_help="Run thousands of drawn scenarios, with statistics.",
)
@click.option("--list", "show_list", is_flag=True, help="List the built-in studies.")
@click.pass_context
def study(context: click.Context, show_list: bool) -> None:
    """Run a study: scenarios drawn from distributions, on all cores or a cluster, and what they amount to.

    `acftc study STUDY --out DIR` is short for `acftc study run STUDY --out DIR`. What a study file holds:
    docs/studies.md.
    """
    need("study", dask="dask", distributed="distributed", fsspec="fsspec", pyarrow="pyarrow", SALib="SALib")
    if show_list:
        _print_list()
    elif context.invoked_subcommand is None:
        click.echo(context.get_help())


def _print_list() -> None:
    from ac_experiments.study.schema import built_in_studies, load_study

    rows = []
    for name in built_in_studies():
        known = load_study(name)
        rows.append([name, str(known.runs), known.description])
    print_table(["study", "runs", "what is asked"], rows)


@study.command(
    epilog=examples(
        "acftc study run small_faults --out results/small",
        "acftc study run my_study.yaml --runs 20 --out results/try --workers 2",
        "acftc study run envelope_faults --set sensors=3 --out results/three_sensors",
    )
)
@click.argument("study_file", metavar="STUDY")
@click.option("--out", metavar="DIR", help="Folder, or what fsspec takes (s3://...). Default: results/STUDY.")
@click.option("--runs", type=click.IntRange(1, 10_000_000), help="Play so many runs instead of the file's.")
@click.option("--seed", type=click.IntRange(0, 2**30), help="Draw from this seed instead of the file's.")
@study_set_option
@click.option("--resume", is_flag=True, help="Go on with what is in DIR: runs that are there are not played again.")
@workers_option
@scheduler_option
@json_option
def run(
    study_file: str,
    out: str | None,
    runs: int | None,
    seed: int | None,
    overrides: tuple[str, ...],
    resume: bool,
    workers: int | None,
    scheduler: str | None,
    as_json: bool,
) -> None:
    """Play all runs of STUDY, a built-in name or a YAML file.

    DIR gets runs.parquet (a row for each run), study.json and study.html. A study that was stopped, by whatever, is
    gone on with by --resume: nothing is played twice, and the results are the same to the byte.
    """
    from ac_experiments.study.cases import Cases
    from ac_experiments.study.schema import load_study

    given = {"runs": runs, "seed": seed}
    chosen = load_study(study_file, {key: value for key, value in given.items() if value is not None}, overrides)
    Cases(chosen).look()
    store = _store(out or f"results/{chosen.name}")

    from ac_experiments.study.engine import run_study
    from ac_experiments.study.finish import PAGE, SUMMARY
    from ac_experiments.study.finish import finish as write_results

    with progress_bar(f"{chosen.name}, {chosen.runs} runs") as progress:
        timing = run_study(chosen, store, scheduler, workers, resume, progress)
    summary = write_results(store)
    if as_json:
        print_json(summary)
    else:
        _print_summary(summary)
    if timing.runs:
        busy = timing.busy_s / max(timing.wall_s * timing.workers, 1e-9)
        say(
            f"{timing.runs} runs in {timing.wall_s:.1f} s on {timing.workers} workers, {100.0 * busy:.0f} % of their "
            f"time in runs; this process took {timing.client_cpu_s:.1f} s"
        )
    say(f"wrote {store.url}/{SUMMARY} and {store.url}/{PAGE}")


def _store(url: str) -> "Store":
    """Return the store of the results; a folder of this machine by its whole path, and made when missing."""
    from ac_experiments.study.results import Store

    store = Store(url if "://" in url else str(Path(url).absolute()))
    if store.is_here:
        make_folder(store.folder)
    return store


def _existing(url: str) -> "Store":
    from ac_experiments.study.results import Store

    return Store(url if "://" in url else str(Path(url).absolute()))


def _print_summary(summary: dict[str, Any]) -> None:
    from ac_experiments.study.outcomes import OUTCOMES
    from ac_experiments.study.page import interval_text, name_of

    rows = []
    for kind, found in summary["outcomes"].items():
        late = summary["delays"].get(kind, {}).get("isolation")
        named = "" if late is None else interval_text(late["median_s"], ".1f")
        found_90 = summary["pod"].get(kind, {}).get("detected", {}).get("a90_95")
        size = "" if found_90 is None else f"{found_90:.3g}" if isinstance(found_90, float) else "–"
        rows.append([name_of(kind), str(found["runs"]), *(str(found[name]) for name in OUTCOMES), named, size])
    print_table([summary["study"], "runs", *OUTCOMES, "named after, s (median, 95 %)", "a90/95"], rows)
    alarms = summary["false_alarms"]
    rate = interval_text(alarms["per_hour"], ".3g")
    print_table(
        ["false alarms", "fault-free h", "per hour (95 %)"], [[str(alarms["count"]), f"{alarms['hours']:.2f}", rate]]
    )


@study.command(
    epilog=examples(
        "acftc study rerun results/small 123 --out results/run_123", "acftc study rerun results/small 123 --graph"
    )
)
@click.argument("folder", metavar="DIR")
@click.argument("number", metavar="RUN", type=click.IntRange(0))
@path_option("--out", metavar="DIR", help="Folder for the results. Default: results/STUDY-RUN.")
@click.option("--graph", is_flag=True, help="Through the nodes, recorded, instead of in one process.")
@click.option("--passive", is_flag=True, help="K0 alone, as it ran beside.")
@force_option
@json_option
def rerun(folder: str, number: int, out: Path | None, graph: bool, passive: bool, force: bool, as_json: bool) -> None:
    """Play run RUN of the study in DIR again, with full report, and see that it comes to the same.

    The folder of the results gets scenario.yaml, and plant.yaml where the study varies the plant.
    """
    from ac_common.yaml_file import parsed
    from ac_experiments.bags.reader import recording_of
    from ac_experiments.study.cases import Cases
    from ac_experiments.study.results import STUDY
    from ac_experiments.study.runs import designs_for, figures, hold_s, made_with, play
    from ac_experiments.study.schema import check_study

    store = _existing(folder)
    known = check_study(parsed(store.read(STUDY).decode(), STUDY))
    if number >= known.runs:
        raise UserError(f"{folder}: has runs 0 to {known.runs - 1}, not {number}")
    case = Cases(known)[number]
    where = prepare_folder(out or Path("results") / case.scenario.name, force)
    plant = _write_case(case, where)
    if graph:
        raw = _through_the_graph(case, where, plant, passive)
        recording = recording_of(raw, where / "bag")
    else:
        with progress_bar(case.scenario.name):
            raw, recording = None, play(case, passive or None)
    finish(recording, where, as_json, raw)
    if not passive:
        row = figures(recording, hold_s(designs_for(case.scenario).fdi))
        _compare_with_row(store, number, row, made_with())


def _write_case(case: "Case", folder: Path) -> Path | None:
    """Write the scenario of a case, and its plant where that is another one; return the file of the plant."""
    from ac_common.files import write_whole
    from ac_experiments.scenario import to_yaml
    from ac_plant_node.parameters.file import parameter_text

    write_whole(folder / "scenario.yaml", to_yaml(case.scenario))
    if case.parameters is None:
        return None
    write_whole(folder / "plant.yaml", parameter_text(case.parameters))
    return (folder / "plant.yaml").absolute()


def _through_the_graph(case: "Case", folder: Path, plant: Path | None, passive: bool) -> "RawBag":
    """Run a case as a graph of nodes: the plant's own parameters reach the plant and the scenario, not the designs."""
    import sys

    from ac_common.topics import PLANT, SCENARIO
    from ac_experiments.bags.reader import read_raw
    from ac_plant_node.parameters.file import PLANT_VARIABLE
    from ac_ros_common.installation import check_environment
    from bringup.launch.launch import run_graph
    from bringup.launch.process_table import PROCESSES
    from bringup.launch.user_nodes import UserNodes

    check_environment()
    user = None
    if plant is not None:
        start = ["env", f"{PLANT_VARIABLE}={plant}", sys.executable, "-m"]
        user = UserNodes({node: [*start, PROCESSES[node].module] for node in (PLANT, SCENARIO)})
    with progress_bar(f"{case.scenario.name} (lockstep)") as progress:
        try:
            run_graph(case.scenario, folder, passive=passive or None, progress=progress, user=user, say=say)
        except UserError as problem:
            raise RunError(str(problem)) from problem
    return read_raw(folder / "bag")


def _compare_with_row(store: "Store", number: int, row: dict[str, Any], code: str) -> None:
    """Tell whether a run came to what the study has in its row."""
    from ac_experiments.study.finish import read_runs
    from ac_experiments.study.results import MADE_WITH, RUNS

    if not store.has(RUNS):
        return
    runs = read_runs(store)
    (place,) = (runs["run"] == number).nonzero()[0].tolist() or [None]
    if place is None:
        return
    other = [name for name, value in row.items() if not _same(runs[name][place], value)]
    if not other:
        say(f"the same as run {number} of the study, to the last bit")
        return
    same_code = store.read(MADE_WITH).decode().strip() == code
    why = "" if same_code else "; the study was made with another version of the program or another plant"
    say(f"other than run {number} of the study: {', '.join(other)}{why}")


def _same(before: Any, now: Any) -> bool:
    if now is None or now != now:
        return before is None or before != before
    return bool(before == now)


@study.command(epilog=examples("acftc study compare results/before results/after"))
@click.argument("first", metavar="A")
@click.argument("second", metavar="B")
@json_option
def compare(first: str, second: str, as_json: bool) -> None:
    """Tell what differs between two studies, B minus A, with 95 % intervals.

    Runs are compared pairwise where seed, number and all that was drawn agree.
    """
    from dataclasses import asdict

    from ac_experiments.study.compare import compare as differences_of
    from ac_experiments.study.finish import read_runs
    from ac_experiments.study.summary import clean

    rows = differences_of(read_runs(_existing(first)), read_runs(_existing(second)))
    if as_json:
        print_json(clean([asdict(row) | {"difference": row.difference} for row in rows]))
        return
    table = []
    for row in rows:
        low, high = row.difference.low, row.difference.high
        sure = "differs" if low > 0.0 or high < 0.0 else ""
        numbers = [f"{value:.4g}" for value in (row.first, row.second, row.difference.value)]
        how = f"{row.paired} pairs" if row.paired else "independent"
        ratio = "" if row.ratio is None else f"{row.ratio[0]:.3g}, {row.ratio[1]:.3g}"
        table.append([row.what, *numbers, f"{low:.3g} to {high:.3g}", how, sure, ratio])
    print_table(["", "A", "B", "B - A", "95 % interval", "", "", "B/A: mean, largest"], table)


@study.command(
    epilog=examples(
        "acftc study worst small_faults --metric near_false_alarm --out results/worst",
        "acftc study worst my_study.yaml --metric least_superheat_k --least --runs 500",
    )
)
@click.argument("study_file", metavar="STUDY")
@click.option("--metric", required=True, help="near_false_alarm, harm, or a column of runs.parquet.")
@click.option("--least", is_flag=True, help="The smallest value instead of the largest.")
@click.option("--runs", type=click.IntRange(20, 10_000_000), default=200, show_default=True, help="About so many runs.")
@path_option("--out", metavar="DIR", help="Folder for scenario and report. Default: results/STUDY-worst.")
@workers_option
@scheduler_option
@force_option
@json_option
def worst(
    study_file: str,
    metric: str,
    least: bool,
    runs: int,
    out: Path | None,
    workers: int | None,
    scheduler: str | None,
    force: bool,
    as_json: bool,
) -> None:
    """Search within the bounds of STUDY for the drive that is worst by a metric, and keep it as a scenario.

    DIR gets scenario.yaml, plant.yaml where the study varies the plant, and the run's summary and report. Metrics:
    near_false_alarm (1: an alarm), harm (IAE of the evaporator pressure over that of K0 alone), or any column of
    numbers of runs.parquet.
    """
    from ac_experiments.study.runs import play
    from ac_experiments.study.schema import load_study
    from ac_experiments.study.worst import check_metric, search

    chosen = load_study(study_file)
    check_metric(chosen, metric)
    folder = prepare_folder(out or Path("results") / f"{chosen.name}-worst", force)
    with progress_bar(f"{chosen.name}, {metric}") as progress:
        found = search(chosen, metric, runs, least, scheduler, workers, progress)
    _write_case(found.case, folder)
    say(f"{metric} {found.value:.6g} in {found.tried} runs; wrote {folder / 'scenario.yaml'}")
    finish(play(found.case), folder, as_json)
