"""Reading and writing of parameter files; `ac_plant_node.parameters.schema` checks those of users."""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from pathlib import Path

import numpy as np

from ac_plant_node.parameters.values import NAMES, POINT_RANGES, TABLE_I, Parameters, TableRow, shipped

PLANT_VARIABLE = "ACFTC_PLANT"
"""Environment variable that names the parameter file of a plant of your own (``acftc --plant FILE`` sets it)."""

_ANOTHER: ContextVar[Parameters | None] = ContextVar("another plant", default=None)


@contextmanager
def another_plant(parameters: Parameters | None) -> Iterator[None]:
    """Let `load_parameters()` return these within the block, as if their file were the one in use; None: no change.

    Designs are made for the plant in use: whoever wants them to know nothing of this one gets them before.
    """
    before = _ANOTHER.set(parameters or _ANOTHER.get())
    try:
        yield
    finally:
        _ANOTHER.reset(before)


def load_parameters(path: str | Path | None = None) -> Parameters:
    """Read a parameter file.

    Parameters
    ----------
    path : str or Path, optional
        By default that of `another_plant`, or the file that the environment variable `PLANT_VARIABLE` names, or else
        the one shipped with the package. In a file of your own an entry may be a plain number in the unit of its name,
        and what is not there is as shipped. Under ``points`` it may hold the operating points, as `load_points` reads
        them; else they are Table I's.

    Raises
    ------
    UserError
        One line: the entry that is unknown, not a number or outside its range.
    """
    another = _ANOTHER.get()
    if path is None and another is not None:
        return another
    own = path if path is not None else os.environ.get(PLANT_VARIABLE) or None
    if own is None:
        return _as_shipped()
    from ac_plant_node.parameters.schema import checked_plant  # the schema's library takes a while to load

    refrigerant, values, points = checked_plant(Path(own))
    return _parameters(refrigerant, values, str(own), points)


@cache
def _as_shipped() -> Parameters:
    known = shipped()
    return _parameters(known["refrigerant"], {name: float(known[name]["value"]) for name in NAMES})


def _parameters(
    refrigerant: str,
    values: Mapping[str, float],
    source: str = "parameters.yaml",
    points: tuple[TableRow, ...] = TABLE_I,
) -> Parameters:
    array = np.array([values[name] for name in NAMES])
    array.setflags(write=False)
    return Parameters(refrigerant, array, source, points)


def load_points(path: str | Path) -> tuple[TableRow, ...]:
    """Read a table of operating points: YAML with ``points``, a list of rows with the keys of `TableRow`.

    Raises
    ------
    UserError
        One line: the row and the entry that is missing, unknown, not a number or outside `POINT_RANGES`.
    """
    from ac_plant_node.parameters.schema import checked_points

    return checked_points(Path(path))


def parameter_text(parameters: Parameters, remarks: Mapping[str, str] | None = None) -> str:
    """Return the text of a parameter file that `load_parameters` reads back to the last bit, with ranges and reasons.

    Parameters
    ----------
    parameters : Parameters
    remarks : mapping, optional
        Reasons to write in place of the shipped ones.
    """
    known = shipped()
    lines = [f"refrigerant: {parameters.refrigerant}"]
    for name in NAMES:
        entry = known[name]
        same = parameters[name] == float(entry["value"])
        reason = (remarks or {}).get(name, entry["reason"] if same else "given")
        words = f"unit: {json.dumps(entry['unit'])}, low: {entry['low']}, high: {entry['high']}"
        lines.append(f"{name}: {{value: {parameters[name]!r}, {words}, reason: {json.dumps(reason)}}}")
    lines.append("points:")
    for row in parameters.points:
        values = {key: getattr(row, key) for key in POINT_RANGES if getattr(row, key) is not None}
        lines.append(f"  - {{name: {json.dumps(row.name)}, {', '.join(f'{k}: {v!r}' for k, v in values.items())}}}")
    return "\n".join(lines) + "\n"
