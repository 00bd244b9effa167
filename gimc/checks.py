"""Checks of what comes from outside: one line says what was wrong, where, and what is allowed."""

import operator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gimc.systems import Matrix

SMALLEST_RTOL = 1e-12  # a few roundings; an iteration asked for less would not end
NEGATIVE = 1e-9  # eigenvalue of a covariance with ones on its diagonal that is rounding


def real_matrix(values: Any, what: str, name: str) -> Matrix:
    """Values as an array of finite real numbers."""
    try:
        array = np.asarray(values)
        numbers = array if array.dtype == np.float64 else array.astype(complex)
    except (TypeError, ValueError):
        raise ValueError(f"{what}: {name} must be numbers, is {type(values).__name__}") from None
    if not np.isfinite(numbers).all():
        raise ValueError(f"{what}: {name} has entries that are not finite")
    if np.iscomplexobj(array):
        raise ValueError(f"{what}: {name} has complex entries, must be real")
    return np.asarray(numbers.real)


def whole_number(what: str, value: Any, lowest: int, highest: int, kind: type[ValueError] = ValueError) -> int:
    """Return the value as an int from `lowest` to `highest`; a float or a bool is none."""
    try:
        number = operator.index(value)
    except TypeError:
        number = lowest - 1
    if isinstance(value, bool) or not lowest <= number <= highest:
        raise kind(f"{what} = {value!r}: must be a whole number from {lowest} to {highest}")
    return number


def positive(what: str, value: Any) -> float:
    """Return the value as a float, finite and above zero."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if not 0.0 < number < np.inf:
        raise ValueError(f"{what} = {value!r}: must be a finite positive number")
    return number


def relative_tolerance(value: Any, kind: type[ValueError] = ValueError, highest: float = 1.0) -> float:
    """Return the value as a float between `SMALLEST_RTOL` and `highest`."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if not SMALLEST_RTOL <= number <= highest:
        raise kind(f"rtol = {value!r}: must be between {SMALLEST_RTOL:g} and {highest:g}")
    return number


def matrix_of_shape(what: str, value: ArrayLike, rows: int, columns: int) -> Matrix:
    """Return the value as an array of finite real numbers with that shape."""
    array = real_matrix(value, what, "it")
    if array.shape != (rows, columns):
        raise ValueError(f"{what} has shape {array.shape}, must be {(rows, columns)}")
    return array


def sizes(what: str, value: ArrayLike | None, count: int) -> Matrix:
    """Return scales of `count` signals, ones if left out."""
    array = np.ones(count) if value is None else real_matrix(value, what, "it")
    if array.shape != (count,) or not (array > 0).all():
        raise ValueError(f"{what} = {value!r}: must be {count} positive numbers, one for each signal")
    return array


def intensity(what: str, value: ArrayLike, size: int, *, definite: bool) -> Matrix:
    """Return the intensity (covariance) of a noise, shape (size, size): a 1-D array is a diagonal.

    Raises
    ------
    ValueError
        If it is not symmetric, or not nonnegative definite (positive, if `definite`), whatever the units.
    """
    array = real_matrix(value, what, "it")
    array = np.diag(array) if array.ndim == 1 else array
    array = matrix_of_shape(what, array, size, size)
    diagonal = np.diag(array)
    units = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    relative = array / units[:, None] / units
    symmetric = np.abs(relative - relative.T).max(initial=0.0) <= 1e-6
    least = np.linalg.eigvalsh(0.5 * (relative + relative.T)).min(initial=1.0)
    if not symmetric or (diagonal < 0).any() or least < -NEGATIVE or (definite and least <= 0):
        wanted = "positive definite" if definite else "nonnegative definite"
        raise ValueError(f"{what} is no intensity of a noise: it must be symmetric and {wanted}")
    return array
