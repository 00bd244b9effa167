"""A decorator for compiled functions: numba, with a disk cache that knows about *all* the sources compiled together.

Numba's own cache watches only the file a function is written in. An integrator has the right-hand side of another file
compiled into it, so an edit there would go unnoticed. Here the cache folder is named by a hash of every source that
takes part: an edit anywhere compiles anew, and a stale function can never run.
"""

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from ac_common.cache import compiled_folder

Array = NDArray[np.float64]
"""What compiled functions work on; each says in its docstring which shape."""


def compiler(*packages: str) -> Callable[[Any], Any]:
    """Return a decorator that compiles on first call; IEEE division (no exceptions), no reordering of operations.

    Parameters
    ----------
    *packages : str
        Every package or module whose functions or constants are compiled into one another: a change in any of them
        compiles all anew.
    """
    folder = str(compiled_folder(*packages))

    def jit(function: Any) -> Any:
        previous = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = folder
        try:
            return numba.njit(function, cache=True, error_model="numpy", fastmath=False)
        finally:
            numba.config.CACHE_DIR = previous

    return jit
