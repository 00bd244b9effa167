"""The product of a matrix and a vector in compiled code, summed in the same order on every machine."""

import numpy as np

from ac_common.compiled import Array, compiler

jit = compiler("ac_common.products")


def columns_of(matrix: Array) -> Array:
    """Return a matrix (m, n) as `multiply` takes it, column after column, (m n,)."""
    return np.ascontiguousarray(matrix.T).ravel()


@jit
def multiply(columns: Array, x: Array, out: Array) -> None:
    """Work out `out = M x` of the columns of M; `out` is none of the other two."""
    m = out.shape[0]
    for i in range(m):
        out[i] = 0.0
    for j in range(x.shape[0]):
        at, factor = j * m, x[j]
        for i in range(m):
            out[i] += columns[at + i] * factor
