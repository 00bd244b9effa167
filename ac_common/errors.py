"""Errors that a user of acftc is meant to see: one line, no traceback, and the exit code that goes with it."""

import difflib
from collections.abc import Iterable


class UserError(ValueError):
    """Bad input; the message is one line that says what, where, and what is allowed.

    Whoever raises it has written the message for the user; any other exception that arrives at the command line is a
    mistake in the program, a plain ValueError, too.
    """

    exit_code = 2


class RunError(UserError):
    """A run that began and could not go on; the message is one line that says where it stopped and why."""

    exit_code = 1


class InterruptedRunError(UserError):
    """A run that the user stopped; the message is one line that says what is left of it."""

    exit_code = 130


def one_line(text: object) -> str:
    """Return `text` as a single line: what an error message or a table cell can hold."""
    return " ".join(str(text).split())


def shortened(text: object, length: int = 60) -> str:
    """Return `text` as a single line of at most `length` characters: what a message can quote of a bad input."""
    line = one_line(text)
    return line if len(line) <= length else line[: length - 3] + "..."


def nearest(word: object, known: Iterable[str], otherwise: str = ";") -> str:
    """Return ``, did you mean 'x'?`` for the nearest of the `known` words, or `otherwise` when none is near."""
    near = difflib.get_close_matches(str(word), list(known), n=1)
    return f", did you mean {near[0]!r}?" if near else otherwise
