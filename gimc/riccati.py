"""Algebraic Riccati equations in continuous time: by ordered Schur form, and by ordered QZ form for H-infinity."""

import warnings

import numpy as np
import scipy.linalg

from gimc.checks import matrix_of_shape
from gimc.errors import RiccatiError
from gimc.interconnect import Matrix

ROUNDING = 1e-6  # of products of orthonormal vectors, where slow and fast poles are eight decades apart


def care(A: Matrix, G: Matrix, Q: Matrix, *, refine: bool = True) -> Matrix:
    """Stabilising solution X of `A' X + X A - X G X + Q = 0`, so that `A - G X` is stable.

    Laub's Schur method (IEEE TAC 24, 1979) on the symplectically balanced Hamiltonian, followed by one Newton step.

    Parameters
    ----------
    A, G, Q : ndarray, shape (n, n)
        G and Q symmetric, of any sign (G is indefinite in H-infinity problems).
    refine : bool
        Do the Newton step.

    Raises
    ------
    RiccatiError
        If the Hamiltonian has eigenvalues on the imaginary axis, or its stable subspace is no graph.
    ValueError
        If a matrix has another shape or entries that are not finite.
    """
    n = len(A)
    A, G, Q = (matrix_of_shape(f"care: {name}", value, n, n) for name, value in (("A", A), ("G", G), ("Q", Q)))
    if n == 0:
        return np.zeros((0, 0))
    error = RiccatiError("no scaling tried")
    # Balancing helps stiff problems, and harms those with directions that only rounding connects.
    for d in (_symplectic_scales(np.block([[A, -G], [-Q, -A.T]]), n), np.ones(n)):
        As, Gs, Qs = A * d / d[:, None], G / d / d[:, None], Q * d * d[:, None]
        try:
            Xs = _stable_graph(As, Gs, Qs)
        except RiccatiError as failure:
            error = failure
            continue
        if refine:
            Xs = _newton_step(As, Gs, Qs, Xs)
        return np.asarray(Xs / d / d[:, None])
    raise error


def hinf_are(A: Matrix, B: Matrix, C: Matrix, D: Matrix, m1: int, gamma: float, *, balanced: bool = True) -> Matrix:
    """Stabilising solution X of the H-infinity Riccati equation of the plant `z = C x + D v` at level gamma.

    `A'X + XA + C'C - (XB + C'D) R^-1 (XB + C'D)' = 0` with `R = D'D - gamma^2 diag(I, 0)`: the first m1 entries of v
    are disturbances, the others controls. From the deflating subspace of the extended pencil in (x, costate, v, z):
    Van Dooren (SIAM J. Sci. Stat. Comput. 2, 1981), for H-infinity Benner, Byers, Mehrmann and Xu (Linear Algebra
    Appl. 425, 2007). R is not inverted and no product of B or C formed, so that a tiny control penalty or measurement
    noise costs few digits.

    Raises
    ------
    RiccatiError
    """
    n, m, p = A.shape[0], B.shape[1], C.shape[0]
    if n == 0:
        return np.zeros((0, 0))
    weight = np.where(np.arange(m) < m1, gamma**2, 0.0)
    direct = np.sqrt((D**2).sum(axis=0) + weight)
    sizes = _moduli(A, B / np.where(direct > 0, direct, 1.0), C)
    d = _symplectic_scales(sizes, n) if balanced else np.ones(n)
    A, B, C = A * d / d[:, None], B / d[:, None], C * d
    size = np.sqrt((B**2).sum(axis=0) + (D**2).sum(axis=0) + weight)
    scales = 1.0 / np.where(size > 0, size, 1.0)  # of v: changes neither x nor the costate
    Bs, Ds = B * scales, D * scales
    # Columns v, z and columns x, costate of: x' = Ax + Bv, -costate' = A'costate + C'z, z = Cx + Dv, and optimal v.
    # Filled, not stacked: numpy.block would take as long as the decompositions.
    algebraic, dynamic = np.zeros((2 * n + p + m, m + p)), np.zeros((2 * n + p + m, 2 * n))
    algebraic[:n, :m], algebraic[n : 2 * n, m:] = Bs, -C.T
    algebraic[2 * n : 2 * n + p, :m], algebraic[2 * n : 2 * n + p, m:] = Ds, -np.eye(p)
    algebraic[2 * n + p :, :m], algebraic[2 * n + p :, m:] = -np.diag(weight * scales**2), Ds.T
    dynamic[:n, :n], dynamic[n : 2 * n, n:] = A, -A.T
    dynamic[2 * n : 2 * n + p, :n], dynamic[2 * n + p :, n:] = C, Bs.T
    left = np.linalg.qr(algebraic, mode="complete")[0][:, m + p :].T
    try:
        *_, alpha, beta, _, Z = scipy.linalg.ordqz(left @ dynamic, left[:, : 2 * n], sort="lhp", output="real")
    except (np.linalg.LinAlgError, ValueError) as error:
        raise RiccatiError(f"eigenvalues of the extended pencil could not be ordered: {error}") from None
    # Signs by the product: a quotient would overflow for eigenvalues near infinity.
    if int(((alpha * beta).real < 0).sum()) != n:
        raise RiccatiError("the extended pencil has eigenvalues on the imaginary axis")
    X = _graph(Z[:n, :n], Z[n:, :n], asymmetry=1e-3)
    return np.asarray(X / d / d[:, None])


