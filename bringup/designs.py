"""Designs as files: what a run used travels with its bag, and a node can be given a design of your own."""

from collections.abc import Callable
from dataclasses import fields
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from bringup.topics import COMPENSATOR, CONTROLLER, FDI

#: Attachments of a bag: ``design/<node>.npz``.
ATTACHMENT = "design/{}.npz"


def design_of(node: str, point: str, sample_time_s: float, sensors: int = 3, superheat: Any = "direct") -> Any:
    """Design that a node uses at an operating point, from the cache or made now.

    `sensors` is the detector's; `superheat` how the superheat is measured, "direct" or "derived".
    """
    import fdi_node
    import gimc_controller_node

    makers: dict[str, Callable[..., Any]] = {
        FDI: partial(fdi_node.design, sensors=sensors, superheat=superheat),
        COMPENSATOR: partial(gimc_controller_node.design_compensator, fdi=fdi_node.FdiWeights(superheat=superheat)),
        CONTROLLER: gimc_controller_node.design_controller,
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
    """Read a design of class `kind` from an ``.npz`` file.

    Raises
    ------
    ValueError
        When there is no such file, it holds no such design, or one for another sample time.
    """
    try:
        with np.load(Path(file), allow_pickle=False) as arrays:
            design = kind.from_arrays(dict(arrays))
    except (OSError, KeyError, TypeError, ValueError) as problem:
        msg = f"design_file {file}: holds no {kind.__name__}: {problem}"
        raise ValueError(msg) from None
    if abs(design.sample_time_s - sample_time_s) > 1e-12:
        msg = f"design_file {file}: made for a sample time of {design.sample_time_s:g} s, not {sample_time_s:g} s"
        raise ValueError(msg)
    return design
