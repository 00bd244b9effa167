"""`acftc bags`: bags themselves."""

from pathlib import Path

import click

from bringup.commands.options import bag_argument, examples

_EXAMPLE = "acftc bags recover results/e5 # after a power loss, or when several files are there"


@click.group(epilog=examples(_EXAMPLE), short_help="Recover a bag that lacks its end.")
def bags() -> None:
    """Work on bags."""


@bags.command(
    epilog=examples(_EXAMPLE),
    short_help="Give a bag its index and metadata, and make several files one.",
)
@bag_argument
def recover(bag: Path) -> None:
    """Give a bag its index and metadata, and make several files one; what was written before the end is kept.

    BAG is the folder of a run, its bag, or an .mcap file.
    """
    from ac_experiments.bags.mending import recover as recover_bag

    touched, count, damaged = recover_bag(bag)
    what = f"made whole from {', '.join(file.name for file in touched)}" if touched else "was whole"
    click.echo(f"{bag}: {what}; {count} messages")
    for file, kept in damaged.items():
        click.echo(
            f"{file.name} is damaged: its first {kept} messages were kept; the file itself is now {file.name}.damaged"
        )
