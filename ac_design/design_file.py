"""Designs as files: what a run used travels with its bag, and a node can be given a design of your own."""

import struct
import tokenize
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from ac_common.errors import shortened
from ac_common.topics import COMPENSATOR, CONTROLLER, FDI

#: Attachments of a bag: ``design/<node>.npz``.
ATTACHMENT = "design/{}.npz"


def design_of(
    node: str,
    point: str,
    sample_time_s: float,
    sensors: int = 3,
    superheat: Any = "direct",
    controller: str = "tracking",
) -> Any:
    """Design that a node uses at an operating point, from the cache or made now.

    `sensors` is the detector's; `superheat` how the superheat is measured, "direct" or "derived"; `controller` is which
    K0, "tracking" or "paper".
    """
    import fdi_node
    import gimc_controller_node

    weights = gimc_controller_node.CONTROLLERS[controller]
    makers: dict[str, Callable[..., Any]] = {
        FDI: partial(fdi_node.design, sensors=sensors, superheat=superheat),
        COMPENSATOR: partial(
            gimc_controller_node.design_compensator, controller=weights, fdi=fdi_node.FdiWeights(superheat=superheat)
        ),
        CONTROLLER: partial(gimc_controller_node.design_controller, weights=weights),
    }
    return makers[node](point, sample_time_s)


#: The nodes that have a design.
DESIGNED = (FDI, COMPENSATOR, CONTROLLER)


def to_bytes(design: Any) -> bytes:
    """Numbers of a design dataclass as the content of an ``.npz`` file."""
    values = {field.name: getattr(design, field.name) for field in fields(design)}
    buffer = BytesIO()
    numbers: dict[str, Any] = {name: v for name, v in values.items() if isinstance(v, np.ndarray | float)}
    np.savez_compressed(buffer, **numbers)
    return buffer.getvalue()


def from_file(kind: Any, file: str, sample_time_s: float) -> Any:
    """Read a design of class `kind` from an ``.npz`` file and try it for one tick.

    Raises
    ------
    ValueError
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
        _try(design)
    except _BAD_FILE as problem:
        why = problem.strerror if isinstance(problem, OSError) and problem.strerror else problem
        msg = f"design_file {shortened(file, 200)}: holds no {kind.__name__}: {shortened(why, 200)}"
        raise ValueError(msg) from None
    if abs(design.sample_time_s - sample_time_s) > 1e-12:
        msg = f"design_file {file}: made for a sample time of {design.sample_time_s:g} s, not {sample_time_s:g} s"
        raise ValueError(msg)
    return design


#: What numpy and zipfile raise for a file that is not what it seems.
_BAD_FILE = (
    *(OSError, EOFError, LookupError, TypeError, ValueError, SyntaxError, ArithmeticError, MemoryError),
    *(RuntimeError, NotImplementedError, zipfile.BadZipFile, zlib.error, struct.error, tokenize.TokenError),
)


def _try(design: Any) -> None:
    """Let the design work for one tick: matrices that do not fit show here, not when the loop runs."""
    from fdi_node import FaultDetector, FdiDesign
    from gimc_controller_node import Compensator, CompensatorDesign, Controller, ControllerDesign

    measured, command = np.array([2.5e5, 20.0, 15.0]), np.array([100.0, 0.4])
    with np.errstate(over="raise", invalid="raise"):
        if isinstance(design, FdiDesign):
            detector = FaultDetector(design)
            detector.observe(0.0, measured, 30.0)
            detector.commanded(command)
            detector.observe(design.sample_time_s, measured, 30.0)
        elif isinstance(design, CompensatorDesign):
            Compensator(design).step(np.array([1e3, 1.0, 1.0]), None, None, reference=(2.5e5, 20.0))
        elif isinstance(design, ControllerDesign):
            Controller(design).step(measured[:2], measured[:2], np.zeros(2))
