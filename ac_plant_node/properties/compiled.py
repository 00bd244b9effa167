"""The decorator for the plant's compiled functions."""

from collections.abc import Callable
from typing import Any

from ac_common.compiled import Array, compiler

__all__ = ["COMPILED_PACKAGES", "Array", "jit"]

COMPILED_PACKAGES = ("ac_plant_node.properties", "ac_plant_node.parameters", "ac_plant_node.dynamics")
"""Those whose functions are compiled into one another."""

_compile = compiler(*COMPILED_PACKAGES)


def jit[F: Callable[..., Any]](function: F) -> F:
    """Compile a function of the model on its first call (see `ac_common.compiled`)."""
    compiled: F = _compile(function)
    return compiled
