"""`acftc`: the command line. What it says on failure is one line on stderr; its exit code is 0 only on success.

Exit codes: 2 bad input, 1 a run that failed or a comparison that differs, 130 interrupted. Heavy modules are imported
by the command that needs them, so that help comes at once.
"""

import contextlib
import difflib
import os
import signal
import sys
import tempfile
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click
from click.shell_completion import CompletionItem, get_completion_class

from bringup.console import digits, print_json, print_table, progress_bar, say, without_nan
from bringup.errors import BringupError, InterruptedRunError, RunError, one_line

if TYPE_CHECKING:
    from bringup.recording import Recording
    from bringup.ros.health import NodeHealth
    from bringup.scenario import Scenario

INTERRUPTED = 130
FAILED = 1
BAD_INPUT = 2

#: Errors of these packages carry a message meant for the user.
OWN_PACKAGES = ("ac_plant_node", "bringup", "fault_injector_node", "fdi_node", "gimc", "gimc_controller_node")


class _Group(click.Group):
    """A group that lists its commands in the order of use and suggests the nearest to a misspelt one."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        return list(self.commands)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        name = args[0]
        if name not in self.commands and not name.startswith("-"):
            near = difflib.get_close_matches(name, self.commands, n=1)
            hint = f", did you mean {near[0]!r}?" if near else ";"
            msg = f"unknown command {name!r}{hint} allowed: {', '.join(self.commands)}"
            raise click.UsageError(msg, ctx)
        return super().resolve_command(ctx, args)


def _examples(*lines: str) -> str:
    """Give the end of a help text: examples, which click must not fill into a paragraph."""
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in lines)


@click.group(
    epilog=_examples(
        "acftc scenarios                                what can be run",
        "acftc run actuator_fault --out results/e5      all nodes, a bag, a summary and a report",
        "acftc simulate sensor_fault --out results/e6   the same loop in one process, without ROS",
    ),
    cls=_Group,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
@click.version_option(package_name="acftc", prog_name="acftc")
def cli() -> None:
    """Fault-tolerant control of a vapour-compression air conditioner on ROS 2."""


# ------------------------------------------------------------------------------------------- shared options


class _ScenarioType(click.Path):
    """A scenario: the shell completes built-in names, then files."""

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        from bringup.scenario import built_in_scenarios

        names = [CompletionItem(name) for name in built_in_scenarios() if name.startswith(incomplete)]
        return names or super().shell_complete(ctx, param, incomplete)


_scenario_argument = click.argument("scenario", metavar="SCENARIO", type=_ScenarioType())
_passive_option = click.option("--passive", is_flag=True, help="K0 alone: the compensator stays silent.")
_set_option = click.option(
    "--set",
    "overrides",
    metavar="KEY=VALUE",
    multiple=True,
    help="Change one value of the scenario, for instance faults.0.size_rpm=60. May be given again.",
)
_out_option = click.option(
    "--out",
    metavar="DIR",
    type=click.Path(path_type=Path),
    help="Folder for the results; made when missing. Default: results/SCENARIO.",
)
_force_option = click.option("--force", is_flag=True, help="Overwrite the recording of an earlier run in DIR.")
_json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of a table.")


@cli.command(
    epilog=_examples(
        "acftc run actuator_fault --out results/e5",
        "acftc run sensor_fault --passive --set faults.0.size_kpa=3 --out results/weak",
        "acftc run my_scenario.yaml --mode realtime",
    ),
    short_help="Run a scenario with all nodes: bag, summary, report.",
)
@_scenario_argument
@_out_option
@click.option(
    "--mode",
    type=click.Choice(["lockstep", "realtime"]),
    default="lockstep",
    show_default=True,
    help="As fast as the machine allows and repeatable to the last bit, or on the wall clock.",
)
@_passive_option
@_set_option
@_force_option
@_json_option
def run(
    scenario: str,
    out: Path | None,
    mode: Literal["lockstep", "realtime"],
    passive: bool,
    overrides: tuple[str, ...],
    force: bool,
    as_json: bool,
) -> None:
    """Run SCENARIO with every node as a process of its own, record it, and write summary and report.

    SCENARIO is a built-in name (acftc scenarios) or the path of a YAML file. DIR gets bag/ (a ROS 2 bag),
    summary.json, report.html and report.svg.
    """
    chosen = _load(scenario, overrides, passive)
    folder = _prepare(out or Path("results") / chosen.name, force)

    from bringup.bags.reader import read_bag
    from bringup.ros.graph import run_graph

    with progress_bar(f"{chosen.name} ({mode})") as progress:
        try:
            run_graph(chosen, folder, mode=mode, progress=progress)
        except BringupError as problem:
            # The input has been checked by now: what fails here is the run.
            kind = InterruptedRunError if isinstance(problem.__context__, KeyboardInterrupt) else RunError
            raise kind(str(problem)) from problem
    _finish(read_bag(folder / "bag"), folder, as_json, _health(folder / "bag"))


@cli.command(
    epilog=_examples(
        "acftc simulate sensor_fault --out results/e6",
        "acftc simulate actuator_fault --set operating_point=high --json",
    ),
    short_help="Run a scenario in one process, without ROS.",
)
@_scenario_argument
@_out_option
@_passive_option
@_set_option
@_force_option
@_json_option
def simulate(
    scenario: str, out: Path | None, passive: bool, overrides: tuple[str, ...], force: bool, as_json: bool
) -> None:
    """Run SCENARIO in one process without ROS: the same step functions, the same summary and report."""
    from bringup.loop import simulate as simulate_loop

    chosen = _load(scenario, overrides, passive)
    folder = _prepare(out or Path("results") / f"{chosen.name}_simulated", force)
    with progress_bar(f"{chosen.name} (simulation)") as progress:
        recording = simulate_loop(chosen, progress=progress)
    _finish(recording, folder, as_json)


@cli.command(epilog=_examples("acftc scenarios"))
@_json_option
def scenarios(as_json: bool) -> None:
    """List the built-in scenarios."""
    from bringup.scenario import built_in_scenarios, load

    known = {name: load(name) for name in built_in_scenarios()}
    if as_json:
        print_json({name: item.model_dump(mode="json") for name, item in known.items()})
        return
    rows = [[name, f"{item.duration_s:g} s", item.description] for name, item in known.items()]
    print_table(["scenario", "duration", "what happens"], rows)


@cli.command(
    epilog=_examples("acftc report results/e5/bag --out e5.html"), short_help="Write the report of a recorded run."
)
@click.argument("bag", type=click.Path(path_type=Path))
@click.option("--out", metavar="FILE", type=click.Path(path_type=Path), help="Default: report.html beside the bag.")
@click.option(
    "--beside",
    metavar="BAG",
    type=click.Path(path_type=Path),
    help="A passive (or active) run to draw beside this one. Default: a simulation of the same scenario.",
)
def report(bag: Path, out: Path | None, beside: Path | None) -> None:
    """Write the report of a recorded run, also of one that was cut short."""
    from bringup.bags.reader import read_bag
    from bringup.report.page import write_report

    recording = read_bag(bag)
    other, note = (read_bag(beside), f"Beside it: {beside}.") if beside else _companion(recording)
    target = out or bag.resolve().parent / "report.html"
    if target.suffix != ".html":
        msg = f"--out {target}: the report's name must end in .html; its picture gets the same name with .svg"
        raise BringupError(msg)
    _make_folder(target.resolve().parent)
    write_report(target, recording, other, note, _health(bag))
    say(f"wrote {target}")


@cli.command(
    epilog=_examples("acftc replay results/e5/bag --node fdi"), short_help="Feed a bag through one node again."
)
@click.argument("bag", type=click.Path(path_type=Path))
@click.option("--node", required=True, metavar="NAME", help="fdi, compensator, gimc_controller, ac_plant, ...")
@_json_option
def replay(bag: Path, node: str, as_json: bool) -> None:
    """Feed a bag's inputs through the real node again, over DDS, and compare its answers with the recorded ones.

    Exit code 1 when they differ by more than the rounding of another processor.
    """
    from bringup.bags.replay import replay as replay_node

    with progress_bar(f"replay of {node}") as progress:
        result = replay_node(bag, node, progress)
    if as_json:
        print_json(
            {
                "node": result.node,
                "ticks": result.ticks,
                "compared": result.compared,
                "identical": result.identical,
                "different": result.different,
                "largest_relative_difference": result.largest_relative_difference,
                "same": result.same,
            }
        )
    else:
        click.echo(
            f"{result.node}: {result.ticks} ticks, {result.compared} messages compared, {result.identical} of them "
            f"identical; largest relative difference {result.largest_relative_difference:.3g}"
        )
    if not result.same:
        for line in result.differences:
            say(one_line(line))
        msg = f"{node}: {result.different} of {result.compared} messages differ from the recorded ones"
        raise RunError(msg)


@cli.command(epilog=_examples("acftc equilibria", "acftc equilibria --json"))
@_json_option
def equilibria(as_json: bool) -> None:
    """Show the three operating points that the solver finds, beside the paper's Table I."""
    from ac_plant_node import TABLE_I, operating_point
    from bringup.units import KPA, RPM

    points = [(row, operating_point(row.name)) for row in TABLE_I]
    content = {
        row.name: {
            "compressor_speed_rpm": float(point.inputs[0]) / RPM,
            "valve_opening_percent": 100.0 * float(point.inputs[1]),
            "air_mass_flow_kg_s": float(point.inputs[2]),
            "air_inlet_temperature_c": float(point.inputs[3]),
            "evaporator_pressure_kpa": float(point.outputs[0]) / KPA,
            "table_i_evaporator_pressure_kpa": row.evaporator_pressure_kpa,
            "superheat_k": float(point.outputs[1]),
            "table_i_superheat_k": row.superheat_k,
            "wall_temperature_c": float(point.outputs[2]),
            "condenser_pressure_kpa": float(point.outputs[3]) / KPA,
            "subcooling_k": float(point.subcooling_k),
            "mass_flow_kg_s": float(point.mass_flow_kg_s),
            "cooling_power_kw": float(point.cooling_power_w) / 1e3,
            "compressor_power_kw": float(point.compressor_power_w) / 1e3,
            "cop": float(point.cop),
        }
        for row, point in points
    }
    if as_json:
        print_json(content)
        return
    units = {"rpm": "rpm", "percent": "%", "kg_s": "kg/s", "c": "°C", "kpa": "kPa", "k": "K", "kw": "kW"}
    rows = []
    for key in next(iter(content.values())):
        unit = next((name for end, name in units.items() if key.endswith(f"_{end}")), "")
        name = key.replace("table_i_", "Table I: ").replace("_", " ")
        for end in units:
            name = name.removesuffix(f" {end.replace('_', ' ')}")
        rows.append([name, unit, *(f"{content[row.name][key]:.6g}" for row, _ in points)])
    print_table(["quantity", "unit", *content], rows)


