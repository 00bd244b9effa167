"""Transfer functions as state-space systems: the poles asked for, the response of the coefficients."""

from fractions import Fraction

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gimc
from gimc import abcd, frequency_response, hinf_norm, poles

SPREAD = {
    "one over five": ([], [-2, -1e-3, -1e-4, -1e-4, -3e-4]),
    "three over five": ([-1e4, -2e4, -3e4], [-1e4, -1e-3, -2e-3, -3e-3, -4e-3]),
}


def quotient(numerator: np.ndarray, denominator: np.ndarray, w: Fraction) -> complex:
    """Value at `j w` of the coefficients as they are, in rational arithmetic."""

    def value(coefficients: np.ndarray) -> tuple[Fraction, Fraction]:
        real, imaginary = Fraction(0), Fraction(0)
        for c in coefficients:
            real, imaginary = -imaginary * w + Fraction(float(c)), real * w
        return real, imaginary

    (a, b), (c, d) = value(np.atleast_1d(numerator)), value(np.atleast_1d(denominator))
    size = c * c + d * d
    return complex(float((a * c + b * d) / size), float((b * c - a * d) / size))


def assert_response(numerator: np.ndarray, denominator: np.ndarray, moduli: np.ndarray) -> None:
    system = abcd(control.tf(numerator, denominator))
    for w in np.concatenate([[0.0], moduli, 10 * moduli]):
        exact = quotient(numerator, denominator, Fraction(float(w)))
        assert abs(frequency_response(system, w).item() - exact) <= 1e-6 * abs(exact) + 1e-12


@pytest.mark.parametrize("name", SPREAD)
def test_spread_poles(name: str) -> None:
    zeros, roots = SPREAD[name]
    numerator, denominator = np.poly(zeros), np.poly(roots)
    found = np.sort(poles(control.tf(numerator, denominator)).real)
    np.testing.assert_allclose(found, np.sort(roots), rtol=1e-6)  # a double root has half the digits
    assert_response(numerator, denominator, np.abs(roots))
    exact = abs(quotient(numerator, denominator, Fraction(0)))
    assert hinf_norm(control.tf(numerator, denominator))[0] == pytest.approx(exact, rel=2e-6)


@given(st.lists(st.floats(-5, 4), min_size=1, max_size=6, unique_by=lambda x: round(2 * x)), st.integers(0, 6))
def test_poles_over_nine_decades(exponents: list[float], zeros: int) -> None:
    roots = -(10.0 ** np.array(exponents))
    numerator = np.poly(3.0 * roots[: min(zeros, roots.size)])
    found = np.sort(poles(control.tf(numerator, np.poly(roots))).real)
    np.testing.assert_allclose(found, np.sort(roots), rtol=1e-6)
    assert_response(numerator, np.poly(roots), np.abs(roots))


def test_without_slycot(monkeypatch: pytest.MonkeyPatch) -> None:
    """No conversion of python-control's is used: it would take its realisation from SLICOT's td04ad or from scipy."""
    monkeypatch.setattr(control, "ss", None)
    for name in ("ss", "tf2ss", "_convert_to_statespace"):
        monkeypatch.setattr(f"control.statesp.{name}", None)
    assert abcd(control.tf([1, 2], [1, 3, 2])).A.shape == (2, 2)


@pytest.mark.parametrize(
    ("numerator", "denominator"),
    [
        (np.poly([-1 + 2j, -1 - 2j, -5]), np.poly([-1, -2, -3, -4])),  # complex zeros over real poles
        (np.poly([-1, -2, -3]), np.poly([-1 + 5j, -1 - 5j, -0.01])),  # real zeros over complex poles
        (np.poly([1j, -1j]), np.poly([-0.01 + 3j, -0.01 - 3j, -2 + 1j, -2 - 1j])),
        (np.array([2.0]), np.poly(np.ones(6))),  # unstable, six times the same
        (np.poly([0, 0, -1]), np.poly([-1, -1, -1, -1])),
    ],
)
def test_every_kind_of_section(numerator: np.ndarray, denominator: np.ndarray) -> None:
    assert_response(numerator.real, denominator.real, np.array([0.3, 1.0, 3.0, 40.0]))


def test_shapes_and_gains() -> None:
    assert abcd(control.tf([3.0], [2.0])).D.item() == 1.5
    assert abcd(control.tf([0, 0, 4.0], [0, 2.0, 2.0])).A.shape == (1, 1)
    zero = abcd(control.tf([0.0], [1.0, 1.0]))
    assert hinf_norm(zero)[0] == 0.0
    integrator = abcd(control.tf([5.0], [1.0, 0.0, 0.0]))
    np.testing.assert_array_equal(gimc.poles(integrator), 0.0)
