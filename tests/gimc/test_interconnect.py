"""Interconnections: the algebra of transfer functions, frequency by frequency, and the number of states."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthesis_problems import random_system

import gimc
from gimc import (
    Abcd,
    abcd,
    add,
    append,
    connect,
    frequency_response,
    generalised_plant,
    inverse,
    lft,
    scale,
    series,
    stack_inputs,
    stack_outputs,
    state_space,
)

W = np.array([0.0, 0.2, 3.0, 50.0])


def at(system: object) -> np.ndarray:
    return frequency_response(system, W)


@given(st.integers(0, 10**6), st.integers(0, 5), st.integers(0, 5))
@settings(max_examples=30, deadline=None, derandomize=True)
def test_algebra(seed: int, n: int, k: int) -> None:
    """Sum, product, inverse, stacking: those of the matrices at every frequency (orders may be zero)."""
    G, H = random_system(seed, n, 2, 2), random_system(seed + 1, k, 2, 2)
    near = {"rtol": 1e-7, "atol": 1e-7}
    np.testing.assert_allclose(at(add(G, H)), at(G) + at(H), **near)
    np.testing.assert_allclose(at(series(G, H)), at(G) @ at(H), **near)
    np.testing.assert_allclose(at(series(G, H, G)), at(G) @ at(H) @ at(G), **near)
    np.testing.assert_allclose(at(stack_inputs(G, H)), np.concatenate([at(G), at(H)], axis=2), **near)
    np.testing.assert_allclose(at(stack_outputs(G, H)), np.concatenate([at(G), at(H)], axis=1), **near)
    np.testing.assert_allclose(at(scale(G, [2.0, 3.0], [[1.0], [4.0]])), np.diag([2, 3]) @ at(G) @ [[1], [4]], **near)
    block = at(generalised_plant([[G, H], [H, G]]))
    np.testing.assert_allclose(block, np.block([[at(G), at(H)], [at(H), at(G)]]), **near)
    assert append(G, H).A.shape == (n + k, n + k)


@given(st.integers(0, 10**6), st.integers(1, 5))
@settings(max_examples=20, deadline=None, derandomize=True)
def test_inverse(seed: int, n: int) -> None:
    G = random_system(seed, n, 2, 2)
    G = Abcd(G.A, G.B, G.C, G.D + 4 * np.eye(2))
    np.testing.assert_allclose(at(inverse(G)) @ at(G), np.broadcast_to(np.eye(2), (4, 2, 2)), atol=1e-7)


@given(st.integers(0, 10**6), st.integers(0, 5), st.integers(0, 4))
@settings(max_examples=30, deadline=None, derandomize=True)
def test_lft_and_connect(seed: int, n: int, k: int) -> None:
    """`P11 + P12 K (I - P22 K)^-1 P21` by `lft` and by `connect`, direct terms everywhere."""
    P, K = random_system(seed, n, 4, 5), random_system(seed + 1, k, 3, 2)  # w 2, u 2, z 2, y 3
    Pj, Kj = at(P), at(K)
    P11, P12, P21, P22 = Pj[:, :2, :2], Pj[:, :2, 2:], Pj[:, 2:, :2], Pj[:, 2:, 2:]
    expected = P11 + P12 @ Kj @ np.linalg.solve(np.eye(3) - P22 @ Kj, P21)
    closed = lft(P, K, 3, 2)
    size = np.abs(expected).max()
    np.testing.assert_allclose(at(closed), expected, rtol=1e-6, atol=1e-7 * size)
    feedback = np.zeros((7, 7))  # inputs [w, u, K's y], outputs [z, y, K's u]
    feedback[2:4, 5:], feedback[4:, 2:5] = np.eye(2), np.eye(3)
    wired = connect(append(P, K), feedback, np.eye(7, 2), np.eye(2, 7))
    np.testing.assert_allclose(at(wired), expected, rtol=1e-6, atol=1e-7 * size)


def test_shared_states_are_not_doubled() -> None:
    G = random_system(1, 4, 3, 3)
    first, last = Abcd(G.A, G.B[:, :1], G.C, G.D[:, :1]), Abcd(G.A, G.B[:, 1:], G.C, G.D[:, 1:])
    together = stack_inputs(first, last)
    for found, wanted in zip(together, G, strict=True):
        np.testing.assert_array_equal(found, wanted)
    top, bottom = Abcd(G.A, G.B, G.C[:1], G.D[:1]), Abcd(G.A, G.B, G.C[1:], G.D[1:])
    for found, wanted in zip(stack_outputs(top, bottom), G, strict=True):
        np.testing.assert_array_equal(found, wanted)


def test_transfer_functions_of_many_signals() -> None:
    s = control.tf("s")
    G = control.tf([[[1], [2, 1]], [[0], [3]]], [[[1, 1], [1, 2]], [[1], [1, 5]]])
    wanted = np.array([[[1 / (1j * w + 1), (2j * w + 1) / (1j * w + 2)], [0, 3 / (1j * w + 5)]] for w in W])
    np.testing.assert_allclose(at(G), wanted, atol=1e-12)
    np.testing.assert_allclose(at(1 / (s + 1))[:, 0, 0], wanted[:, 0, 0], atol=1e-12)


def test_names_survive() -> None:
    G = control.ss(-1, 1, 1, 0, inputs=["speed"], outputs=["pressure"])
    named = state_space(scale(G, 2.0 * np.eye(1)), G)
    assert named.input_labels == ["speed"]
    assert named.output_labels == ["pressure"]
    plant = control.ss(-np.eye(2), np.eye(2, 4), np.eye(4, 2), np.eye(4)[:, ::-1], inputs=["d", "n", "u1", "u2"],
                       outputs=["z1", "z2", "y1", "y2"])  # fmt: skip
    K, _ = gimc.hinfsyn(plant, 2, 2)
    assert K.input_labels == ["y1", "y2"]
    assert K.output_labels == ["u1", "u2"]


def test_errors() -> None:
    one = np.ones((1, 1))
    with pytest.raises(gimc.IllPosedError, match="singular"):
        lft(np.array([[0.0, 1], [1, 1]]), one, 1, 1)
    with pytest.raises(gimc.IllPosedError, match="D of the system to invert"):
        inverse(Abcd(-one, one, one, 0 * one))
    with pytest.raises(ValueError, match="outputs: numbers differ"):
        stack_inputs(np.ones((1, 2)), np.ones((2, 2)))
    with pytest.raises(ValueError, match="not finite"):
        abcd(control.ss(-1, np.nan, 1, 0), what="plant")
    with pytest.raises(ValueError, match=r"sampled with dt = 0\.1"):
        abcd(control.ss(0.5, 1, 1, 0, 0.1))
