"""Order reduction of stable systems: balanced truncation, residualisation, and minimal realisation."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from gimc.checks import relative_tolerance, sizes, whole_number
from gimc.errors import SynthesisError, UnstableError
from gimc.interconnect import Abcd, Matrix, abcd, add, scale, state_space
from gimc.norms import frequency_response, hinf_norm
from gimc.scaling import balance_states, normalise_signals


@dataclass(frozen=True)
class Reduction:
    """A reduced system and how good it is.

    Attributes
    ----------
    system : control.StateSpace
        The reduced system.
    hankel : ndarray, shape (n,)
        Hankel singular values of the full system, largest first (scaled signals where scales were given).
    order : int
        Order of the reduced system.
    bound : float
        Twice the sum of the neglected Hankel values: the error cannot exceed it (Glover 1984, Enns 1984).
    error : float
        H-infinity norm of full minus reduced, computed.
    norm : float
        H-infinity norm of the full system; `error / norm` is the relative error.
    """

    system: Any
    hankel: Matrix
    order: int
    bound: float
    error: float
    norm: float


def balanced_truncation(sys: Any, rtol: float = 1e-3) -> Any:
    """Reduced system with an H-infinity error of at most `rtol` times the norm of `sys`.

    Parameters
    ----------
    sys : control.StateSpace
        Stable.
    rtol : float
        The order is the smallest whose error bound keeps this.

    Returns
    -------
    control.StateSpace
        Stable, balanced, with the signal names of `sys`.

    Raises
    ------
    UnstableError
    """
    return reduce_order(sys, rtol=rtol).system


def reduce_order(
    sys: Any,
    *,
    rtol: float = 1e-3,
    order: int | None = None,
    keep_dc_gain: bool = False,
    input_scales: ArrayLike | None = None,
    output_scales: ArrayLike | None = None,
) -> Reduction:
    """Balanced truncation or balanced residualisation by the square-root method.

    Moore (IEEE TAC 26, 1981); square-root form of Tombs and Postlethwaite (Int. J. Control 46, 1987) on Gramian factors
    that are never squared, so small Hankel values keep their digits; residualisation: Liu and Anderson (Int. J. Control
    50, 1989).

    Parameters
    ----------
    sys : control.StateSpace
        Stable, order n.
    rtol : float
        Smallest order whose bound is at most `rtol` times the norm; not used when `order` is given.
    order : int, optional
        Order wanted.
    keep_dc_gain : bool
        Set the derivatives of the neglected states to zero (residualisation) instead of the states themselves: exact at
        DC.
    input_scales, output_scales : array_like, shapes (m,) and (p,), optional
        Sizes of the signals in the caller's units. Error, bound, norm and Hankel values then belong to
        `diag(1/output_scales) G diag(input_scales)`, in which mixed units count as they should; the system returned has
        the caller's units.

    Raises
    ------
    UnstableError
        If `sys` is not stable.
    ValueError
        If `order` is beyond that of the system, or `rtol` negative.
    SynthesisError
        If rounding keeps the error above `rtol` times the norm.
    """
    original = abcd(sys)
    y, u = (
        sizes(name, given, count)
        for name, given, count in zip(
            ("output_scales", "input_scales"), (output_scales, input_scales), original.D.shape, strict=True
        )
    )
    system = balance_states(scale(original, 1.0 / y, u))
    _require_stable(system, "balanced truncation needs")
    norm, _ = hinf_norm(system)
    balanced, hankel = _balance(system)
    tails = 2.0 * np.concatenate([np.cumsum(hankel[::-1])[::-1], [0.0]])  # tails[r]: bound for order r
    to_tolerance = order is None
    if order is None:
        if not rtol >= 0.0:
            raise ValueError(f"rtol = {rtol!r}: must not be negative")
        order = int(np.argmax(tails <= rtol * norm))
    else:
        order = whole_number("order", order, 0, system.A.shape[0])
    order = min(order, balanced.A.shape[0])
    reduced = (_residualised if keep_dc_gain else _truncated)(balanced, order)
    error, _ = hinf_norm(add(system, scale(reduced, -np.ones(y.size))))
    if to_tolerance and error > ((1.0 + 1e-3) * rtol + 1e-12) * norm:
        raise SynthesisError(
            f"reduction to rtol = {rtol:g}: order {order} has the error {error / norm:.3g} of the norm, though the "
            "Hankel values promise less: poles too near the axis for rounding; give an order, or a larger rtol"
        )
    result = state_space(scale(reduced, y, 1.0 / u), sys)
    return Reduction(result, hankel, order, float(tails[order]), error, norm)


def hankel_values(sys: Any) -> Matrix:
    """Return the Hankel singular values of a stable system, largest first, shape (n,).

    Raises
    ------
    UnstableError
    """
    system = balance_states(abcd(sys))
    _require_stable(system, "Hankel singular values need")
    return _balance(system)[1]


def minimal_realisation(sys: Any, *, rtol: float = 1e-10) -> Any:
    """Without states that the inputs do not reach or the outputs do not see; unstable systems too.

    Orthogonal staircase reduction (Van Dooren, IEEE TAC 26, 1981) of the state-balanced system with normalised signals,
    so that the rank decisions do not depend on the caller's units.

    Parameters
    ----------
    sys : control.StateSpace
    rtol : float
        A direction weaker than this, relative to the size of the system, is taken as absent; 1e-12 to 1.

    Raises
    ------
    SynthesisError
        If the response moves by more than `rtol`, or 1e-6, of an output's largest.
    """
    rtol = relative_tolerance(rtol)
    system = balance_states(abcd(sys))
    # Signals are normalised once: what is left of B or C after a projection counts against its first size.
    A, B, C, _ = normalise_signals(system)
    reach = _reachable_basis(A, B, rtol)
    observe = _reachable_basis(reach.T @ A.T @ reach, reach.T @ C.T, rtol)
    basis = reach @ observe
    minimal = _projected(system, basis, basis)
    if not _same_response(system, minimal, max(1e-6, rtol)):
        raise SynthesisError(
            "minimal realisation: the response does not stay the same, rank decisions at this rtol are not safe; give "
            "another rtol, or build the system with shared states (gimc.stack_inputs, gimc.stack_outputs)"
        )
    return state_space(minimal, sys)


def _same_response(system: Abcd, other: Abcd, rtol: float) -> bool:
    """Whether two systems agree around the poles of the second, every output relative to its largest response."""
    moduli = np.abs(np.linalg.eigvals(other.A)) if other.A.size else np.ones(1)
    w = np.concatenate([0.3 * moduli, 0.97 * moduli, 3.0 * moduli])
    G, H = frequency_response(system, w), frequency_response(other, w)
    finite = np.isfinite(G).all(axis=(1, 2))
    if not finite.any():
        return True
    size = np.abs(G[finite]).max(axis=(0, 2), keepdims=True)
    return bool((np.abs(H[finite] - G[finite]) <= rtol * size).all())


def gramian_factor(A: Matrix, B: Matrix) -> Matrix:
    """Real factor S of the Gramian, `X = S S'` with `A X + X A' + B B' = 0`, without ever forming X.

    Hammarling's method (IMA J. Numer. Anal. 2, 1982) on the complex Schur form, in the variant of Sorensen and Zhou
    (J. Appl. Math. 2003).

    Parameters
    ----------
    A : ndarray, shape (n, n)
        Stable.
    B : ndarray, shape (n, m)

    Returns
    -------
    ndarray, shape (n, n)
        Lower triangular.
    """
    n = A.shape[0]
    if n == 0:
        return np.zeros((0, 0))
    T, Z = scipy.linalg.schur(A, output="complex")
    right = Z.conj().T @ B
    U = np.zeros((n, n), dtype=complex)
    for k in range(n - 1, -1, -1):
        row = right[k]
        size = np.linalg.norm(row)
        if size == 0:
            continue
        root = np.sqrt(-2.0 * T[k, k].real)
        U[k, k] = size / root
        direction = row / size * root  # norm squared -2 Re(lambda)
        if k:
            shifted = T[:k, :k] + np.conj(T[k, k]) * np.eye(k)
            U[:k, k] = scipy.linalg.solve_triangular(shifted, -(T[:k, k] * U[k, k] + right[:k] @ direction.conj()))
            right[:k] -= np.outer(U[:k, k], direction)
    factor = Z @ U
    return np.asarray(np.linalg.qr(np.hstack([factor.real, factor.imag]).T, mode="r").T)


def _require_stable(system: Abcd, what: str) -> None:
    if system.A.size and np.linalg.eigvals(system.A).real.max() >= 0:
        raise UnstableError(f"{what} a stable system; split off the unstable part first")


def _balance(system: Abcd) -> tuple[Abcd, Matrix]:
    """Balanced realisation of the numerically minimal part, and all Hankel singular values."""
    reach = gramian_factor(system.A, system.B)
    observe = gramian_factor(system.A.T, system.C.T)
    U, hankel, Vt = np.linalg.svd(observe.T @ reach)
    keep = int(np.sum(hankel > 4.0 * hankel.size * np.finfo(float).eps * hankel[0])) if hankel.size else 0
    roots = np.sqrt(hankel[:keep])
    right = reach @ Vt[:keep].T / roots
    left = observe @ U[:, :keep] / roots
    return _projected(system, left, right), hankel


def _projected(system: Abcd, left: Matrix, right: Matrix) -> Abcd:
    return Abcd(left.T @ system.A @ right, left.T @ system.B, system.C @ right, system.D)


def _truncated(balanced: Abcd, order: int) -> Abcd:
    A, B, C, D = balanced
    return Abcd(A[:order, :order], B[:order], C[:, :order], D)


def _residualised(balanced: Abcd, order: int) -> Abcd:
    A, B, C, D = balanced
    fast = A[order:, order:]
    state, inputs = np.linalg.solve(fast, A[order:, :order]), np.linalg.solve(fast, B[order:])
    return Abcd(
        A[:order, :order] - A[:order, order:] @ state,
        B[:order] - A[:order, order:] @ inputs,
        C[:, :order] - C[:, order:] @ state,
        D - C[:, order:] @ inputs,
    )


def _reachable_basis(A: Matrix, B: Matrix, rtol: float) -> Matrix:
    """Orthonormal basis of the reachable subspace for B with columns of norm one (or less, where they were projected).

    Grown block by block, each from the part of `A block` outside it.
    """
    n = A.shape[0]
    basis = np.zeros((n, 0))
    block, size = B, 1.0
    while block.size and basis.shape[1] < n:
        for _ in range(2):  # twice is enough (Kahan)
            block = block - basis @ (basis.T @ block)
        U, s, _ = np.linalg.svd(block, full_matrices=False)
        fresh = U[:, s > rtol * size]
        if fresh.shape[1] == 0:
            break
        basis = np.hstack([basis, fresh])
        block, size = A @ fresh, float(np.linalg.norm(A, 2))
    return basis
