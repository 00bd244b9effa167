"""Balanced truncation, residualisation, minimal realisation."""

import control
import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st
from synthesis_problems import random_system, siso, stiff_plant

import gimc
from gimc import (
    Abcd,
    abcd,
    append,
    balanced_truncation,
    frequency_response,
    hankel_values,
    is_stable,
    minimal_realisation,
    reduce_order,
    series,
    stack_inputs,
)
from gimc.reduction import gramian_factor


@given(st.integers(0, 10**6), st.integers(2, 14), st.integers(1, 3), st.integers(1, 3), st.booleans())
@settings(max_examples=40, deadline=None, derandomize=True)
def test_error_keeps_its_bound(seed: int, n: int, m: int, p: int, keep_dc: bool) -> None:
    """For every order: stable, error between the first neglected Hankel value and twice the sum of all."""
    system = random_system(seed, n, m, p, stable=True)
    for order in range(n):
        result = reduce_order(system, order=order, keep_dc_gain=keep_dc)
        assert result.system.nstates == order
        assert is_stable(result.system)
        assert result.error <= result.bound * (1 + 1e-6) + 1e-9 * result.norm
        assert result.error >= result.hankel[order] * (1 - 1e-6)
        if keep_dc:
            full, reduced = frequency_response(system, 0.0), frequency_response(result.system, 0.0)
            np.testing.assert_allclose(full, reduced, rtol=1e-7, atol=1e-8 * np.abs(full).max())


def test_published_hankel_values() -> None:
    """Closed form: 1/(s + a) has the single Hankel value 1/(2 a); and python-control's values."""
    assert hankel_values(siso([1], [1, 4]))[0] == pytest.approx(1 / 8)
    system = random_system(1, 8, 2, 2, stable=True)
    theirs = np.sort(control.hankel_singular_values(control.ss(*system)).real)[::-1]
    np.testing.assert_allclose(hankel_values(system), theirs, rtol=1e-5)


@pytest.mark.parametrize("rtol", [0.3, 1e-2, 1e-4, 1e-8])
def test_balanced_truncation_keeps_rtol(rtol: float) -> None:
    system = control.ss(*random_system(2, 12, 2, 3, stable=True), inputs=["a", "b"], outputs=["x", "y", "z"])
    reduced = balanced_truncation(system, rtol)
    assert gimc.hinf_norm(gimc.add(system, gimc.scale(reduced, [-1.0] * 3)))[0] <= rtol * gimc.hinf_norm(system)[0]
    assert reduced.input_labels == ["a", "b"]
    assert reduced.output_labels == ["x", "y", "z"]
    smaller = reduce_order(system, order=max(reduced.nstates - 1, 0))
    assert smaller.bound > rtol * smaller.norm  # the smallest order with that bound


@given(st.integers(0, 10**6), st.integers(1, 12), st.integers(1, 3))
@settings(max_examples=30, deadline=None, derandomize=True)
def test_gramian_factor(seed: int, n: int, m: int) -> None:
    system = random_system(seed, n, m, 1, stable=True)
    S = gramian_factor(system.A, system.B)
    X = scipy.linalg.solve_continuous_lyapunov(system.A, -system.B @ system.B.T)
    np.testing.assert_allclose(S @ S.T, X, rtol=1e-7, atol=1e-9 * np.abs(X).max())


