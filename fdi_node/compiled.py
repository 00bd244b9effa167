"""The decorator for the compiled functions of the detector of an operating point.

What it remembers from tick to tick, and what it is made of, is one flat array, because each array that is handed to
compiled code costs time.
"""

from collections.abc import Callable
from typing import Any

from ac_common.compiled import Array, step_compiler

__all__ = ["Array", "jit"]

_MODULES = ("detector", "reading_jumps", "state_machine")
_compile = step_compiler("ac_common.products", "ac_common.faults", *(f"fdi_node.{name}" for name in _MODULES))


def jit[F: Callable[..., Any]](function: F) -> F:
    """Compile a function on its first call (see `ac_common.compiled`)."""
    compiled: F = _compile(function)
    return compiled
