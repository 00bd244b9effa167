"""Small dense linear algebra in plain loops: for a dozen unknowns faster than a library, and the same everywhere."""

from ac_plant_node.properties.compiled import Array, jit


@jit
def solve(a: Array, n: int) -> None:
    """Solve the n x n system in the n x (n+1) array `a` in place (Gauss, partial pivoting); result in column n."""
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(k, n + 1):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
        inv = 1.0 / a[k, k]
        for i in range(k + 1, n):
            f = a[i, k] * inv
            if f != 0.0:
                for j in range(k + 1, n + 1):
                    a[i, j] -= f * a[k, j]
    for k in range(n - 1, -1, -1):
        b = a[k, n]
        for j in range(k + 1, n):
            b -= a[k, j] * a[j, n]
        a[k, n] = b / a[k, k]


@jit
def factor(a: Array, pivots: Array) -> bool:
    """LU factors of `a` in place, rows exchanged; False when singular."""
    n = a.shape[0]
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        pivots[k] = pivot
        if a[pivot, k] == 0.0:
            return False
        if pivot != k:
            for j in range(n):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
        inv = 1.0 / a[k, k]
        for i in range(k + 1, n):
            if a[i, k] != 0.0:
                a[i, k] *= inv
                f = a[i, k]
                for j in range(k + 1, n):
                    a[i, j] -= f * a[k, j]
    return True


@jit
def substitute(a: Array, pivots: Array, b: Array) -> None:
    """Solve for the right-hand side `b` in place, with the factors of `factor`."""
    n = a.shape[0]
    for k in range(n):
        p = int(pivots[k])
        if p != k:
            b[k], b[p] = b[p], b[k]
    for k in range(n):
        for i in range(k + 1, n):
            b[i] -= a[i, k] * b[k]
    for k in range(n - 1, -1, -1):
        v = b[k]
        for j in range(k + 1, n):
            v -= a[k, j] * b[j]
        b[k] = v / a[k, k]


@jit
def times(a: Array, b: Array, c: Array) -> None:
    """Matrix product a b in c."""
    for i in range(a.shape[0]):
        for j in range(a.shape[0]):
            c[i, j] = 0.0
        for m in range(a.shape[0]):
            f = a[i, m]
            for j in range(a.shape[0]):
                c[i, j] += f * b[m, j]


@jit
def copy_into(a: Array, b: Array) -> None:
    """Copy vector a into b, by a loop: whole-array statements take the compiler seconds."""
    for i in range(a.shape[0]):
        b[i] = a[i]