@cli.command(epilog=_examples("acftc design --point med"))
@click.option("--point", type=click.Choice(["low", "med", "high"]), help="Only this operating point. Default: all.")
@_json_option
def design(point: str | None, as_json: bool) -> None:
    """Show every synthesis: claimed and achieved norm, bound, order, regularisation, stability, time.

    What has been designed before comes from the cache; a changed parameter designs anew.
    """
    from dataclasses import asdict

    from bringup.design import all_blocks

    points = [point] if point else ["low", "med", "high"]
    blocks = {name: [asdict(block) for block in all_blocks(name)] for name in points}
    if as_json:
        print_json(without_nan(blocks))
        return
    heads = [
        "point",
        "block",
        "claimed",
        "achieved",
        "reduced",
        "bound",
        "order",
        "slowest pole",
        "time",
        "regularisation",
    ]
    rows = [
        [
            name,
            block["block"],
            digits(block["claimed"]),
            digits(block["achieved"]),
            digits(block["achieved_reduced"]),
            digits(block["lower_bound"]),
            f"{block['order']} → {block['order_reduced']}",
            f"{digits(block['slowest_pole_rad_s'])} rad/s",
            f"{block['seconds']:.1f} s",
            block["regularisation"],
        ]
        for name in points
        for block in blocks[name]
    ]
    print_table(heads, rows)


