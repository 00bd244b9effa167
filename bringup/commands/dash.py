"""`acftc dash`: a live page beside a running graph."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

import click

from ac_common.errors import RunError
from bringup.commands.console import say
from bringup.commands.options import OneOf, examples


@click.command(
    epilog=examples(
        "acftc dash                          a private graph, unless one is running",
        "ROS_DOMAIN_ID=7 acftc dash          beside the graph in that ROS domain",
        "acftc dash --host 0.0.0.0           for other machines, too: the address then holds a token",
    ),
    short_help="A live page: watch a running graph, break things on it.",
)
@click.option(
    "--host",
    metavar="ADDRESS",
    default="127.0.0.1",
    show_default=True,
    help="Address to bind to. Another than this machine's own wants a token, which the printed address holds.",
)
@click.option(
    "--port", metavar="PORT", type=click.IntRange(1, 65535), help="Default: 5006 when it is free, else any that is."
)
@click.option(
    "--point",
    type=OneOf(["low", "med", "high"]),
    default="med",
    show_default=True,
    help="Operating point of a private graph.",
)
@click.option("--no-browser", is_flag=True, help="Print the address, and open no browser.")
def dash(host: str, port: int | None, point: str, no_browser: bool) -> None:
    """Serve a page with the running loop's plots, lamps and controls; Ctrl-C ends it.

    Looks into the ROS domain of ROS_DOMAIN_ID, 0 when it is not set. Where no graph is running it starts one, at rest
    on the wall clock and not recorded, and ends it with the page.
    """
    from bringup.dash.private_graph import find_or_start
    from bringup.dash.server import listen, open_browser, serve

    address = listen(host, port or 0)
    with ExitStack() as stack:
        domain, private = find_or_start(point)
        if private is not None:
            stack.enter_context(private)
        from bringup.dash.link import Link

        link = Link(domain, is_starting=private is not None)
        stack.callback(link.close)
        what = "a private graph" if private is not None else "the running graph"
        say(f"{address.url} shows {what} in ROS domain {domain}; Ctrl-C ends it")
        if not no_browser:
            open_browser(address.url)
        serve(address, link, (lambda: private.problem) if private is not None else (lambda: ""))
        if private is not None and private.problem:
            raise RunError(private.problem)


dash_option = click.option(
    "--dash", "with_page", is_flag=True, help="Open the live page beside the run; see acftc dash --help."
)


@contextmanager
def page(wanted: bool) -> Iterator[Callable[[int], None] | None]:
    """Serve a page beside a run; gives what starts it once the run's ROS domain is known, None where none is wanted."""
    if not wanted:
        yield None
        return
    from bringup.dash.server import listen, open_browser, start_beside

    address = listen()
    say(f"{address.url} shows the run")
    with ExitStack() as stack:

        def start(domain: int) -> None:
            process = start_beside(address, domain)
            stack.callback(process.wait)
            stack.callback(process.terminate)

        open_browser(address.url)
        yield start
