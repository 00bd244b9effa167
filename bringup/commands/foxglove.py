"""`acftc foxglove`: the live loop for Foxglove and Lichtblick."""

import contextlib

import click

from bringup.commands.console import say
from bringup.commands.extras import need
from bringup.commands.options import examples


@click.command(
    epilog=examples(
        "acftc foxglove # then open ws://localhost:8765 in Foxglove or Lichtblick",
        "ROS_DOMAIN_ID=7 acftc foxglove --port 8770 # of the graph in that ROS domain",
    ),
    short_help="The live loop for Foxglove and Lichtblick.",
)
@click.option("--host", metavar="ADDRESS", default="127.0.0.1", show_default=True, help="Address to bind to.")
@click.option(
    "--port", metavar="PORT", type=click.IntRange(1, 65535), default=8765, show_default=True, help="Port to bind to."
)
def foxglove(host: str, port: int) -> None:
    """Serve the running loop's topics, /diagnostics, /clock and /rosout by WebSocket; Ctrl-C ends it.

    Foxglove and Lichtblick connect to it ("Foxglove WebSocket") and need no ROS installation; layouts/foxglove.json is
    a layout. Whoever can reach the address can read the loop; nobody can write.
    """
    need("foxglove", foxglove="foxglove-sdk")
    from bringup.commands.foxglove_bridge import bridge

    with bridge(host, port) as passing, contextlib.suppress(KeyboardInterrupt):
        say(f"ws://{host}:{port} has the running loop for Foxglove and Lichtblick; Ctrl-C ends it")
        passing.serve()