@cli.command(
    epilog=_examples("acftc reproduce --out results/paper --cycle sc03.csv"),
    short_help="Run the paper's experiments E1-E8.",
)
@click.option("--out", metavar="DIR", type=click.Path(path_type=Path), default=Path("results/paper"), show_default=True)
@click.option(
    "--cycle",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Drive cycle for E8, CSV or EPA's two-column text; without it E8 is left out.",
)
def reproduce(out: Path, cycle: Path | None) -> None:
    """Run the paper's experiments E1-E8 in simulation and judge our numbers against the paper's.

    DIR gets a picture for each (e1.svg ... e8.svg), paper.json and index.html.
    """
    _make_folder(out)
    from bringup.report.reproduce import reproduce as run_experiments

    experiments = run_experiments(out, cycle, say)
    rows = []
    for experiment in experiments:
        rows.append([experiment.id, experiment.title, "", "", experiment.verdict])
        for item in experiment.findings:
            ours, paper = f"{digits(item.ours)} {item.unit}", digits(item.paper)
            rows.append(["", item.quantity, paper, ours, item.verdict])
    print_table(["", "experiment", "paper", "ours", "verdict"], rows)
    for experiment in experiments:
        if not experiment.findings:
            say(f"{experiment.id}: {experiment.remark}")
    say(f"wrote {out / 'paper.json'} and {out / 'index.html'}")


