"""Arrays by name, and arrays that were written to a file and come back."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Arrays = dict[str, NDArray[Any]]


def same_shape(values: Any, like: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return remembered values as an array; ValueError when its shape is not that of `like`."""
    array = np.asarray(values, dtype=np.float64)
    if array.shape != like.shape:
        raise ValueError(f"{array.shape} instead of {like.shape} numbers")
    return array
