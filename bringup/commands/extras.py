"""Packages that a few commands need and the others do not."""

from importlib.util import find_spec

from ac_common.errors import UserError


def need(command: str, **packages: str) -> None:
    """Refuse a command whose packages are missing.

    Parameters
    ----------
    command : str
        Name of the command of acftc.
    **packages : str
        Module that it imports, and the package that has it.

    Raises
    ------
    UserError
        One line: which packages are missing and how to get them.
    """
    missing = [package for module, package in packages.items() if find_spec(module) is None]
    if missing:
        msg = f"acftc {command} needs {', '.join(missing)}: python3 start.py acftc {command} gets it, or pip"
        raise UserError(msg)
