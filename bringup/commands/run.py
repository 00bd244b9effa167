"""`acftc run`: every node as a process of its own, recorded."""

from pathlib import Path
from typing import Literal

import click

from ac_common import collector
from ac_common.errors import InterruptedRunError, RunError, UserError
from bringup.commands.console import progress_bar, say
from bringup.commands.dash import dash_option, page
from bringup.commands.options import NodeType, OneOf, examples, params_file_option, repeated, scenario_options
from bringup.commands.outcome import finish, load_scenario, prepare_folder
from bringup.launch.process_table import LOOP_NODES

#: A run of so many ticks takes longer than what is simulated beside it.
LONG = 2000


@click.command(
    epilog=examples(
        "acftc run actuator_fault --out results/e5 # results/e5/report.html tells what came of it",
        "acftc run sensor_fault --passive --set faults.0.size_kpa=3 --out results/weak",
        "acftc run drive:7 # a random drive over a moving load",
        "acftc run my_scenario.yaml --mode realtime # on the wall clock",
        "acftc run nominal --node ac_plant='python examples/own_plant.py'",
        "acftc run actuator_fault --mode realtime --dash",
    ),
    short_help="Run a scenario with all nodes: bag, summary, report.",
)
@scenario_options
@click.option(
    "--mode",
    type=OneOf(["lockstep", "realtime"]),
    default="lockstep",
    show_default=True,
    help="As fast as the machine allows and repeatable to the last bit, or on the wall clock.",
)
@click.option(
    "--node",
    "nodes",
    metavar="NAME=COMMAND",
    multiple=True,
    help="Start a node of your own in place of ours, for instance ac_plant='python my_plant.py'. May be given again.",
)
@click.option(
    "--without",
    metavar="NAME",
    type=NodeType(LOOP_NODES),
    multiple=True,
    help="You start this node; the run waits for it.",
)
@params_file_option
@click.option(
    "--realtime-care",
    "care",
    is_flag=True,
    help="On the wall clock: SCHED_FIFO, locked memory, processors kept awake, where the system permits it.",
)
@dash_option
@click.pass_context
def run(
    context: click.Context,
    scenario: str,
    out: Path | None,
    mode: Literal["lockstep", "realtime"],
    passive: bool,
    overrides: tuple[str, ...],
    force: bool,
    with_report: bool,
    nodes: tuple[str, ...],
    without: tuple[str, ...],
    params_file: Path | None,
    care: bool,
    with_page: bool,
    as_json: bool,
) -> None:
    """Run SCENARIO with every node as a process of its own, record it, and write summary and report.

    SCENARIO is a built-in name (acftc scenarios) or the path of a YAML file. DIR gets bag/ (a ROS 2 bag),
    summary.json, report.html, and the pictures of the report as .svg and .png. A report left away with --no-report
    can be had later: acftc report DIR/bag.
    """
    from bringup.launch.user_nodes import user_nodes

    if care and mode != "realtime":
        raise UserError("--realtime-care: only with --mode realtime; in lockstep nothing waits for the wall clock")
    chosen = load_scenario(scenario, overrides, passive)
    user = user_nodes(nodes, without, params_file)
    folder = prepare_folder(out or Path("results") / chosen.name, force)

    from ac_experiments.bags.reader import read_raw, recording_of
    from ac_experiments.designs import check_controller_of
    from bringup.launch.beside import PASSIVE, Beside
    from bringup.launch.given_parameters import check_designs
    from bringup.launch.launch import run_graph

    check_controller_of(chosen)
    check_designs(params_file, chosen)
    command = repeated(context)
    with Beside(PASSIVE) as passive_run:
        # Not beside a short run, which ends first, nor on the wall clock, where the processors are the loop's alone.
        is_long = mode == "lockstep" and chosen.ticks >= LONG
        wanted = with_report and is_long and bool(chosen.faults) and not chosen.is_passive()
        with page(with_page) as beside, progress_bar(f"{chosen.name} ({mode})") as progress:

            def told(done: int, of: int) -> None:
                if wanted:
                    passive_run.start(chosen)  # once the loop runs
                if progress is not None:
                    progress(done, of)

            try:
                run_graph(
                    chosen,
                    folder,
                    mode=mode,
                    progress=told,
                    user=user,
                    say=say,
                    beside=beside,
                    care=care,
                    command=command,
                )
            except UserError as problem:
                # The input has been checked by now: what fails here is the run.
                kind = InterruptedRunError if isinstance(problem.__context__, KeyboardInterrupt) else RunError
                raise kind(str(problem)) from problem
        with collector.paused():
            raw = read_raw(folder / "bag")
            finish(recording_of(raw, folder / "bag"), folder, as_json, raw, with_report, passive_run.result)