def test_small_hankel_values_keep_their_digits() -> None:
    """Decoupled lags with gains over 14 decades: every Hankel value is known; a squared Gramian would lose half."""
    gains = 10.0 ** -np.arange(0, 15, 2)
    system = append(*[siso([gain], [1, 1 + k]) for k, gain in enumerate(gains)])
    expected = np.sort(gains / (2.0 * (1.0 + np.arange(gains.size))))[::-1]
    np.testing.assert_allclose(hankel_values(system), expected, rtol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_mixed_units(seed: int) -> None:
    """With signal scales each output keeps its own accuracy; without, kelvins drown in pascals."""
    system = stiff_plant(seed)
    scales = {"input_scales": [20.0, 0.05, 0.01, 3.0], "output_scales": [1e4, 3.0, 2.0]}
    result = reduce_order(system, rtol=0.03, **scales)
    assert result.order < 11
    assert result.error <= 0.03 * result.norm
    w = np.logspace(-5, 4, 200)
    unit = np.array(scales["input_scales"]) / np.array(scales["output_scales"])[:, None]
    difference = (frequency_response(system, w) - frequency_response(result.system, w)) * unit
    assert np.linalg.norm(difference, 2, axis=(1, 2)).max() <= result.error * (1 + 1e-4)
    assert result.error == pytest.approx(np.linalg.norm(difference, 2, axis=(1, 2)).max(), rel=0.05)


def test_minimal_realisation_of_cancelling_systems() -> None:
    """P^-1 P keeps no state; [P P] and [P; P] built without sharing keep one copy; unstable P too."""
    P = random_system(3, 5, 2, 2)
    P.D[:] += 3 * np.eye(2)
    unit = minimal_realisation(series(gimc.inverse(P), P), rtol=1e-8)
    assert unit.nstates == 0
    np.testing.assert_allclose(unit.D, np.eye(2), atol=1e-9)
    twice = append(P, P)
    doubled = Abcd(twice.A, twice.B, np.hstack([P.C, P.C]), np.hstack([P.D, P.D]))
    assert minimal_realisation(doubled).nstates == 5
    assert stack_inputs(P, P).A.shape == (5, 5)


@pytest.mark.parametrize("seed", range(3))
def test_minimal_realisation_of_a_stiff_plant(seed: int) -> None:
    """A conserved quantity (pole at 0, not reachable) and a copy of nothing are removed; the response stays."""
    system = abcd(stiff_plant(seed))
    n = 11
    T = np.eye(n + 1) + 0.2 * np.random.default_rng(seed).normal(size=(n + 1, n + 1))
    A = np.zeros((n + 1, n + 1))
    d = 10.0 ** np.random.default_rng(seed).uniform(-3, 5, n + 1)
    same = reduce_order(system, order=n, input_scales=[20, 0.05, 0.01, 3], output_scales=[1e4, 3, 2])
    balanced = abcd(same.system)
    A[:n, :n] = balanced.A
    B, C = np.vstack([balanced.B, np.zeros((1, 4))]), np.hstack([balanced.C, np.full((3, 1), 1e-3)])
    T = d[:, None] * T
    hidden = Abcd(T @ A @ np.linalg.inv(T), T @ B, C @ np.linalg.inv(T), system.D)
    found = minimal_realisation(hidden)
    assert found.nstates == n
    w = np.logspace(-4, 4, 100)
    G = frequency_response(system, w)
    error = np.abs(frequency_response(found, w) - G).max(axis=0)
    assert (error <= 1e-5 * np.abs(G).max(axis=0)).all()


def test_errors() -> None:
    unstable = control.ss([[0.1]], [[1]], [[1]], 0)
    with pytest.raises(gimc.UnstableError, match="stable"):
        balanced_truncation(unstable, 0.1)
    with pytest.raises(ValueError, match="whole number from 0 to 3"):
        reduce_order(random_system(0, 3, 1, 1, stable=True), order=4)


@pytest.mark.parametrize("count", [2, 3, 6])
def test_minimal_realisation_of_one_pole_many_times(count: int) -> None:
    """Stacked s^k / (s - 1)^count, each with its own states: one set of states is enough, and the response stays."""
    powers = range(min(count, 4))
    blocks = append(*(control.tf([1.0] + [0.0] * k, np.poly(np.ones(count))) for k in powers))
    system = gimc.scale(blocks, right=np.ones((len(powers), 1)))
    assert system.A.shape[0] == count * len(powers)
    found = minimal_realisation(system)
    assert found.nstates == count
    w = np.logspace(-2, 2, 50)
    wanted = np.array([[(1j * x) ** k / (1j * x - 1) ** count for k in powers] for x in w])
    response = frequency_response(found, w)[:, :, 0]
    assert (np.abs(response - wanted) <= 1e-4 * np.abs(wanted).max(axis=0)).all()


def test_minimal_realisation_that_changes_the_response_is_refused() -> None:
    """With a tenth of the size of the system taken for nothing, states go that are needed."""
    with pytest.raises(gimc.SynthesisError, match="response does not stay the same"):
        minimal_realisation(random_system(2, 6, 1, 1, stable=True), rtol=0.1)


def little_damping() -> Abcd:
    """Thirty oscillators with a damping ratio of 1e-9, mixed: poles nearly on the axis."""
    random = np.random.default_rng(0)
    frequencies = np.geomspace(1.0, 30.0, 30)
    A = np.zeros((60, 60))
    for i, w in enumerate(frequencies):
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[-1e-9 * w, w], [-w, -1e-9 * w]]
    mix = np.linalg.qr(random.normal(size=(60, 60)))[0]
    return Abcd(mix @ A @ mix.T, random.normal(size=(60, 1)), random.normal(size=(1, 60)), np.zeros((1, 1)))


@pytest.mark.parametrize("rtol", [1e-1, 1e-3])
def test_little_damping_within_rtol(rtol: float) -> None:
    result = reduce_order(little_damping(), rtol=rtol)
    assert result.order < 60
    assert result.error <= 1.001 * rtol * result.norm


def test_little_damping_beyond_rounding_is_refused() -> None:
    """No digits are left for 1e-8; a larger order than all states there is not."""
    with pytest.raises(gimc.SynthesisError, match=r"reduction to rtol = 1e-08: order 60 .* too near the axis"):
        reduce_order(little_damping(), rtol=1e-8)