def _moduli(A: Matrix, B: Matrix, C: Matrix) -> Matrix:
    """Sizes of the Hamiltonian's entries, for inputs of size one."""
    B, C = np.abs(B), np.abs(C)
    return np.block([[np.abs(A), B @ B.T], [C.T @ C, np.abs(A.T)]])


def _symplectic_scales(hamiltonian: Matrix, n: int) -> Matrix:
    """Scales d with `x = d * x_s`, costate `p = p_s / d`, from a general balancing of the moduli."""
    moduli = np.abs(hamiltonian)
    np.fill_diagonal(moduli, 0.0)
    # LAPACK itself: scipy's matrix_balance casts the scales to integers on its way, and large ones overflow.
    scales = scipy.linalg.lapack.dgebal(moduli, scale=1, permute=0)[3]
    exponents = np.log2(scales)
    return np.asarray(2.0 ** np.round(0.5 * (exponents[:n] - exponents[n:])))


def _stable_graph(A: Matrix, G: Matrix, Q: Matrix) -> Matrix:
    """X whose graph [I; X] spans the stable subspace of the Hamiltonian."""
    n = A.shape[0]
    hamiltonian = np.block([[A, -G], [-Q, -A.T]])
    try:
        _, vectors, stable = scipy.linalg.schur(hamiltonian, output="real", sort="lhp")
    except np.linalg.LinAlgError as error:
        raise RiccatiError(f"the Hamiltonian's eigenvalues could not be ordered: {error}") from None
    if stable != n:
        raise RiccatiError("the Hamiltonian has eigenvalues on the imaginary axis")
    X = _graph(vectors[:n, :n], vectors[n:, :n], asymmetry=1e-6)
    if (np.linalg.eigvals(A - G @ X).real >= 0).any():
        raise RiccatiError("the stable subspace of the Hamiltonian is no graph: X grows without bound")
    return X


def _graph(X1: Matrix, X2: Matrix, *, asymmetry: float) -> Matrix:
    """Symmetric X with the subspace [X1; X2] (orthonormal columns) as its graph."""
    # A pair on the axis may fall apart into one on either side; the subspace is then not isotropic. Asked of every two
    # vectors: beside large ones a small one that is wrong would not be seen.
    skew = X1.T @ X2
    states, costates = np.linalg.norm(X1, axis=0), np.linalg.norm(X2, axis=0)
    sizes = np.outer(states, costates) + np.outer(costates, states)
    if (np.abs(skew - skew.T) > asymmetry * sizes + ROUNDING).any():
        raise RiccatiError("there are eigenvalues on the imaginary axis")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", scipy.linalg.LinAlgWarning)  # judged by what comes out
        try:
            X = scipy.linalg.solve(X1.T, X2.T)
        except np.linalg.LinAlgError:
            raise RiccatiError("the stable subspace is no graph: X grows without bound") from None
    if not np.isfinite(X).all():
        raise RiccatiError("the stable subspace is no graph: X grows without bound")
    return np.asarray(0.5 * (X + X.T))


def lyapunov(A: Matrix, Q: Matrix) -> Matrix:
    """Return the symmetric solution X of `A X + X A' + Q = 0`; of Q the symmetric part counts.

    Raises
    ------
    RiccatiError
        If two eigenvalues of A add up to zero, or nearly so.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)  # what scipy does instead of failing
        try:
            X = scipy.linalg.solve_continuous_lyapunov(A, -0.5 * (Q + Q.T))
        except (np.linalg.LinAlgError, RuntimeWarning) as error:
            raise RiccatiError(f"the Lyapunov equation has no solution: {error}") from None
    return np.asarray(0.5 * (X + X.T))


def _newton_step(A: Matrix, G: Matrix, Q: Matrix, X: Matrix) -> Matrix:
    """One step of Newton's method, kept only if the residual falls (it has nothing to give at rounding level)."""
    residual = _residual(A, G, Q, X)
    try:
        improved = X + lyapunov((A - G @ X).T, residual)
    except RiccatiError:
        return X
    better = np.linalg.norm(_residual(A, G, Q, improved)) < np.linalg.norm(residual)
    return improved if better else X


def _residual(A: Matrix, G: Matrix, Q: Matrix, X: Matrix) -> Matrix:
    residual = A.T @ X + X @ A - X @ G @ X + Q
    return np.asarray(0.5 * (residual + residual.T))
