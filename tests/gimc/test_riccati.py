"""Riccati solvers against scipy, closed forms and each other."""

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st
from synthesis_problems import random_system

from gimc import RiccatiError, care
from gimc.riccati import hinf_are, lyapunov


@given(st.integers(0, 10**6), st.integers(1, 10), st.integers(1, 3))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_definite_equation_is_scipys(seed: int, n: int, m: int) -> None:
    """The stabilising solution, which is unique, with a residual as small as scipy's: entries of 1e8 differ by more."""
    A, B, C, _ = random_system(seed, n, m, n)
    G, Q = B @ B.T, C.T @ C

    def residual(X: np.ndarray) -> float:
        terms = (A.T @ X, X @ A, -X @ G @ X, Q)
        return float(np.linalg.norm(sum(terms)) / sum(np.linalg.norm(term) for term in terms))

    X, theirs = care(A, G, Q), scipy.linalg.solve_continuous_are(A, B, Q, np.eye(m))
    assert residual(X) <= max(10.0 * residual(theirs), 1e-13)
    assert np.linalg.norm(X - theirs) <= 1e-4 * np.linalg.norm(theirs)
    assert np.linalg.eigvals(A - G @ X).real.max() < 0


@pytest.mark.parametrize("eps", [1e-2, 1e-6, 1e-10, 1e-14])
def test_badly_scaled_closed_form(eps: float) -> None:
    """CAREX-like: diag(a) with input gains eps and 1/eps, decoupled, so `x = (a + sqrt(a^2 + g q)) / g` each."""
    a, b, c = np.array([1.0, -2.0, 0.5]), np.array([eps, 1.0, 1 / eps]), np.array([1.0, 1 / eps, eps])
    X = care(np.diag(a), np.diag(b**2), np.diag(c**2))
    # The form without cancellation where a < 0.
    root = np.sqrt(a**2 + (b * c) ** 2)
    exact = np.array([(a[i] + root[i]) / b[i] ** 2 if a[i] > 0 else c[i] ** 2 / (root[i] - a[i]) for i in range(3)])
    np.testing.assert_allclose(np.diag(X), exact, rtol=1e-9)


@given(st.integers(0, 10**6), st.integers(1, 8))
@settings(max_examples=30, deadline=None, derandomize=True)
def test_hinf_equation(seed: int, n: int) -> None:
    """Residual, stability, and agreement of QZ and Schur, at a level that is feasible for stable plants."""
    A, B, C, D = random_system(seed, n, 4, 5, stable=True)
    D = D.copy()
    D[:, 2:] = np.linalg.qr(D[:, 2:])[0]
    gamma = 50.0 * max(np.linalg.norm(D, 2), np.abs(C @ np.linalg.solve(A, B)).max(), 1.0)
    X = hinf_are(A, B, C, D, 2, gamma)
    R = D.T @ D - np.diag([gamma**2, gamma**2, 0, 0])
    S = X @ B + C.T @ D
    residual = A.T @ X + X @ A + C.T @ C - S @ np.linalg.solve(R, S.T)
    assert np.abs(residual).max() < 1e-7 * max(np.abs(C.T @ C).max(), np.abs(X).max() * np.abs(A).max())
    assert np.linalg.eigvals(A - B @ np.linalg.solve(R, S.T)).real.max() < 0
    cross = np.linalg.solve(R, D.T @ C)
    schur = care(A - B @ cross, B @ np.linalg.solve(R, B.T), C.T @ C - C.T @ D @ cross)
    np.testing.assert_allclose(X, schur, rtol=1e-6, atol=1e-7 * np.abs(schur).max())


def test_tiny_control_penalty_keeps_digits() -> None:
    """`z = [x, rho u]` on an integrator: X = rho. The closed loop's pole is -1/rho: known to eps / rho^2 relative."""
    for rho in (1.0, 1e-3, 1e-6):
        C, D = np.array([[1.0], [0.0]]), np.array([[0.0, 0.0], [0.0, rho]])
        X = hinf_are(np.zeros((1, 1)), np.array([[0.0, 1.0]]), C, D, 1, 1e3)
        assert X[0, 0] == pytest.approx(rho, rel=1e-12 + 1e-15 / rho**2)


def test_eigenvalues_on_the_axis_are_refused() -> None:
    one = np.eye(1)
    with pytest.raises(RiccatiError, match="imaginary axis"):
        care(0 * one, one, -one)
    with pytest.raises(RiccatiError, match="imaginary axis"):  # gain 1 of 1/(s+1) at level 0.5
        hinf_are(-one, np.array([[1.0, 0.0]]), np.array([[1.0], [0]]), np.array([[0, 0], [0, 1.0]]), 1, 0.5)


def test_empty() -> None:
    empty = np.zeros((0, 0))
    assert care(empty, empty, empty).shape == (0, 0)


@pytest.mark.parametrize("seed", range(10))
def test_lyapunov(seed: int) -> None:
    random = np.random.default_rng(seed)
    A, Q = random.normal(size=(5, 5)) - 4 * np.eye(5), random.normal(size=(5, 5))
    X = lyapunov(A, Q)
    np.testing.assert_allclose(A @ X + X @ A.T, -0.5 * (Q + Q.T), atol=1e-12)


def test_lyapunov_without_a_solution() -> None:
    with pytest.raises(RiccatiError, match="no solution"):
        lyapunov(np.diag([1.0, -1.0]), np.ones((2, 2)))
