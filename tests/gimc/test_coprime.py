"""Left coprime factorisation: the identity on a grid, normalisation, coprimeness, signs, errors."""

import control
import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st
from synthesis_problems import random_system, stiff_plant

import gimc
from gimc import Abcd, abcd, coprime_factor, filter_gain, frequency_response, is_stable, lcf

GRID = np.concatenate([[0.0], np.logspace(-4, 4, 60)])


def assert_factors(system: object, M: object, N: object, rtol: float = 1e-7) -> None:
    """`M^-1 N = P` at every frequency, judged row by row, and both factors stable."""
    assert is_stable(M)
    assert is_stable(N)
    G = frequency_response(system, GRID)
    quotient = np.linalg.solve(frequency_response(M, GRID), frequency_response(N, GRID))
    size = np.abs(G).max(axis=0, keepdims=True)
    assert (np.abs(quotient - G) <= rtol * size + 1e-12).all()


@given(st.integers(0, 10**6), st.integers(1, 8), st.integers(1, 3), st.integers(1, 3))
@settings(max_examples=30, deadline=None, derandomize=True)
def test_factors_of_any_system(seed: int, n: int, m: int, p: int) -> None:
    """Unstable systems with direct terms: the identity, and `M M* + N N* = I` for the normalised factors."""
    system = random_system(seed, n, m, p)
    assert_factors(system, *lcf(system))
    M, N = lcf(system, normalised=True)
    assert_factors(system, M, N)
    Mj, Nj = frequency_response(M, GRID), frequency_response(N, GRID)
    gram = Mj @ Mj.conj().transpose(0, 2, 1) + Nj @ Nj.conj().transpose(0, 2, 1)
    np.testing.assert_allclose(gram, np.broadcast_to(np.eye(p), gram.shape), atol=1e-8)


def test_coprime_bezout() -> None:
    """No common zero in the closed right half plane: [M N] has full row rank at the poles of the plant, too."""
    system = random_system(4, 6, 2, 3)
    M, N = (abcd(factor) for factor in lcf(system))
    for s in np.concatenate([np.linalg.eigvals(system.A), 1j * GRID]):
        at = [F.D + F.C @ np.linalg.solve(s * np.eye(6) - F.A, F.B) for F in (M, N)]
        assert np.linalg.svd(np.hstack(at), compute_uv=False)[-1] > 1e-6


def test_matrices_are_those_of_lemma_1() -> None:
    system = random_system(7, 4, 2, 3)
    L = filter_gain(system)
    M, N = lcf(system, L)
    np.testing.assert_array_equal(M.A, system.A + L @ system.C)
    np.testing.assert_array_equal(M.B, L)
    np.testing.assert_array_equal(M.C, system.C)
    np.testing.assert_array_equal(M.D, np.eye(3))
    np.testing.assert_array_equal(N.B, system.B + L @ system.D)
    np.testing.assert_array_equal(N.D, system.D)
    E1, E2 = np.ones((4, 1)), 2 * np.ones((3, 1))
    Nd = coprime_factor(system, L, E1, E2)
    np.testing.assert_array_equal(Nd.B, E1 + L @ E2)
    np.testing.assert_array_equal(Nd.D, E2)


def test_an_input_that_enters_one_equation_only() -> None:
    system, E = random_system(3, 4, 2, 2), np.ones((4, 1))
    L = filter_gain(system)
    only_state, only_output = coprime_factor(system, L, E), coprime_factor(system, L, E2=np.ones((2, 1)))
    np.testing.assert_array_equal(only_state.B, E)
    np.testing.assert_array_equal(only_state.D, np.zeros((2, 1)))
    np.testing.assert_array_equal(only_output.B, L @ np.ones((2, 1)))


