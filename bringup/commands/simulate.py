"""`acftc simulate`: the same loop in one process, without ROS."""

from pathlib import Path

import click

from ac_common import collector
from bringup.commands.console import progress_bar
from bringup.commands.options import examples, params_file_option, repeated, scenario_options
from bringup.commands.outcome import finish, load_scenario, prepare_folder


@click.command(
    epilog=examples(
        "acftc simulate sensor_fault --out results/e6",
        "acftc simulate sensor_fault --passive # K0 alone, for comparison",
        "acftc simulate actuator_fault --set operating_point=high --json | jq .metrics",
        "acftc simulate actuator_fault --params-file examples/own_q.yaml # a design of yours",
        "acftc simulate actuator_fault --set 'noise={superheat_k: 0.1, seed: 3}'",
    ),
    short_help="Run a scenario in one process, without ROS.",
)
@scenario_options
@params_file_option
@click.option(
    "--bag/--no-bag",
    "with_bag",
    default=True,
    help="Leave the bag away: two seconds less for each 1000 s of the run.",
)
@click.pass_context
def simulate(
    context: click.Context,
    scenario: str,
    out: Path | None,
    passive: bool,
    overrides: tuple[str, ...],
    force: bool,
    with_report: bool,
    as_json: bool,
    params_file: Path | None,
    with_bag: bool,
) -> None:
    """Run SCENARIO in one process without ROS: the same step functions, the same bag, summary and report.

    DIR gets what `acftc run` writes there, but for the logs: bag/ (a ROS 2 bag), summary.json, report.html and its
    pictures.
    """
    from ac_experiments.simulate import simulate as simulate_loop
    from bringup.launch.given_parameters import in_one_process
    from bringup.launch.user_nodes import user_nodes

    chosen = load_scenario(scenario, overrides, passive)
    user_nodes(params_file=params_file)
    made = in_one_process(params_file, chosen)
    folder = prepare_folder(out or Path("results") / f"{chosen.name}_simulated", force)
    designs = made.designs
    with progress_bar(f"{chosen.name} (simulation)") as progress:
        recording = simulate_loop(made.scenario, progress=progress, designs=designs, limits=made.limits)
    recording.metadata["command"] = repeated(context)
    with collector.paused():
        if with_bag:
            from ac_experiments.bags.simulated import write_bag

            write_bag(folder / "bag", recording, designs)
        finish(recording, folder, as_json, with_report=with_report)