@cli.command(epilog=_examples("acftc calibrate", "acftc calibrate --json"))
@_json_option
def calibrate(as_json: bool) -> None:
    """Solve the maps of compressor and valve again from Table I, and show them beside the shipped ones."""
    from ac_plant_node import calibrate as solve
    from ac_plant_node import load_parameters

    shipped = load_parameters()
    solved, points = solve(shipped)
    names = (
        "eta_v_offset",
        "eta_v_pressure_ratio",
        "eta_v_speed",
        "valve_area_0_m2",
        "valve_area_1_m2",
        "valve_area_2_m2",
    )
    content = {name: {"solved": solved[name], "shipped": shipped[name]} for name in names}
    if as_json:
        print_json(content)
        return
    print_table(
        ["parameter", "solved", "shipped"],
        [[name, f"{values['solved']:.9g}", f"{values['shipped']:.9g}"] for name, values in content.items()],
    )
    print_table(
        ["operating point", "volumetric efficiency", "valve area"],
        [[point.row.name, f"{point.eta_v:.4f}", f"{1e6 * point.valve_area_m2:.4f} mm²"] for point in points],
    )


@cli.command(
    epilog=_examples("acftc topics", "acftc topics --json | jq '.[].name'"),
    short_help="What flows between the nodes of a running graph.",
)
@_json_option
def topics(as_json: bool) -> None:
    """Show the topics of the running loop: type, rate, last value, publishers and subscribers; Ctrl-C ends it.

    Looks into the ROS domain of ROS_DOMAIN_ID, 0 when it is not set: where `acftc run` puts a graph by default. With
    --json it watches for two seconds and prints what it has seen.
    """
    from bringup.ros.watch import table, topics_live, topics_once

    if as_json:
        print_json(topics_once())
        return
    from rich.live import Live

    with Live(auto_refresh=False) as live, contextlib.suppress(KeyboardInterrupt):
        for rows in topics_live():
            live.update(table(rows), refresh=True)


