"""The decorator for the plant's compiled functions."""

from collections.abc import Callable
from typing import Any

from ac_common.compiled import Array, compiler
from ac_plant_node.compiled_sources import COMPILED_SOURCES

__all__ = ["Array", "jit"]

_compile = compiler(*COMPILED_SOURCES)


def jit[F: Callable[..., Any]](function: F) -> F:
    """Compile a function of the model on its first call (see `ac_common.compiled`)."""
    compiled: F = _compile(function)
    return compiled
