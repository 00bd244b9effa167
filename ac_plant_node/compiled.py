"""The one decorator for compiled functions: numba, with a disk cache that knows about *all* the compiled sources.

Numba's own cache watches only the file a function is written in. The integrator has the right-hand side of another file
compiled into it, so an edit there would go unnoticed. Here the cache folder is named by a hash of every source that
takes part: an edit anywhere compiles anew, and a stale function can never run.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray
from platformdirs import user_cache_dir

from ac_plant_node.fingerprint import COMPILED_SOURCES, source_hash

Array = NDArray[np.float64]
"""What compiled functions work on; each says in its docstring which shape."""

_FOLDER = Path(user_cache_dir("acftc")) / f"compiled-{source_hash(COMPILED_SOURCES)}"


def jit[F: Callable[..., Any]](function: F) -> F:
    """Compile on first call; IEEE division (no Python exceptions), no reordering of floating-point operations."""
    previous = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(_FOLDER)
    try:
        compiled: F = numba.njit(function, cache=True, error_model="numpy", fastmath=False)
        return compiled
    finally:
        numba.config.CACHE_DIR = previous