@cli.command(
    epilog=_examples("acftc bench", "acftc bench --realtime 10 --json"),
    short_help="Speed, start, latency, memory: measured, beside what they are to reach.",
)
@click.option("--realtime", "realtime_s", default=60.0, show_default=True, help="Length of the run at 100 Hz, s.")
@click.option("--ticks", default=1000, show_default=True, help="Ticks of each lockstep run.")
@_json_option
def bench(realtime_s: float, ticks: int, as_json: bool) -> None:
    """Measure the graph beside a bare chain of processes that moves the same messages and computes nothing.

    Takes some two minutes, and wants the machine for itself. Exit code 1 when a bar is missed.
    """
    from bringup.bench.figures import as_dicts
    from bringup.bench.figures import bench as measure

    figures = measure(ticks=ticks, realtime_s=realtime_s, say=say)
    if as_json:
        print_json(as_dicts(figures))
    else:
        rows = []
        for figure in figures:
            bar = "" if figure.bar is None else f"{'>=' if figure.at_least else '<='} {figure.bar:g}"
            beside = "" if figure.reference is None else f"{figure.reference:.4g}"
            verdict = {None: "", True: "ok", False: "missed"}[figure.passed]
            rows.append([figure.name, f"{figure.ours:.4g} {figure.unit}", beside, bar, verdict])
        print_table(["", "ours", "bare chain", "bar", ""], rows)
    missed = [figure.name.strip() for figure in figures if figure.passed is False]
    if missed:
        msg = f"missed: {', '.join(missed)}"
        raise RunError(msg)


@cli.command(epilog=_examples('eval "$(acftc completion bash)"', "acftc completion fish | source"))
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def completion(shell: str) -> None:
    """Print what makes SHELL complete commands, options and scenarios."""
    make = get_completion_class(shell)
    assert make is not None  # click knows these three
    click.echo(make(cli, {}, "acftc", "_ACFTC_COMPLETE").source())


# ---------------------------------------------------------------------------------------------- what they share


def _load(scenario: str, overrides: tuple[str, ...], passive: bool) -> "Scenario":
    from bringup.scenario import load

    return load(scenario, (*overrides, "passive=true") if passive else overrides)


def _prepare(folder: Path, force: bool) -> Path:
    """Make the folder of the results; refuse to lose a recording that is there."""
    _make_folder(folder)
    bag = folder / "bag"
    if not any(bag.glob("*.mcap")):
        return folder
    if not force:
        msg = f"{bag}: holds the recording of an earlier run; choose another --out, or --force to overwrite it"
        raise BringupError(msg)
    strange = [item.name for item in bag.iterdir() if item.suffix not in (".mcap", ".yaml")]
    if strange:
        msg = f"{bag}: holds {strange[0]!r}, which is not part of a recording; move it away first"
        raise BringupError(msg)
    for item in bag.iterdir():
        item.unlink()
    bag.rmdir()
    return folder


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as problem:
        msg = f"{folder}: cannot be written to: {one_line(problem.strerror)}"
        raise BringupError(msg) from None


def _health(bag: Path) -> "list[NodeHealth]":
    from bringup.bags.reader import health_reports, read_raw
    from bringup.ros.health import health_of

    return health_of(health_reports(read_raw(bag)))


def _finish(recording: "Recording", folder: Path, as_json: bool, health: "Sequence[NodeHealth]" = ()) -> None:
    """Write summary and report of a run, and say where they are."""
    from bringup.report.page import write_report
    from bringup.summary import summarise, write_summary

    summary = summarise(recording)
    write_summary(summary, folder / "summary.json")
    other, note = _companion(recording)
    write_report(folder / "report.html", recording, other, note, health)
    if as_json:
        print_json(summary)
    else:
        _print_summary(summary)
        say(f"wrote {folder / 'summary.json'} and {folder / 'report.html'}")


def _companion(recording: "Recording") -> "tuple[Recording | None, str]":
    """Give the passive run to show beside an active one with faults, and the sentence that says where it is from."""
    from bringup.loop import simulate as simulate_loop
    from bringup.scenario import check

    if recording.metadata["passive"] or not recording.metadata["scenario"].get("faults"):
        return None, ""
    try:
        passive = simulate_loop(check(recording.metadata["scenario"], "scenario of the recording"), passive=True)
    except BringupError as problem:
        return None, f"The passive run beside it could not be simulated: {problem}."
    return passive, "The passive run beside it was simulated in one process from the same scenario."


