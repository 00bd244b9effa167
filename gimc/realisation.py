"""State-space realisation of a transfer function that keeps its poles: first- and second-order sections in series.

The companion form holds the coefficients exactly, but poles over many decades drown in the rounding of whatever is
computed from it. Sections in series give a triangular A with the poles on its diagonal.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gimc.checks import real_matrix
from gimc.scaling import balance_states
from gimc.systems import Abcd, Matrix, in_series

TOLERANCE = 1e-6  # relative difference allowed between the responses of the sections and of the coefficients


def realise(numerator: ArrayLike, denominator: ArrayLike, what: str) -> Abcd:
    """Return a realisation of a quotient of polynomials, highest power first.

    Raises
    ------
    ValueError
        If there are more zeros than poles, or the response is not that of the coefficients.
    """
    num = np.trim_zeros(real_matrix(numerator, what, "the numerator").ravel(), "f")
    den = np.trim_zeros(real_matrix(denominator, what, "the denominator").ravel(), "f")
    if den.size == 0:
        raise ValueError(f"{what}: the denominator is zero")
    if num.size > den.size:
        raise ValueError(f"{what}: not proper, with {num.size - 1} zeros and {den.size - 1} poles")
    if num.size == 0 or den.size == 1:
        gain = num[0] / den[0] if num.size else 0.0
        return Abcd(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[gain]]))
    chain = in_series(*_sections(np.roots(num), np.roots(den)))
    gain = num[0] / den[0]
    system = balance_states(Abcd(chain.A, chain.B, gain * chain.C, gain * chain.D))
    _check_response(system, num, den, what)
    return system


def _sections(zeros: Any, poles: Any) -> list[Abcd]:
    """Sections `(s^2 + b1 s + b0) / (s^2 + a1 s + a0)` or of first order, each with zeros of about its poles' size."""
    pairs, singles = _split(poles)
    zero_pairs, zero_singles = _split(zeros)
    sections = []
    for zero in zero_pairs:
        if pairs:
            pole = _nearest(pairs, zero)
            sections.append(_second_order(pole, np.conj(pole), zero, np.conj(zero)))
        else:
            first, second = _nearest(singles, zero), _nearest(singles, zero)
            sections.append(_second_order(first, second, zero, np.conj(zero)))
    for pole in pairs:
        taken = [_nearest(zero_singles, pole) for _ in range(min(2, len(zero_singles)))]
        sections.append(_second_order(pole, np.conj(pole), *taken))
    for zero in zero_singles:
        pole = _nearest(singles, zero)
        sections.append(Abcd(*(np.array([[value]]) for value in (pole.real, 1.0, (pole - zero).real, 1.0))))
    sections += [Abcd(*(np.array([[value]]) for value in (pole.real, 1.0, 1.0, 0.0))) for pole in singles]
    return sorted(sections, key=lambda section: float(np.abs(np.linalg.det(section.A)) ** (1 / len(section.A))))


def _split(roots: Any) -> tuple[list[complex], list[complex]]:
    """One of each conjugate pair, and the real ones."""
    return [complex(root) for root in roots if root.imag > 0], [complex(root) for root in roots if root.imag == 0]


def _nearest(roots: list[complex], root: complex) -> complex:
    """Take out of the list what is nearest in size, on a logarithmic scale."""
    tiny = np.finfo(float).tiny
    sizes = [abs(np.log(max(abs(other), tiny) / max(abs(root), tiny))) for other in roots]
    return roots.pop(int(np.argmin(sizes)))


def _second_order(p1: complex, p2: complex, *zeros: complex) -> Abcd:
    """Section with both poles and up to two zeros: `x1 = 1 / den`, `x2 = (s - Re p1) / den`."""
    a1, a0 = -(p1 + p2).real, (p1 * p2).real
    A = np.array([[p1.real, 1.0], [-(p1.imag**2), p2.real]])
    b2, b1, b0 = np.concatenate([np.zeros(2 - len(zeros)), np.poly(zeros).real if zeros else [1.0]])
    c1, c0 = b1 - b2 * a1, b0 - b2 * a0
    return Abcd(A, np.array([[0.0], [1.0]]), np.array([[c0 + c1 * p1.real, c1]]), np.array([[b2]]))


def _check_response(system: Abcd, num: Matrix, den: Matrix, what: str) -> None:
    """Compare the response at the poles' frequencies with that of the coefficients, as far as it has digits."""
    A, B, C, D = system
    eps, largest = float(np.finfo(float).eps), 0.0
    for w in np.concatenate([np.abs(np.roots(den)), [0.0]]):
        top, bottom = complex(np.polyval(num, 1j * w)), complex(np.polyval(den, 1j * w))
        rounding = eps * float(np.polyval(np.abs(den), w))
        if abs(bottom) <= 1e6 * rounding:
            continue  # a pole on the axis, or as good as
        largest = max(largest, float(np.polyval(np.abs(num), w)) / abs(bottom))
        found = (D + C @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B)).item()
        size = max(abs(top / bottom), 1e-6 * largest) * max(1.0, 1e6 * rounding / abs(bottom))
        if abs(found - top / bottom) > TOLERANCE * size:
            raise ValueError(
                f"{what}: no realisation reproduces these coefficients at {w:.3g} rad/s, their poles are spread too "
                "far; give a StateSpace, or factors in series"
            )
