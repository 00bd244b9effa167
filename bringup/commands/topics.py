"""`acftc topics`: what flows between the nodes right now."""

import contextlib

import click

from bringup.commands.console import print_json
from bringup.commands.options import examples, json_option


@click.command(
    epilog=examples(
        "acftc topics # in a second terminal, while acftc run goes on in the first",
        "acftc topics --json | jq '.[].name'",
    ),
    short_help="What flows between the nodes of a running graph.",
)
@json_option
def topics(as_json: bool) -> None:
    """Show the topics of the running loop: type, rate, last value, publishers and subscribers; Ctrl-C ends it.

    Looks into the ROS domain of ROS_DOMAIN_ID, 0 when it is not set: where `acftc run` puts a graph by default. With
    --json it watches for two seconds and prints what it has seen.
    """
    from bringup.commands.topic_watch import table, topics_live, topics_once

    if as_json:
        print_json(topics_once())
        return
    from rich.live import Live

    with Live(auto_refresh=False) as live, contextlib.suppress(KeyboardInterrupt):
        for rows in topics_live():
            live.update(table(rows, live.console.width), refresh=True)
