"""H-infinity norm by Hamiltonian and by sweep, against closed forms, python-control and each other."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthesis_problems import random_system, siso, stiff_plant

import gimc
from gimc import Abcd, append, frequency_response, hinf_norm, largest_singular_values, series, sweep_norm


@pytest.mark.parametrize("damping", [0.5, 0.1, 1e-2, 1e-4, 1e-6])
def test_resonance_closed_form(damping: float) -> None:
    """Peak of 1/(s^2 + 2 z s + 1): 1/(2 z sqrt(1 - z^2)) at sqrt(1 - 2 z^2)."""
    norm, frequency = hinf_norm(siso([1], [1, 2 * damping, 1]))
    assert norm == pytest.approx(1 / (2 * damping * np.sqrt(1 - damping**2)), rel=1e-5)
    assert frequency == pytest.approx(np.sqrt(1 - 2 * damping**2), rel=3e-3)  # the maximum is flat: sqrt(2 rtol)


@pytest.mark.parametrize(
    ("system", "norm", "frequency"),
    [
        (np.array([[3.0, 4.0]]), 5.0, 0.0),
        (np.zeros((2, 3)), 0.0, 0.0),
        (siso([1], [1, 1e-5]), 1e5, 0.0),
        (siso([1, 0], [1, 1e-4]), 1.0, np.inf),
        (siso([1, -1], [1, 1]), 1.0, None),  # all-pass: the same everywhere
        (append(siso([7], [1e5, 1]), siso([2], [1e-3, 1])), 7.0, 0.0),
    ],
)
def test_known_norms(system: object, norm: float, frequency: float | None) -> None:
    found, where = hinf_norm(system)
    assert found == pytest.approx(norm, rel=1e-6)
    assert sweep_norm(system)[0] == pytest.approx(norm, rel=1e-6)
    if frequency is not None and norm > 0 and found != where:
        assert where == frequency or np.ndim(system) == 2


@given(st.integers(0, 10**6), st.integers(1, 12), st.integers(1, 4), st.integers(1, 4))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_two_routes_and_a_third(seed: int, n: int, m: int, p: int) -> None:
    system = random_system(seed, n, m, p, stable=True)
    norm, frequency = hinf_norm(system)
    assert sweep_norm(system)[0] == pytest.approx(norm, rel=1e-4)
    assert control.linfnorm(control.ss(*system), 1e-8)[0] == pytest.approx(norm, rel=1e-5)
    assert largest_singular_values(system, frequency)[0] == pytest.approx(norm, rel=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_stiff_plant(seed: int) -> None:
    """Time constants from 1.7 ms to 1e5 s, states in mixed units."""
    slow = append(*[siso([1], [1e5, 1])] * 4)
    system = series(stiff_plant(seed), slow)
    norm, _ = hinf_norm(system)
    assert sweep_norm(system)[0] == pytest.approx(norm, rel=1e-4)
    w = np.concatenate([[0.0], np.logspace(-7, 4, 4000)])
    values = largest_singular_values(system, w)
    assert values.max() <= norm * (1 + 1e-5)
    assert values.max() == pytest.approx(norm, rel=1e-3)


def test_state_units_do_not_matter() -> None:
    system = gimc.abcd(stiff_plant(3))
    d = 10.0 ** np.random.default_rng(0).uniform(-7, 7, size=11)
    other = Abcd(system.A * d[:, None] / d, system.B * d[:, None], system.C / d, system.D)
    assert hinf_norm(other)[0] == pytest.approx(hinf_norm(system)[0], rel=1e-6)


def test_frequency_response_is_the_definition() -> None:
    system = random_system(5, 9, 2, 3)
    w = np.array([0.0, 0.3, 11.0, np.inf])
    response = frequency_response(system, w)
    for i, frequency in enumerate(w[:3]):
        direct = system.C @ np.linalg.solve(1j * frequency * np.eye(9) - system.A, system.B) + system.D
        np.testing.assert_allclose(response[i], direct, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(response[3], system.D)


@pytest.mark.parametrize("A", [0.0, 1.0])
def test_unstable_is_refused(A: float) -> None:
    with pytest.raises(gimc.UnstableError, match="pole at"):
        hinf_norm(Abcd(np.array([[A]]), np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1))))


def test_narrow_peak_between_grid_points() -> None:
    """A resonance a million times narrower than the grid's spacing, on a floor nearly as large as its peak."""
    system = gimc.add(siso([1.0], [1.0, 1.0]), siso([3e-6, 0], [1, 2e-6, 1.2345**2]))
    w = 1.2345 + np.linspace(-5e-6, 5e-6, 20001)
    exact = np.abs(1 / (1j * w + 1) + 3e-6j * w / (1.2345**2 - w**2 + 2e-6j * w)).max()
    assert exact > 1.5
    assert hinf_norm(system)[0] == pytest.approx(exact, rel=1e-5)
    assert sweep_norm(system)[0] == pytest.approx(exact, rel=1e-4)
