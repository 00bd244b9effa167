"""`acftc replay`: a bag through one node again."""

from pathlib import Path

import click

from ac_common.errors import RunError, one_line
from bringup.commands.console import print_json, progress_bar, say
from bringup.commands.options import NodeType, bag_argument, examples, json_option
from bringup.launch.process_table import LOOP_NODES


@click.command(
    epilog=examples(
        "acftc replay results/e5/bag --node fdi # after a change of the code: does the detector still say the same?",
        "acftc replay results/e5/bag --node gimc_controller --json | jq .largest_relative_difference",
    ),
    short_help="Feed a bag through one node again.",
)
@bag_argument
@click.option(
    "--node", required=True, metavar="NAME", type=NodeType(LOOP_NODES), help=f"One of {', '.join(LOOP_NODES)}."
)
@json_option
def replay(bag: Path, node: str, as_json: bool) -> None:
    """Feed a bag's inputs through the real node again, over DDS, and compare its answers with the recorded ones.

    Exit code 1 when they differ by more than the rounding of another processor.
    """
    from bringup.replay.replay import replay as replay_node

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
