"""The decorator for the compiled functions of this package: the plant's, and this package's own sources with them."""

from collections.abc import Callable
from typing import Any

from ac_common.compiled import Array, compiler
from ac_plant_node.compiled_sources import COMPILED_SOURCES

__all__ = ["Array", "jit"]

_compile = compiler(*COMPILED_SOURCES, "fdi_node.envelope")


def jit[F: Callable[..., Any]](function: F) -> F:
    """Compile a function on its first call (see `ac_common.compiled`)."""
    compiled: F = _compile(function)
    return compiled
