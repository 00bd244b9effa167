"""The decorator for the compiled functions of this package.

What a block remembers from tick to tick, and what it is made of, is one flat array, because each array that is handed
to compiled code costs time.
"""

from collections.abc import Callable
from typing import Any

from ac_common.compiled import Array, step_compiler

__all__ = ["Array", "jit"]

_compile = step_compiler("ac_common.products", "ac_plant_node.saturation", "gimc_controller_node")


def jit[F: Callable[..., Any]](function: F) -> F:
    """Compile a function on its first call (see `ac_common.compiled`)."""
    compiled: F = _compile(function)
    return compiled
