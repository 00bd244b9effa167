"""`acftc`: the command line. What it says on failure is one line on stderr; its exit code is 0 only on success.

The commands are in `bringup.commands`, one module each; heavy modules are imported by the command that needs them, so
that help comes at once.
"""

import os
import signal
import sys
import tempfile
import traceback
from importlib import import_module
from pathlib import Path

import click

from ac_common.blas_threads import one_blas_thread
from ac_common.errors import UserError, nearest, one_line
from ac_ros_common.installation import INTERRUPTED, check_environment, left_aside, use_own_ros
from bringup.commands.options import examples
from bringup.launch.interrupts import SIGNALS, orderly_interrupts

#: Names the plant's parameter file; the same as `PLANT_VARIABLE` of `ac_plant_node`, which is heavy to import.
PLANT_VARIABLE = "ACFTC_PLANT"

FAILED = 1
BAD_INPUT = 2

#: Every command, under the heading where help lists it, in the order of use.
SECTIONS: dict[str, tuple[str, ...]] = {
    "Run": ("run", "simulate", "study", "scenarios"),
    "Recordings": ("report", "export", "replay", "bags"),
    "A running graph": ("dash", "topics", "foxglove"),
    "Plant and designs": ("equilibria", "calibrate", "design", "reproduce"),
    "This machine": ("bench", "campaign", "completion"),
}
#: Those that look at ROS, whose settings must be right for them.
WITH_ROS = ("run", "replay", "dash", "topics", "foxglove", "bench", "campaign")


class CommandGroup(click.Group):
    """The commands of `SECTIONS`, each imported when it is asked for; a misspelt one gets the nearest suggested."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        """Name all commands in the order of use."""
        return [name for names in SECTIONS.values() for name in names] + list(self.commands)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the module of a command and give the command."""
        if cmd_name in self.commands or cmd_name not in self.list_commands(ctx):
            return super().get_command(ctx, cmd_name)
        command: click.Command = getattr(import_module(f"bringup.commands.{cmd_name}"), cmd_name)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command that the words begin with."""
        name, known = args[0], self.list_commands(ctx)
        if name not in known and not name.startswith("-"):
            msg = f"unknown command {name!r}{nearest(name, known)} allowed: {', '.join(known)}"
            raise click.UsageError(msg, ctx)
        if name in WITH_ROS:
            check_environment()
            if told := left_aside():
                click.echo(f"acftc: {told}", err=True)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands under their headings."""
        width = max(len(name) for name in self.list_commands(ctx))
        for heading, names in SECTIONS.items():
            commands = [(name, self.get_command(ctx, name)) for name in names]
            with formatter.section(heading):
                formatter.write_dl(
                    [(name.ljust(width), command.get_short_help_str(100)) for name, command in commands if command]
                )


@click.group(
    epilog=examples(
        "acftc scenarios # what can be run",
        "acftc run actuator_fault --out results/e5 # all nodes, a bag, a summary and a report",
        "acftc simulate sensor_fault --out results/e6 # the same loop in one process, without ROS",
    )
    + """

\b
Exit codes:
  0  success
  1  a run that failed, a comparison that differs, a limit that was missed
  2  bad input: a wrong option, a scenario or a bag that cannot be read
  130  interrupted; what had been recorded until then is kept""",
    cls=CommandGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
@click.version_option(package_name="acftc", prog_name="acftc")
@click.option(
    "--plant",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Parameters of a plant of your own, as `acftc calibrate --out` writes them. Default: the built-in plant.",
)
def cli(plant: Path | None) -> None:
    """Fault-tolerant control of a vapour-compression air conditioner on ROS 2."""
    if plant is not None:
        # The nodes are processes of their own: what they inherit says which plant it is.
        os.environ[PLANT_VARIABLE] = str(plant.resolve())


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with its code; every failure is one line on stderr."""
    # A polite kill ends a run as Ctrl-C does: the nodes are stopped, and the bag is closed.
    with orderly_interrupts():
        code = _run(arguments)
        sys.exit(code if isinstance(code, int) else 0)


def _run(arguments: list[str] | None) -> object:
    code: object
    try:
        code = cli.main(args=arguments, prog_name="acftc", standalone_mode=False)
    except click.exceptions.Exit as end:
        code = end.exit_code
    except (KeyboardInterrupt, click.exceptions.Abort):
        code = _fail("interrupted", INTERRUPTED)
    except click.exceptions.NoArgsIsHelpError as nothing_asked:
        nothing_asked.show()
        code = BAD_INPUT
    except click.ClickException as problem:
        code = _fail(_usage(problem), BAD_INPUT)
    except BrokenPipeError:
        # The reader of stdout went away (head); nothing is left to say, and the interpreter must not try again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = FAILED
    except Exception as problem:
        code = _explain(problem)
    return code


def entry() -> None:
    """Run the command line as a program."""
    use_own_ros()
    one_blas_thread()
    try:
        main()
    except SystemExit as end:
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)  # all is over: nothing is left to interrupt
        if "rclpy" in sys.modules and isinstance(end.code, int):
            from ac_ros_common.process_exit import leave

            leave(end.code)
        raise


def _usage(problem: click.ClickException) -> str:
    text = problem.format_message()
    context = getattr(problem, "ctx", None)
    return f"{text} (see {context.command_path} --help)" if context is not None else text


def _explain(problem: Exception) -> int:
    """Say in one line what an exception means: its message when meant for the user, else where the traceback is."""
    if isinstance(problem, UserError):
        return _fail(str(problem), problem.exit_code)
    if isinstance(problem, OSError) and problem.strerror:
        where = f"{problem.filename}: " if problem.filename else ""
        return _fail(f"{where}{problem.strerror}", FAILED)
    handle, name = tempfile.mkstemp(prefix="acftc-", suffix=".log")
    with os.fdopen(handle, "w", encoding="utf-8") as log:
        log.write(f"acftc {' '.join(sys.argv[1:])}\n")
        traceback.print_exception(problem, file=log)
    what = f"{type(problem).__name__}: {problem}"
    return _fail(f"unexpected error, please report it with {name} ({one_line(what)[:200]})", FAILED)


def _fail(line: str, code: int) -> int:
    click.echo(f"acftc: {one_line(line)}", err=True)
    return code


if __name__ == "__main__":
    entry()
