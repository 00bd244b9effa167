"""The decorator for the compiled functions of this package: the plant's modules, and its own, compiled together."""

from collections.abc import Callable
from typing import Any

from ac_common.compiled import Array, compiler
from ac_plant_node.compiled_sources import COMPILED_SOURCES

__all__ = ["SOURCES", "Array", "jit"]

_MODULES = ("model", "transition", "memory", "products", "step", "jumps", "filter", "quiet")
SOURCES = (*COMPILED_SOURCES, *(f"fdi_node.envelope.{name}" for name in _MODULES))
"""As `COMPILED_SOURCES` of the plant."""
_compile = compiler(*SOURCES)


def jit[F: Callable[..., Any]](function: F) -> F:
    """Compile a function on its first call (see `ac_common.compiled`)."""
    compiled: F = _compile(function)
    return compiled
