"""The one decorator for compiled functions: numba, with a disk cache that knows about *all* the compiled sources.

Numba's own cache watches only the file a function is written in. The integrator has the right-hand side of another file
compiled into it, so an edit there would go unnoticed. Here the cache folder is named by a hash of every source that
takes part: an edit anywhere compiles anew, and a stale function can never run.
"""

from pathlib import Path
from typing import Any

import numba
from platformdirs import user_cache_dir

from ac_plant_node.fingerprint import COMPILED_SOURCES, source_hash

_FOLDER = Path(user_cache_dir("acftc")) / f"compiled-{source_hash(COMPILED_SOURCES)}"


def jit(function: Any) -> Any:
    """Compile on first call; IEEE division (no Python exceptions), no reordering of floating-point operations."""
    previous = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(_FOLDER)
    try:
        return numba.njit(function, cache=True, error_model="numpy", fastmath=False)
    finally:
        numba.config.CACHE_DIR = previous
