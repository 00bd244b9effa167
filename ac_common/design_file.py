"""Designs as files: what a node loads, and what travels with the bag of a run."""

import struct
import tokenize
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, fields
from importlib import import_module
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


#: What the designs of a run are for: one operating point, as in the paper, or the whole envelope.
PAPER, ENVELOPE = "paper", "envelope"
#: In a design file: the name of the class of which it holds a design. Older files do not say it.
CLASS = "class"
#: Likewise: the operating point that a design is for, and the plant, `ac_plant_node.Parameters.identity`.
POINT, PLANT = "point", "plant"


@dataclass(frozen=True)
class DesignKind:
    """A kind of design that a node takes, and what runs it.

    The classes are named and not given: what a run has no use for is not imported.

    Attributes
    ----------
    design : `PAPER` or `ENVELOPE`; empty: there is one class for both.
    module : where the classes are.
    holds : class of the design.
    runs : class of what runs it, made of a design.
    """

    design: str
    module: str
    holds: str
    runs: str

    def made_of(self, design: Any, *arguments: Any) -> Any:
        """Return what runs a design."""
        return getattr(import_module(self.module), self.runs)(design, *arguments)


def kind_of[Kind: DesignKind](kinds: Sequence[Kind], design: Any) -> Kind:
    """Return the kind that a design is of."""
    return next(kind for kind in kinds if kind.holds == type(design).__name__)


def design_name(node: str, point: str, design: str = PAPER) -> str:
    """Return the name of the file of a node's design for runs that begin at an operating point."""
    return f"{node}-{point}.npz" if design == PAPER else f"{node}-{design}-{point}.npz"


def to_bytes(design: Any, point: str = "", plant: str = "") -> bytes:
    """Return the numbers of a design, and its class, as the content of an ``.npz`` file.

    `point` and `plant` say what it was made for; left out, what its numbers tell of that has to do.
    """
    values = {field.name: getattr(design, field.name) for field in fields(design)}
    buffer = BytesIO()
    numbers: dict[str, Any] = {name: v for name, v in values.items() if isinstance(v, np.ndarray | float)}
    numbers |= {CLASS: np.array(type(design).__name__), POINT: np.array(point), PLANT: np.array(plant)}
    np.savez_compressed(buffer, **numbers)
    return buffer.getvalue()


def from_file(kind: Any, file: str, sample_time_s: float) -> Any:
    """Return the design of class `kind` in an ``.npz`` file, tried for one tick.

    The class makes itself from arrays (`from_arrays`) and works for one tick (`try_out`): matrices that do not fit show
    here, not when the loop runs.

    Raises
    ------
    UserError
        When there is no such file, it holds no such design, one of another class, matrices that do not fit or are not
        finite, or a design for another sample time.
    """
    try:
        with np.load(BytesIO(Path(file).read_bytes()), allow_pickle=False) as stored:
            arrays = dict(stored)
        said = str(arrays.pop(CLASS, kind.__name__))
        for text in (POINT, PLANT):
            arrays.pop(text, None)
        if said != kind.__name__:
            msg = f"it holds one of the class {said}"
            raise ValueError(msg)
        if not all(array.dtype == np.float64 and np.isfinite(array).all() for array in arrays.values()):
            msg = "an array of it is not finite numbers"
            raise ValueError(msg)
        design = kind.from_arrays(arrays)
        with np.errstate(over="raise", invalid="raise"):
            design.try_out()
    except _BAD_FILE as problem:
        why = problem.strerror if isinstance(problem, OSError) and problem.strerror else problem
        if "pickle" in str(why):  # numpy then tells how to load it all the same, which would run what is in it
            why = "it is no .npz file of numbers"
        msg = f"design_file {shortened(file, 200)}: holds no {kind.__name__}: {shortened(why, 200)}"
        raise UserError(msg) from None
    if abs(design.sample_time_s - sample_time_s) > 1e-12:
        msg = f"design_file {file}: made for a sample time of {design.sample_time_s:g} s, not {sample_time_s:g} s"
        raise UserError(msg)
    return design


def loaded(
    kinds: Sequence[DesignKind], node: str, file: str, sample_time_s: float, copy: str = "", wanted: str = ""
) -> Any:
    """Return the design that a node is to load from `file`, and leave a copy of it in `copy`, if any.

    Parameters
    ----------
    kinds : sequence of DesignKind
        Those that the node takes; a file that does not say its own holds the first one.
    node, file : str
    sample_time_s : float
    copy : str
        File; empty: none.
    wanted : str
        `PAPER` or `ENVELOPE`, when the others are refused.

    Raises
    ------
    ValueError
        As `from_file`; when the design is not of the wanted ones; when no file is given it says which command makes
        one.
    """
    if not file:
        example = design_name(node, "med", wanted or PAPER)
        raise ValueError(f"no design_file given; `acftc design --out designs` makes one: designs/{example}")
    said, *made_for = texts_in(file)
    kind = next((kind for kind in kinds if kind.holds == said), kinds[0])
    design = from_file(getattr(import_module(kind.module), kind.holds), file, sample_time_s)
    if wanted and kind.design not in ("", wanted):
        msg = f"design_file {shortened(file, 200)}: a design of `design: {kind.design}`, in a run with {wanted}"
        raise UserError(msg)
    if copy:
        write_whole(Path(copy), to_bytes(design, *made_for))
    return design


def texts_in(file: str) -> tuple[str, str, str]:
    """Return what class of design a file says to hold, for which point and which plant; empty: it does not say."""
    try:
        with np.load(BytesIO(Path(file).read_bytes()), allow_pickle=False) as stored:
            said = {name: str(stored[name]) for name in (CLASS, POINT, PLANT) if name in stored}
    except _BAD_FILE:
        said = {}
    return said.get(CLASS, ""), said.get(POINT, ""), said.get(PLANT, "")


#: What numpy and zipfile raise for a file that is not what it seems.
_BAD_FILE = (
    *(OSError, EOFError, LookupError, TypeError, ValueError, SyntaxError, ArithmeticError, MemoryError),
    *(RuntimeError, NotImplementedError, zipfile.BadZipFile, zlib.error, struct.error, tokenize.TokenError),
)
