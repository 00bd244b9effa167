"""Results of long computations, kept on disk under the content that they depend on.

A key is everything that decides the result: parameters, weights, and the source text of the code that computes it.
A changed parameter or a changed line of code therefore makes a new key, and can never meet a stale result.
"""

import contextlib
import hashlib
import json
import os
import zipfile
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from platformdirs import user_cache_dir

from ac_common.arrays import Arrays
from ac_common.files import open_whole

__all__ = ["Arrays", "cache_folder", "cached", "compiled_folder", "fingerprint", "source_fingerprint"]


def cache_folder() -> Path:
    """Return the folder of the cache: `$ACFTC_CACHE_DIR`, or the user's cache folder of this system."""
    return Path(os.environ.get("ACFTC_CACHE_DIR") or user_cache_dir("acftc"))


def source_fingerprint(*packages: str) -> str:
    """Return a hash of the source text of `packages` (or single modules), without importing them.

    Files named `node.py` and `*_node.py` are left out: they only move messages.
    """
    digest = hashlib.sha256()
    for package in packages:
        spec = find_spec(package)
        if spec is None or spec.origin is None:
            raise ValueError(f"there is no package {package!r} to fingerprint")
        file = Path(spec.origin)
        for source in sorted(file.parent.rglob("*.py")) if spec.submodule_search_locations else [file]:
            if not source.stem.endswith("node"):
                digest.update(source.name.encode() + b"\0" + source.read_bytes() + b"\0")
    return digest.hexdigest()


def compiled_folder(*packages: str) -> Path:
    """Return the folder for the compiled code of `packages` (or modules): another one as soon as a source changes.

    So does a change of how it is compiled.
    """
    return cache_folder() / f"compiled-{source_fingerprint('ac_common.compiled', *packages)[:16]}"


def fingerprint(content: Mapping[str, Any]) -> str:
    """Return a hash of JSON-like `content`, independent of the order of its keys."""
    text = json.dumps(content, sort_keys=True, allow_nan=True)
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def cached(name: str, key: Mapping[str, Any], compute: Callable[[], Arrays]) -> Arrays:
    """Return the arrays that `compute` returns, from the disk when it has run for this `key` before.

    Parameters
    ----------
    name : str
        Start of the file's name, for people who look into the folder.
    key : mapping
        JSON-like content that decides the result.
    compute : callable
        Called without arguments when the cache has nothing; returns a dict of arrays (strings as 0-d arrays).

    Returns
    -------
    dict of str to ndarray
    """
    file = cache_folder() / f"{name}-{fingerprint(key)}.npz"
    found = _read(file)
    if found is None:
        found = compute()
        _write(file, found)
    return found


def _read(file: Path) -> Arrays | None:
    try:
        with np.load(file, allow_pickle=False) as stored:
            return dict(stored)
    except (OSError, ValueError, EOFError, zipfile.BadZipFile):
        return None  # absent, or cut short by a crash: computed again


def _write(file: Path, arrays: Arrays) -> None:
    """Store arrays: nodes that start together may all write, and none may read half a file."""
    with contextlib.suppress(OSError):  # a read-only or full disk costs time, not the result
        file.parent.mkdir(parents=True, exist_ok=True)
        with open_whole(file) as stream:
            np.savez(stream, **arrays)  # type: ignore[arg-type]