def _print_summary(summary: dict[str, Any]) -> None:
    rows = [
        ["ticks", f"{summary['ticks']} at {summary['sample_time_s']:g} s, {summary['missed_ticks']} missed"],
        ["speed", _speed(summary)],
    ]
    for fault in summary["faults"]:
        named = "not isolated"
        if fault["isolated_as"] is not None:
            after = fault["isolated_s"] - fault["onset_s"]
            named = f"isolated as {fault['isolated_as']} after {after:.1f} s"
        rows.append([f"{fault['size']:g} {fault['unit']} at {fault['onset_s']:g} s", named])
    rows.append(["false alarms", str(summary["false_alarms"])])
    units = {"rpm": "rpm", "kpa": "kPa", "k": "K"}
    for key, value in summary["metrics"].items():
        name, _, unit = key.rpartition("_")
        rows.append([name.replace("_", " "), "–" if value is None else f"{value:.3f} {units[unit]}"])
    kind = "passive" if summary["passive"] else "active"
    print_table([summary["scenario"], f"{summary['mode']}, {kind}"], rows)


def _speed(summary: dict[str, Any]) -> str:
    factor = summary["real_time_factor"]
    return "–" if factor is None else f"{factor:.1f} times real time ({summary['wall_seconds']:.2f} s)"


# -------------------------------------------------------------------------------------------------------- main


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with its code; every failure is one line on stderr."""
    # A polite kill ends a run as Ctrl-C does: the nodes are stopped, and the bag is closed.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        code = cli.main(args=arguments, prog_name="acftc", standalone_mode=False)
    except click.exceptions.Exit as end:
        code = end.exit_code
    except (KeyboardInterrupt, click.exceptions.Abort):
        code = _fail("interrupted", INTERRUPTED)
    except click.ClickException as problem:
        code = _fail(_usage(problem), BAD_INPUT)
    except BrokenPipeError:
        # The reader of stdout went away (head); nothing is left to say, and the interpreter must not try again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = FAILED
    except Exception as problem:
        code = _explain(problem)
    sys.exit(code if isinstance(code, int) else 0)


def _usage(problem: click.ClickException) -> str:
    text = problem.format_message()
    context = getattr(problem, "ctx", None)
    return f"{text} (see {context.command_path} --help)" if context is not None else text


def _explain(problem: Exception) -> int:
    """One line for any exception: its message when it is meant for the user, else where the traceback is."""
    if _meant_for_the_user(problem):
        code = BAD_INPUT if isinstance(problem, ValueError) else FAILED
        return _fail(str(problem), getattr(problem, "exit_code", code))
    if isinstance(problem, OSError) and problem.strerror:
        where = f"{problem.filename}: " if problem.filename else ""
        return _fail(f"{where}{problem.strerror}", FAILED)
    handle, name = tempfile.mkstemp(prefix="acftc-", suffix=".log")
    with os.fdopen(handle, "w", encoding="utf-8") as log:
        log.write(f"acftc {' '.join(sys.argv[1:])}\n")
        traceback.print_exception(problem, file=log)
    what = f"{type(problem).__name__}: {problem}"
    return _fail(f"unexpected error, please report it with {name} ({one_line(what)[:200]})", FAILED)


def _meant_for_the_user(problem: Exception) -> bool:
    """Whether the message was written for a user: an error class of ours, or a ValueError that our own code raised."""
    if type(problem).__module__.partition(".")[0] in OWN_PACKAGES:
        return True
    if type(problem) is not ValueError:
        return False
    last = traceback.extract_tb(problem.__traceback__)[-1]
    # A ValueError of numpy's compiled code shows our line as the last one, too, but that line is no raise.
    return Path(last.filename).parent.name in OWN_PACKAGES and (last.line or "").startswith("raise")


def _fail(line: str, code: int) -> int:
    click.echo(f"acftc: {one_line(line)}", err=True)
    return code


if __name__ == "__main__":
    main()
