"""Continuous-time algebraic Riccati equation by ordered Schur form, for definite and indefinite quadratic terms."""

import warnings

import numpy as np
import scipy.linalg

from gimc.errors import RiccatiError
from gimc.interconnect import Matrix


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
    """
    n = A.shape[0]
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


def _symplectic_scales(hamiltonian: Matrix, n: int) -> Matrix:
    """Scales d with `x = d * x_s`, costate `p = p_s / d`, from a general balancing of the moduli."""
    moduli = np.abs(hamiltonian)
    np.fill_diagonal(moduli, 0.0)
    _, (scales, _) = scipy.linalg.matrix_balance(moduli, separate=True, permute=False)
    exponents = np.log2(scales)
    return np.asarray(2.0 ** np.round(0.5 * (exponents[:n] - exponents[n:])))


def _stable_graph(A: Matrix, G: Matrix, Q: Matrix) -> Matrix:
    """X whose graph [I; X] spans the stable subspace of the Hamiltonian."""
    n = A.shape[0]
    hamiltonian = np.block([[A, -G], [-Q, -A.T]])
    try:
        _, vectors, stable = scipy.linalg.schur(hamiltonian, output="real", sort="lhp")
    except np.linalg.LinAlgError as error:
        raise RiccatiError(f"eigenvalues of the Hamiltonian could not be ordered: {error}") from None
    if stable != n:
        raise RiccatiError("the Hamiltonian has eigenvalues on the imaginary axis")
    X1, X2 = vectors[:n, :n], vectors[n:, :n]
    # A pair on the axis may fall apart into one on either side; the subspace is then not isotropic.
    skew = X1.T @ X2
    if np.linalg.norm(skew - skew.T) > 1e-6:
        raise RiccatiError("the Hamiltonian has eigenvalues on the imaginary axis")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", scipy.linalg.LinAlgWarning)  # judged by what comes out, next
        try:
            X = scipy.linalg.solve(X1.T, X2.T)
        except np.linalg.LinAlgError:
            raise RiccatiError("the stable subspace of the Hamiltonian is no graph: X grows without bound") from None
    X = 0.5 * (X + X.T)
    if not np.isfinite(X).all() or (np.linalg.eigvals(A - G @ X).real >= 0).any():
        raise RiccatiError("the stable subspace of the Hamiltonian is no graph: X grows without bound")
    return np.asarray(X)


def _newton_step(A: Matrix, G: Matrix, Q: Matrix, X: Matrix) -> Matrix:
    """One step of Newton's method, kept only if the residual falls (it has nothing to give at rounding level)."""
    residual = _residual(A, G, Q, X)
    closed = A - G @ X
    try:
        step = scipy.linalg.solve_continuous_lyapunov(closed.T, -residual)
    except (np.linalg.LinAlgError, RuntimeWarning):
        return X
    improved = X + 0.5 * (step + step.T)
    better = np.linalg.norm(_residual(A, G, Q, improved)) < np.linalg.norm(residual)
    return improved if better else X


def _residual(A: Matrix, G: Matrix, Q: Matrix, X: Matrix) -> Matrix:
    residual = A.T @ X + X @ A - X @ G @ X + Q
    return np.asarray(0.5 * (residual + residual.T))
