"""`acftc simulate`: the same loop in one process, without ROS."""

from pathlib import Path

import click

from bringup.commands.console import progress_bar
from bringup.commands.options import examples, scenario_options
from bringup.commands.outcome import finish, load_scenario, prepare_folder


@click.command(
    epilog=examples(
        "acftc simulate sensor_fault --out results/e6",
        "acftc simulate sensor_fault --passive # K0 alone, for comparison",
        "acftc simulate actuator_fault --set operating_point=high --json | jq .metrics",
        "acftc simulate actuator_fault --set 'noise={superheat_k: 0.1, seed: 3}'",
    ),
    short_help="Run a scenario in one process, without ROS.",
)
@scenario_options
def simulate(
    scenario: str,
    out: Path | None,
    passive: bool,
    overrides: tuple[str, ...],
    force: bool,
    with_report: bool,
    as_json: bool,
) -> None:
    """Run SCENARIO in one process without ROS: the same step functions, the same summary and report."""
    from ac_experiments.simulate import simulate as simulate_loop

    chosen = load_scenario(scenario, overrides, passive)
    folder = prepare_folder(out or Path("results") / f"{chosen.name}_simulated", force)
    with progress_bar(f"{chosen.name} (simulation)") as progress:
        recording = simulate_loop(chosen, progress=progress)
    finish(recording, folder, as_json, with_report=with_report)
