"""The one kind of error that a user of acftc is meant to see: one line, no traceback."""


class BringupError(ValueError):
    """Bad input or a run that cannot go on; the message is one line that says what, where, and what is allowed."""


def one_line(text: object) -> str:
    """`text` as a single line: what an error message or a table cell can hold."""
    return " ".join(str(text).split())
