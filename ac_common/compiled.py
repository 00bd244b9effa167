"""Decorators for compiled functions: numba, with a disk cache that knows about *all* the sources compiled together.

Numba's own cache watches only the file a function is written in. An integrator has the right-hand side of another file
compiled into it, so an edit there would go unnoticed. Here the cache folder is named by a hash of every source that
takes part: an edit anywhere compiles anew, and a stale function can never run. Where the sources are does not matter:
every copy of them shares what one has compiled.

The plant is always compiled (`compiler`). What a tick of detector, compensator and controller does (`step_compiler`) is
compiled where many ticks are run in one process. A node, which has a tenth of a second for each, leaves it to Python:
numba takes 130 MB and more than half a second of each process that loads it. Operations and their order are the same,
and so are the numbers, to the last bit.
"""

import os
import sys
from collections.abc import Callable
from functools import cache, update_wrapper
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, cast, get_args, get_origin, get_type_hints

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


@cache
def _numba() -> Any:
    """Load numba without scipy's linear algebra, a fifth of a plant's start.

    No function here needs it, and those of others, with `a @ b` or `np.linalg`, load it when they are compiled.
    """
    wanted = "scipy.linalg.cython_blas"
    is_there = wanted in sys.modules
    if not is_there:
        sys.modules[wanted] = None  # type: ignore[assignment]  # says that there is none
    try:
        import numba
        import numba.np.arraymath  # looks for it
    finally:
        if not is_there:
            del sys.modules[wanted]
    return numba


def _compiled(function: Any, folder: str) -> Any:
    numba = _numba()  # not in a node that can do without it
    config = numba.config
    previous = config.CACHE_DIR, getattr(config, "CACHE_LOCATOR_CLASSES", "")  # an old numba has a place for each path
    config.CACHE_DIR, config.CACHE_LOCATOR_CLASSES = folder, f"{__name__}.{Place.__name__}"
    try:
        # No entry for callers in C: there are none, and it costs a tenth of the time.
        options = {"cache": _takes_files(folder), "no_cfunc_wrapper": True, "_nrt": _counts_references(function)}
        return numba.njit(function, error_model="numpy", fastmath=False, **options)
    finally:
        config.CACHE_DIR, config.CACHE_LOCATOR_CLASSES = previous


_MAKE_ARRAYS = frozenset(("array", "copy", "empty", "empty_like", "full", "ones", "zeros", "zeros_like"))


def _counts_references(function: Any) -> bool:
    """Whether a function has to count the references to its arrays: if it makes, is given back or returns any.

    Others only borrow what their callers hold. Counting is an atomic operation for each array of each tuple that is
    handed on, and was a fifth of the time of a loop. A function that makes an array in a way that is not seen here does
    not compile without: numba says so.
    """
    names, known = function.__code__.co_names, function.__globals__
    modules = [known[name] for name in names if isinstance(known.get(name), ModuleType)]
    called = [known.get(name) for name in names] + [vars(module).get(name) for module in modules for name in names]
    steps = [getattr(one, "py_func", None) or getattr(one, "__wrapped__", None) for one in called]
    returned = [get_type_hints(one).get("return") for one in (function, *filter(None, steps))]
    return not _MAKE_ARRAYS.isdisjoint(names) or any(map(_holds_arrays, returned))


def _holds_arrays(kind: Any) -> bool:
    """Whether a type is one of arrays, or of tuples with such in them."""
    parts = (*get_args(kind), *getattr(kind, "__annotations__", {}).values())
    return get_origin(kind) in (np.ndarray, NDArray) or any(map(_holds_arrays, parts))


@cache
def _takes_files(folder: str) -> bool:
    """Whether there can be compiled code in a folder; where there cannot, it is made by every process."""
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)


class Place:
    """Where numba keeps a compiled function: in a folder that is named by its sources, wherever these are."""

    def __init__(self, folder: Path, line: int) -> None:
        self._folder, self._line = folder, line

    @classmethod
    def from_function(cls, function: FunctionType, _file: str) -> "Place":
        """Return the place of a function."""
        import numba

        return cls(Path(numba.config.CACHE_DIR) / function.__module__, function.__code__.co_firstlineno)

    def ensure_cache_path(self) -> None:
        """Make the folder."""
        self._folder.mkdir(parents=True, exist_ok=True)

    def get_cache_path(self) -> str:
        """Return the folder."""
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """Return what changes with the sources: nothing, since the folder does."""
        return ""

    def get_disambiguator(self) -> str:
        """Return what tells functions of one name apart."""
        return str(self._line)
