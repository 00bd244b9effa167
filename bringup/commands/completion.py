"""`acftc completion`: what makes a shell complete this command line."""

import click
from click.shell_completion import get_completion_class

from bringup.commands.options import OneOf, examples

#: In click's scripts: what puts a word on the line, and the same for a ``KEY=``, after which no blank may come.
_NO_BLANK_AFTER = {
    "bash": ("COMPREPLY+=($value)", "COMPREPLY+=($value); [[ $value != *= ]] || compopt -o nospace"),
    "zsh": (
        "compadd -U -V unsorted -a completions",
        'compadd -U -V unsorted -S "${${completions[1]:#*=}:+ }" -a completions',
    ),
}


@click.command(
    epilog=examples(
        'eval "$(acftc completion bash)" # in this shell; for every one, the same line in ~/.bashrc',
        'eval "$(acftc completion zsh)" # the same for zsh and ~/.zshrc',
        "acftc completion fish > ~/.config/fish/completions/acftc.fish",
    ),
    short_help="Make the shell complete commands, options and scenarios.",
)
@click.argument("shell", type=OneOf(["bash", "zsh", "fish"]))
@click.pass_context
def completion(ctx: click.Context, shell: str) -> None:
    """Print what makes SHELL complete commands, options, scenarios, node names and files."""
    make = get_completion_class(shell)
    assert make is not None  # click knows these three
    source = make(ctx.find_root().command, {}, "acftc", "_ACFTC_COMPLETE").source()
    click.echo(source.replace(*_NO_BLANK_AFTER.get(shell, ("", ""))))