def test_innovation_is_zero_without_faults() -> None:
    """`f_e = N u - M y = -(Nd d + Nf f)` in the frequency domain, for an unstable plant."""
    system = random_system(9, 5, 3, 2)
    P_known = Abcd(system.A, system.B[:, :2], system.C, system.D[:, :2])
    L = filter_gain(P_known)
    M, N = lcf(P_known, L)
    Nf = coprime_factor(P_known, L, system.B[:, 2:], system.D[:, 2:])
    G = frequency_response(system, GRID)
    Mj, Nj, Nfj = (frequency_response(F, GRID) for F in (M, N, Nf))
    np.testing.assert_allclose(Nj - Mj @ G[:, :, :2], 0, atol=1e-8)
    np.testing.assert_allclose(-Mj @ G[:, :, 2:], -Nfj, atol=1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_stiff_plant_in_si_units(seed: int) -> None:
    system = stiff_plant(seed)
    noise = np.diag([200.0, 0.1, 0.05]) ** 2
    B = system.B * np.array([1.0, 0.01, 0.01, 1.0])
    L = filter_gain(system, B @ B.T, noise)
    M, N = lcf(system, L)
    assert_factors(system, M, N, rtol=1e-6)
    assert M.input_labels == system.output_labels
    assert N.input_labels == system.input_labels


def test_filter_gain_is_scipys() -> None:
    system = random_system(3, 6, 2, 2, direct=False)
    random = np.random.default_rng(0)
    W, V = random.normal(size=(6, 6)), random.normal(size=(2, 2))
    Q, R = W @ W.T, V @ V.T + np.eye(2)
    Y = scipy.linalg.solve_continuous_are(system.A.T, system.C.T, Q, R)
    np.testing.assert_allclose(filter_gain(system, Q, R), -Y @ system.C.T @ np.linalg.inv(R), rtol=1e-8)


def test_controller_factors_keep_integrators_as_zeros() -> None:
    """Zeros of V are the poles of K, whatever the gain."""
    K = random_system(2, 4, 2, 2)
    V, U = lcf(K)
    zeros = np.linalg.eigvals(V.A - V.B @ V.C)
    np.testing.assert_allclose(np.sort_complex(zeros), np.sort_complex(np.linalg.eigvals(K.A)), rtol=1e-6)
    assert_factors(K, V, U)


def diagonal_system(B: list[float], C: list[float]) -> control.StateSpace:
    return control.ss(np.diag([0.0, -1.0]), np.array(B)[:, None], np.array(C)[None], 0)


def test_errors() -> None:
    with pytest.raises(gimc.NotDetectableError, match="do not see the mode at 0"):
        lcf(diagonal_system([1, 1], [0, 1]))
    with pytest.raises(gimc.NotStabilisableError, match="reaches the mode at 0"):
        lcf(diagonal_system([0, 1], [1, 1]))
    with pytest.raises(gimc.UnstableError, match="sign"):
        lcf(diagonal_system([1, 1], [1, 1]), L=[[1.0], [1.0]])
    with pytest.raises(ValueError, match="shape"):
        lcf(diagonal_system([1, 1], [1, 1]), L=[[1.0, 1.0]])
    with pytest.raises(ValueError, match="determines L"):
        lcf(diagonal_system([1, 1], [1, 1]), L=[[-1.0], [0.0]], normalised=True)


@pytest.mark.parametrize("states", [(1.0, 1.0), (1e-5, 1e6), (1e6, 1e-5), (1e3, 1e-3)])
@pytest.mark.parametrize("signals", [(1.0, 1.0), (1e6, 1e-6), (1e-6, 1e6), (1e-3, 1.0)])
def test_units_do_not_make_a_mode_unseen(states: tuple[float, float], signals: tuple[float, float]) -> None:
    """An integrator that drives an unstable state, in units of states, input and output far apart."""
    d, (u, y) = np.array(states), signals
    A, B, C = np.array([[0.0, 0], [-1, 1]]), np.array([[-2.0], [0]]), np.array([[-2.0, 3]])
    system = Abcd(A * d / d[:, None], B / d[:, None] * u, C * d * y, np.zeros((1, 1)))
    M, N = lcf(system)
    assert is_stable(M)
    quotient = np.linalg.solve(frequency_response(M, GRID[1:]), frequency_response(N, GRID[1:]))
    np.testing.assert_allclose(quotient, frequency_response(system, GRID[1:]), rtol=1e-6)
