"""State-space realisations: conversion, stacking, interconnection.

python-control's own arithmetic is sound but realises every operand anew; the functions here share states where blocks
share them, which keeps the order of a generalised plant (and so of the controller that is designed from it) at what the
physics needs.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike

from gimc.checks import matrix_of_shape, real_matrix, whole_number
from gimc.errors import IllPosedError, SynthesisError
from gimc.realisation import realise
from gimc.systems import Abcd, Matrix, Response, in_series

__all__ = [
    "Abcd",
    "Matrix",
    "Response",
    "abcd",
    "add",
    "append",
    "block_diagonal",
    "block_sizes",
    "connect",
    "equilibrated",
    "generalised_plant",
    "inverse",
    "lft",
    "safe_inverse",
    "scale",
    "series",
    "stack_inputs",
    "stack_outputs",
    "state_space",
]


def abcd(sys: Any, *, what: str = "system") -> Abcd:
    """Matrices of a continuous-time system.

    Parameters
    ----------
    sys : control.StateSpace, control.TransferFunction, Abcd or array_like
        A matrix or number is a static gain; an `Abcd` is returned as it is.
    what : str
        Name of the system in error messages.

    Raises
    ------
    ValueError
        If it is a discrete-time system, a frequency response, or no system at all; if the shapes of its matrices do not
        fit; or if an entry is complex or not finite.
    """
    if isinstance(sys, control.StateSpace | control.TransferFunction) and sys.dt not in (0, None):
        raise ValueError(f"{what}: a continuous-time system is needed, this one is sampled with dt = {sys.dt}")
    if isinstance(sys, control.TransferFunction):
        return _realised(sys, what)
    if isinstance(sys, Abcd):
        return _checked(sys, what)
    if isinstance(sys, control.StateSpace):
        return _checked(Abcd(*(np.array(matrix) for matrix in (sys.A, sys.B, sys.C, sys.D))), what)
    if isinstance(sys, control.InputOutputSystem):
        raise ValueError(f"{what}: {type(sys).__name__} has no state-space matrices; give a StateSpace")
    gain = real_matrix(sys, what, "a gain")
    if gain.ndim > 2:
        raise ValueError(f"{what}: a gain has {gain.ndim} dimensions, must have at most 2: outputs by inputs")
    gain = np.atleast_2d(gain)
    return Abcd(np.zeros((0, 0)), np.zeros((0, gain.shape[1])), np.zeros((gain.shape[0], 0)), gain)


def _checked(system: Abcd, what: str) -> Abcd:
    """The same system, its matrices real, finite and of shapes that fit."""
    matrices = Abcd(*(real_matrix(matrix, what, name) for name, matrix in zip("ABCD", system, strict=True)))
    shapes = [matrix.shape for matrix in matrices]
    n, (p, m) = len(matrices.A) if matrices.A.ndim else 0, (*matrices.D.shape, 0, 0)[:2]
    if shapes != [(n, n), (n, m), (p, n), (p, m)]:
        found = ", ".join(map(str, shapes))
        raise ValueError(f"{what}: A, B, C, D have shapes {found}, must have (n, n), (n, m), (p, n), (p, m)")
    return matrices


def _realised(sys: Any, what: str) -> Abcd:
    """Realisation of a transfer matrix element by element (not minimal: see `gimc.minimal_realisation`)."""
    rows = [
        [realise(sys.num[i][j], sys.den[i][j], f"{what}, element {i}, {j}") for j in range(sys.ninputs)]
        for i in range(sys.noutputs)
    ]
    return rows[0][0] if sys.issiso() else generalised_plant(rows)


def state_space(matrices: Sequence[ArrayLike], like: Any = None, *, inputs: Any = None, outputs: Any = None) -> Any:
    """`control.StateSpace` of (A, B, C, D); signal names are those of `like` where given and of the same number."""
    A, B, C, D = (np.asarray(matrix, dtype=float) for matrix in matrices)
    if isinstance(like, control.StateSpace):
        inputs = like.input_labels if inputs is None and like.ninputs == D.shape[1] else inputs
        outputs = like.output_labels if outputs is None and like.noutputs == D.shape[0] else outputs
    return control.StateSpace(A, B, C, D, inputs=inputs, outputs=outputs, remove_useless_states=False)


def block_diagonal(*matrices: Matrix) -> Matrix:
    """Block-diagonal matrix; blocks may be empty in one or both directions."""
    rows, columns = (sum(matrix.shape[axis] for matrix in matrices) for axis in (0, 1))
    result = np.zeros((rows, columns))
    row = column = 0
    for matrix in matrices:
        result[row : row + matrix.shape[0], column : column + matrix.shape[1]] = matrix
        row, column = row + matrix.shape[0], column + matrix.shape[1]
    return result


def append(*systems: Any) -> Abcd:
    """Block-diagonal system: all inputs, all outputs, all states side by side."""
    parts = [abcd(system) for system in systems]
    return Abcd(*(block_diagonal(*(part[i] for part in parts)) for i in range(4)))


def stack_inputs(*systems: Any) -> Abcd:
    """`[G1 G2 ...]`: inputs side by side, outputs added. Systems with equal A and C share their states."""
    parts = [abcd(system) for system in systems]
    _same("outputs", [part.D.shape[0] for part in parts])
    first = parts[0]
    if all(np.array_equal(part.A, first.A) and np.array_equal(part.C, first.C) for part in parts):
        B, D = (np.hstack([part[i] for part in parts]) for i in (1, 3))
        return Abcd(first.A, B, first.C, D)
    A, B, _, _ = append(*parts)
    return Abcd(A, B, np.hstack([part.C for part in parts]), np.hstack([part.D for part in parts]))


def stack_outputs(*systems: Any) -> Abcd:
    """`[G1; G2; ...]`: outputs one above the other, one common input. Systems with equal A and B share their states."""
    return _transposed(stack_inputs(*(_transposed(abcd(system)) for system in systems)))


def series(*systems: Any) -> Abcd:
    """`G1 G2 ... Gk`: the product in the order written, so the last one acts first."""
    parts = [abcd(system) for system in systems]
    for left, right in pairwise(parts):
        _same("outputs of the right factor, inputs of the left one", [right.D.shape[0], left.D.shape[1]])
    return in_series(*parts)


def add(*systems: Any) -> Abcd:
    """`G1 + G2 + ...`; systems with equal A and C share their states."""
    parts = [abcd(system) for system in systems]
    stacked = stack_inputs(*parts)
    identity = np.vstack([np.eye(part.D.shape[1]) for part in parts])
    return Abcd(stacked.A, stacked.B @ identity, stacked.C, stacked.D @ identity)


def scale(sys: Any, left: ArrayLike | None = None, right: ArrayLike | None = None) -> Abcd:
    """`left G right` with constant matrices; a 1-D array is a diagonal."""
    A, B, C, D = abcd(sys)
    if left is not None:
        gain = _as_matrix(left)
        gain = matrix_of_shape("scale: left", gain, gain.shape[0], D.shape[0])
        C, D = gain @ C, gain @ D
    if right is not None:
        gain = _as_matrix(right)
        gain = matrix_of_shape("scale: right", gain, D.shape[1], gain.shape[1])
        B, D = B @ gain, D @ gain
    return Abcd(A, B, C, D)


def inverse(sys: Any) -> Abcd:
    """`G^-1` of a square system with invertible D."""
    A, B, C, D = abcd(sys)
    Di = safe_inverse(D, "D of the system to invert")
    return Abcd(A - B @ Di @ C, B @ Di, -Di @ C, Di)


def connect(
    sys: Any, feedback: ArrayLike, inputs: ArrayLike, outputs: ArrayLike, through: ArrayLike | None = None
) -> Abcd:
    """Close loops around a system: `v = feedback y + inputs w`, `z = outputs y + through w`, with `y = G v`.

    With `append` this states any interconnection: put the blocks side by side, write which output feeds which input.

    Parameters
    ----------
    sys : system with m inputs v and p outputs y
    feedback : array_like, shape (m, p)
    inputs : array_like, shape (m, number of w)
    outputs : array_like, shape (number of z, p)
    through : array_like, shape (number of z, number of w), optional

    Raises
    ------
    IllPosedError
        If the algebraic loop has no solution.
    ValueError
        If a matrix has another shape.
    """
    A, B, C, D = abcd(sys)
    p, m = D.shape
    F = matrix_of_shape("connect: feedback", np.atleast_2d(np.asarray(feedback)), m, p)
    E = np.atleast_2d(real_matrix(inputs, "connect", "inputs"))
    G = np.atleast_2d(real_matrix(outputs, "connect", "outputs"))
    E = matrix_of_shape("connect: inputs", E, m, E.shape[1])
    G = matrix_of_shape("connect: outputs", G, G.shape[0], p)
    zero = np.zeros((G.shape[0], E.shape[1]))
    H = zero if through is None else matrix_of_shape("connect: through", np.asarray(through), *zero.shape)
    loop = safe_inverse(np.eye(D.shape[0]) - D @ F, "I - D F of the interconnection")
    Cc, Dc = loop @ C, loop @ D @ E  # y = Cc x + Dc w
    return Abcd(A + B @ F @ Cc, B @ (E + F @ Dc), G @ Cc, G @ Dc + H)


def lft(P: Any, K: Any, nmeas: int, ncon: int) -> Abcd:
    """Lower linear fractional transformation: `z = (P11 + P12 K (I - P22 K)^-1 P21) w`.

    Raises
    ------
    IllPosedError
        If `I - D22 D_K` is singular.
    ValueError
        If K does not have `nmeas` inputs and `ncon` outputs, or P fewer.
    """
    A, B, C, D = abcd(P)
    Ak, Bk, Ck, Dk = abcd(K)
    if Dk.shape != (ncon, nmeas) or D.shape[0] < nmeas or D.shape[1] < ncon:
        raise ValueError(
            f"lft: K has shape {Dk.shape}, must be {(ncon, nmeas)}: control inputs by measurements, taken from a plant "
            f"of shape {D.shape}"
        )
    p1, m1 = D.shape[0] - nmeas, D.shape[1] - ncon
    B1, B2, C1, C2 = B[:, :m1], B[:, m1:], C[:p1], C[p1:]
    D11, D12, D21, D22 = D[:p1, :m1], D[:p1, m1:], D[p1:, :m1], D[p1:, m1:]
    E = safe_inverse(np.eye(nmeas) - D22 @ Dk, "I - D22 D_K")
    # y = E (C2 x + D21 w + D22 Ck xk), u = Ck xk + Dk y
    yx, yk, yw = E @ C2, E @ D22 @ Ck, E @ D21
    ux, uk, uw = Dk @ yx, Ck + Dk @ yk, Dk @ yw
    Acl = np.block([[A + B2 @ ux, B2 @ uk], [Bk @ yx, Ak + Bk @ yk]])
    Bcl = np.vstack([B1 + B2 @ uw, Bk @ yw])
    return Abcd(Acl, Bcl, np.hstack([C1 + D12 @ ux, D12 @ uk]), D11 + D12 @ uw)


def generalised_plant(blocks: Sequence[Sequence[Any]]) -> Abcd:
    """Block matrix of transfer functions; blocks of a row with equal (A, C) share states, rows with equal (A, B) too.

    `None` is not allowed as a block: write a zero matrix of the right shape, which costs no state.
    """
    return stack_outputs(*(stack_inputs(*row) for row in blocks))


def block_sizes(P: Abcd, nmeas: Any, ncon: Any) -> tuple[int, int]:
    """Return the numbers of measurements and control inputs of a generalised plant as integers.

    Raises
    ------
    SynthesisError
        If either is no whole number, or leaves no z or no w.
    """
    p, m = P.D.shape
    if min(p, m) < 2:
        raise SynthesisError(f"generalised plant of shape {P.D.shape}: must have inputs [w, u] and outputs [z, y]")
    return (
        whole_number("nmeas", nmeas, 1, p - 1, SynthesisError),
        whole_number("ncon", ncon, 1, m - 1, SynthesisError),
    )


def _transposed(sys: Abcd) -> Abcd:
    return Abcd(sys.A.T, sys.C.T, sys.B.T, sys.D.T)


def _as_matrix(gain: ArrayLike) -> Matrix:
    array = np.asarray(gain, dtype=float)
    return np.diag(array) if array.ndim == 1 else np.atleast_2d(array)


def safe_inverse(matrix: Matrix, what: str) -> Matrix:
    """Inverse, or an `IllPosedError` that calls the matrix by its name."""
    if matrix.size and np.linalg.cond(equilibrated(matrix)) > 1e12:
        raise IllPosedError(f"{what} is singular (condition number {np.linalg.cond(matrix):.1e})")
    return np.linalg.inv(matrix)


def equilibrated(matrix: Any, *, block: int = 0) -> Any:
    """Return the matrix with rows and columns scaled to a largest entry of one, so that mixed units do not matter.

    Ruiz (2001). The last `block` rows share one factor.
    """
    scaled = matrix
    first = matrix.shape[0] - block
    for _ in range(20):
        rows = np.abs(scaled).max(axis=1, keepdims=True)
        rows[first:] = rows[first:].max(initial=0.0)
        scaled = scaled / np.sqrt(np.where(rows > 0, rows, 1.0))
        columns = np.abs(scaled).max(axis=0, keepdims=True)
        scaled = scaled / np.sqrt(np.where(columns > 0, columns, 1.0))
    return scaled


def _same(what: str, numbers: Sequence[int]) -> None:
    if len(set(numbers)) != 1:
        raise ValueError(f"{what}: numbers differ, {list(numbers)}")
