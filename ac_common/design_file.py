"""Designs as files: what a node loads, and what travels with the bag of a run."""

import struct
import tokenize
import zipfile
import zlib
from dataclasses import fields
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from ac_common.errors import UserError, shortened
from ac_common.files import write_whole
from ac_common.topics import COMPENSATOR, CONTROLLER, FDI

#: The nodes that have a design.
DESIGNED = (FDI, COMPENSATOR, CONTROLLER)
#: Attachments of a bag: ``design/<node>.npz``.
ATTACHMENT = "design/{}.npz"


def design_name(node: str, point: str) -> str:
    """Return the name of the file of a node's design at an operating point."""
    return f"{node}-{point}.npz"


def to_bytes(design: Any) -> bytes:
    """Return the numbers of a design as the content of an ``.npz`` file."""
    values = {field.name: getattr(design, field.name) for field in fields(design)}
    buffer = BytesIO()
    numbers: dict[str, Any] = {name: v for name, v in values.items() if isinstance(v, np.ndarray | float)}
    np.savez_compressed(buffer, **numbers)
    return buffer.getvalue()


def from_file(kind: Any, file: str, sample_time_s: float) -> Any:
    """Return the design of class `kind` in an ``.npz`` file, tried for one tick.

    The class makes itself from arrays (`from_arrays`) and works for one tick (`try_out`): matrices that do not fit show
    here, not when the loop runs.

    Raises
    ------
    UserError
        When there is no such file, it holds no such design, matrices that do not fit or are not finite, or a design for
        another sample time.
    """
    try:
        with np.load(BytesIO(Path(file).read_bytes()), allow_pickle=False) as stored:
            arrays = dict(stored)
        if not all(array.dtype == np.float64 and np.isfinite(array).all() for array in arrays.values()):
            msg = "an array of it is not finite numbers"
            raise ValueError(msg)
        design = kind.from_arrays(arrays)
        with np.errstate(over="raise", invalid="raise"):
            design.try_out()
    except _BAD_FILE as problem:
        why = problem.strerror if isinstance(problem, OSError) and problem.strerror else problem
        msg = f"design_file {shortened(file, 200)}: holds no {kind.__name__}: {shortened(why, 200)}"
        raise UserError(msg) from None
    if abs(design.sample_time_s - sample_time_s) > 1e-12:
        msg = f"design_file {file}: made for a sample time of {design.sample_time_s:g} s, not {sample_time_s:g} s"
        raise UserError(msg)
    return design


def loaded(kind: Any, node: str, file: str, sample_time_s: float, copy: str = "") -> Any:
    """Return the design of class `kind` that a node is to load from `file`, and leave a copy of it in `copy`, if any.

    Raises
    ------
    ValueError
        As `from_file`; when no file is given it says which command makes one.
    """
    if not file:
        example = design_name(node, "med")
        raise ValueError(f"no design_file given; `acftc design --out designs` makes one: designs/{example}")
    design = from_file(kind, file, sample_time_s)
    if copy:
        write_whole(Path(copy), to_bytes(design))
    return design


#: What numpy and zipfile raise for a file that is not what it seems.
_BAD_FILE = (
    *(OSError, EOFError, LookupError, TypeError, ValueError, SyntaxError, ArithmeticError, MemoryError),
    *(RuntimeError, NotImplementedError, zipfile.BadZipFile, zlib.error, struct.error, tokenize.TokenError),
)
