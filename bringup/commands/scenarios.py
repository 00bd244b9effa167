"""`acftc scenarios`: what can be run."""

import click

from bringup.commands.console import print_json, print_table
from bringup.commands.options import examples, json_option


@click.command(epilog=examples("acftc scenarios", "acftc scenarios --json | jq .actuator_fault"))
@json_option
def scenarios(as_json: bool) -> None:
    """List the built-in scenarios."""
    from ac_experiments.drives import DURATION_S, FAMILY
    from ac_experiments.scenario import built_in_scenarios, load

    known = {name: load(name, whole=False) for name in built_in_scenarios()}
    if as_json:
        print_json({name: item.model_dump(mode="json") for name, item in known.items()})
        return
    rows = [[name, f"{item.duration_s:g} s", item.description] for name, item in known.items()]
    rows.append([f"{FAMILY}:SEED", f"{DURATION_S:g} s", "A random drive over a moving load, such as drive:123."])
    print_table(["scenario", "duration", "what happens"], rows)
