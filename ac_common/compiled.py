"""Decorators for compiled functions: numba, with a disk cache that knows about *all* the sources compiled together.

Numba's own cache watches only the file a function is written in. An integrator has the right-hand side of another file
compiled into it, so an edit there would go unnoticed. Here the cache folder is named by a hash of every source that
takes part: an edit anywhere compiles anew, and a stale function can never run.

The plant is always compiled (`compiler`). What a tick of detector, compensator and controller does (`step_compiler`) is
compiled where many ticks are run in one process. A node, which has a tenth of a second for each, leaves it to Python:
numba takes 130 MB and more than half a second of each process that loads it. Operations and their order are the same,
and so are the numbers, to the last bit.
"""

from collections.abc import Callable
from functools import update_wrapper
from types import FunctionType
from typing import Any, cast

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
    return lambda function: _compiled(function, folder)


def step_compiler(*packages: str) -> Callable[..., Any]:
    """Return a decorator for functions of a tick: compiled on first call, or after `interpret_steps` left to Python.

    Parameters
    ----------
    *packages : str
        As of `compiler`.

    Returns
    -------
    callable
        The decorator; it may be told by ``instead`` what does the same in Python, faster than the function itself.
    """
    folder = str(compiled_folder(*packages))
    return lambda function, instead=None: _Step(function, instead or function, folder)


def interpret_steps() -> None:
    """Leave functions of a tick to Python from now on in this process; to be called before any of them is used."""
    _Step.interpreted = True


def ready[F: Callable[..., Any]](step: F) -> F:
    """Return what a function of a tick comes to in this process: who calls it at every tick saves a detour."""
    found: Any = step.ready() if isinstance(step, _Step) else step
    return cast("F", found)


class _Step:
    interpreted = False

    def __init__(self, function: FunctionType, instead: Callable[..., Any], folder: str) -> None:
        update_wrapper(self, function)
        self._function, self._instead, self._folder = function, instead, folder
        self._dispatcher: Any = None
        self._run: Callable[..., Any] = self._first

    def __call__(self, *arguments: Any) -> Any:
        return self._run(*arguments)

    def _first(self, *arguments: Any) -> Any:
        self._run = self.ready()
        return self._run(*arguments)

    def ready(self) -> Callable[..., Any]:
        """Return the function as it is to be called in this process."""
        return self._instead if self.interpreted else self.compiled()

    def compiled(self) -> Any:
        """Return the function for compiled code, with the steps that it calls compiled, too."""
        if self._dispatcher is None:
            function = self._function
            known = function.__globals__
            steps = {name: known[name] for name in function.__code__.co_names if isinstance(known.get(name), _Step)}
            own = {**known, **{name: step.compiled() for name, step in steps.items()}}
            self._dispatcher = _compiled(update_wrapper(FunctionType(function.__code__, own), function), self._folder)
        return self._dispatcher


def _compiled(function: Any, folder: str) -> Any:
    import numba  # not in a node that can do without it

    previous = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = folder
    try:
        return numba.njit(function, cache=True, error_model="numpy", fastmath=False)
    finally:
        numba.config.CACHE_DIR = previous
