"""The product of a matrix and a vector, summed in the same order on every machine, compiled or not."""

import numpy as np

from ac_common.compiled import Array, step_compiler

_jit = step_compiler("ac_common.products")


def columns_of(matrix: Array) -> Array:
    """Return a matrix (m, n) as `multiply` takes it, column after column, (m n,)."""
    return np.ascontiguousarray(matrix.T).ravel()


def add_columns(columns: Array, x: Array, out: Array) -> None:
    """Do as `multiply`, bit for bit, by numpy."""
    # A sum may be reordered by numpy, an accumulation not; 0.0 is what the sum of `multiply` begins with.
    if out.size:
        out[:] = np.add.accumulate(columns.reshape(-1, len(out)) * x[:, np.newaxis], axis=0)[-1] + 0.0


def _multiply(columns: Array, x: Array, out: Array) -> None:
    """Work out `out = M x` of the columns of M, at least one; `out` is none of the other two."""
    m = out.shape[0]
    for i in range(m):
        out[i] = 0.0
    for j in range(x.shape[0]):
        at, factor = j * m, x[j]
        for i in range(m):
            out[i] += columns[at + i] * factor


multiply = _jit(_multiply, instead=add_columns)
