"""The decorator for the plant's compiled functions."""

from collections.abc import Callable
from typing import Any

from ac_common.compiled import Array, compiler

__all__ = ["Array", "jit"]

_compile = compiler("ac_plant_node.properties", "ac_plant_node.parameters", "ac_plant_node.dynamics")


def jit[F: Callable[..., Any]](function: F) -> F:
    """Compile a function of the model on its first call (see `ac_common.compiled`)."""
    compiled: F = _compile(function)
    return compiled
