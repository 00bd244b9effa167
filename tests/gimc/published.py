"""Problems of H-infinity synthesis whose optimum others have published, and what they print for it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.optimize
from synthesis_problems import (
    matching_plant,
    mixed_sensitivity,
    normalised_coprime_plant,
    performance_weight,
    siso,
)

from gimc import Abcd, abcd, append, generalised_plant, regularise, scale, series

Problem = tuple[Abcd, int, int]


def servo_2_17() -> Problem:
    G = siso([200], np.polymul([10, 1], np.polymul([0.05, 1], [0.05, 1])))
    return mixed_sensitivity(G, performance_weight(10), abcd(1.0)), 1, 1


def zero_at_half(first: float, second: float) -> Callable[[], Problem]:
    """The plant of Skogestad and Postlethwaite's section on multivariable RHP zeros, `[[1, 1], [2s+1, 2]] / (..)`."""

    def problem() -> Problem:
        oscillator = np.array([[0.0, 1.0], [-5.0, -6.0]])
        A = np.kron(np.eye(3), oscillator)
        B = np.array([[0, 0], [1, 1], [0, 0], [1, 0], [0, 0], [0, 1.0]])
        C = np.array([[5.0, 0, 0, 0, 0, 0], [5, 0, 0, 10, 5, 0]])
        weight = append(performance_weight(first), performance_weight(second))
        return mixed_sensitivity(Abcd(A, B, C, np.zeros((2, 2))), weight, abcd(np.eye(2))), 2, 2

    return problem


def mit() -> Problem:
    G = siso([200], [0.025, 1.0025, 10.1, 1])
    return mixed_sensitivity(G, performance_weight(10), abcd(0.1)), 1, 1


def dc_servo() -> Problem:
    G = siso([11.2], np.polymul([1, 0.12], [1, 1e-5]))
    return mixed_sensitivity(G, performance_weight(20, floor=1e-8), abcd(1.0)), 1, 1


def quadruple_tank() -> Problem:
    area, hole = np.array([28, 32, 28, 32]), np.array([0.071, 0.057, 0.071, 0.057])
    level = np.array([12.4, 12.7, 1.8, 1.4])
    T = area / hole * np.sqrt(2 * level / 981)
    A = -np.diag(1 / T)
    A[0, 2], A[1, 3] = 1 / T[2], 1 / T[3]
    B = np.array([[0.7 * 3.33 / 28, 0], [0, 0.6 * 3.35 / 32], [0, 0.4 * 3.35 / 28], [0.3 * 3.33 / 32, 0]])
    G = Abcd(A, B, 0.5 * np.eye(2, 4), np.zeros((2, 2)))
    WS, WT = siso([100, 100], [1000, 1]), siso([10, 0.1], [1, 1])
    return mixed_sensitivity(G, append(WS, WS), abcd(0.01 * np.eye(2)), append(WT, WT)), 2, 2


def scherer_7() -> Problem:
    """Scherer, Gahinet and Chilali (IEEE TAC 42, 1997), example 7."""
    A = np.array([[0, 10, 2], [-1, 1, 0], [0, 2, -5.0]])
    B, C = np.array([[1, 0], [0, 1], [1, 0.0]]), np.array([[1, 0, 0], [0, 0, 0], [0, 1, 0.0]])
    return Abcd(A, B, C, np.array([[0, 0], [0, 1], [2, 0.0]])), 1, 1


def slicot_sb10fd() -> Problem:
    """Return the plant of the example program of SLICOT's SB10FD, which asks for a norm below 15 only."""
    A = [[-1, 0, 4, 5, -3, -2], [-2, 4, -7, -2, 0, 3], [-6, 9, -5, 0, 2, -1], [-8, 4, 7, -1, -3, 0],
         [2, 5, 8, -9, 1, -4], [3, -5, 8, 0, 2, -6]]  # fmt: skip
    B = [[-3, -4, -2, 1, 0], [2, 0, 1, -5, 2], [-5, -7, 0, 7, -2], [4, -6, 1, 1, -2], [-3, 9, -8, 0, 5],
         [1, -2, 3, -6, -2]]  # fmt: skip
    C = [[1, -1, 2, -4, 0, -3], [-3, 0, 5, -1, 1, 1], [-7, 5, 0, -8, 2, -2], [9, -3, 4, 0, 3, 7],
         [0, 1, -2, 1, -6, -2]]  # fmt: skip
    D = [[1, -2, -3, 0, 0], [0, 4, 0, 1, 0], [5, -3, -4, 0, 1], [0, 1, 0, 1, -3], [0, 0, 1, 7, 1]]
    return Abcd(*(np.array(matrix, dtype=float) for matrix in (A, B, C, D))), 2, 2


def shaped_servo() -> Problem:
    """Return Skogestad and Postlethwaite's example 9.3: robust stabilisation of a shaped plant."""
    plant = siso([200], np.polymul([10, 1], np.polymul([0.05, 1], [0.05, 1])))
    return normalised_coprime_plant(series(plant, siso([1, 2], [1, 1e-6]))), 1, 1


def benner() -> Problem:
    """Return the example of Benner, Byers, Mehrmann and Xu (2007) with all its parameters one, but e1 = 0."""
    B, C = np.array([[0, 0, 1.0], [0, 1, 1]]), np.array([[1.0, 0], [0, 1], [1, 1]])
    return Abcd(-np.eye(2), B, C, np.array([[0.5, 0, 0], [0, 0.5, 1], [0, 1, 0]])), 1, 1


def glover_packard(eps: float) -> Callable[[], Problem]:
    """Model matching of 1/(s+1) behind (s-1)(s-eps)/((s+1)(s+2)): a zero that comes near the axis."""
    return lambda: (matching_plant(siso([1], [1, 1]), siso(np.poly([1, eps]), np.poly([-1, -2])), abcd(1.0)), 1, 1)


def glover_packard_optimum(eps: float) -> float:
    return float(0.25 * (1 + np.sqrt(1 + 8 / (1 + eps))))


def chu_doyle_lee(a: float) -> Callable[[], Problem]:
    """Distance of 1/(s-1) from the stable systems beside 1/(s-a), which nothing changes: `min || [f1 - Q, f2] ||`.

    Both are multiplied by the all-pass function that makes them stable.
    """

    def problem() -> Problem:
        den = np.poly([-1, -a])
        inner = siso(np.poly([1, a]), den)
        rows = [[siso([1, -a], den), siso([1, -1], den), scale(inner, [-1.0])], [abcd(1.0), abcd(0.0), abcd(0.0)]]
        return generalised_plant(rows), 1, 1

    return problem


def chu_doyle_lee_optimum(a: float) -> float:
    return 1 / a if a <= 1 else float((np.sqrt(a**2 + 4 * (a - 1) / (a + 1)) - 1) / (2 * (a - 1)))


def francis() -> Problem:
    """Distance of `[[1/(s^2-1), 4], [1/(s^2-s+1), (s+1)/(s-1)]]` from the stable systems."""
    pair, mirrored = [1.0, -1.0, 1.0], [1.0, 1.0, 1.0]
    inner = siso(np.polymul([1, -1], pair), np.polymul([1, 1], mirrored))
    T1 = generalised_plant([
        [siso(pair, np.polymul(np.poly([-1, -1]), mirrored)), scale(inner, [4.0])],
        [siso([1, -1], np.polymul([1, 1], mirrored)), siso(pair, mirrored)],
    ])  # fmt: skip
    return matching_plant(T1, append(inner, inner), abcd(np.eye(2))), 2, 2


def varga_5_14() -> Problem:
    """Varga (2017), example 5.14 with a measurement noise of 1e-4: faults 1/(s+1), noise 1/(s+2), wanted 1/(s+3)."""
    zero = abcd(0.0)
    rows = [[zero, siso([1], [1, 3]), abcd(-1.0)], [siso([1], [1, 2]), siso([1], [1, 1]), zero]]
    return regularise(generalised_plant(rows), 1, 1, eps=1e-4), 1, 1


def varga_5_14_optimum() -> float:
    """Varga (2017), example 5.14: Gf = 1/(s+1), Gw = 1/(s+2), Mr = 1/(s+3), optimum by hand.

    `[Gf Gw] = Go Gi` with `Gi = [s+2, s+1] / (sqrt(2) (s + p))`, p = sqrt(2.5). Then the problem is the least distance
    of `Mr Gi1~`, whose only antistable pole is p, under the bound `W W~ = gamma^2 - |Mr Gi2|^2` left by the noise.
    """
    p = np.sqrt(2.5)

    def excess(gamma: float) -> float:
        # gamma^2 - (1 - s^2) / (2 (9 - s^2)(p^2 - s^2)), numerator in x = s^2
        numerator = gamma**2 * 2 * np.polymul([-1, 9], [-1, p * p]) - np.array([0, -1, 1])
        roots = np.sqrt(np.roots(numerator).astype(complex))
        roots = np.where(roots.real > 0, -roots, roots)
        W = gamma * np.prod(p - roots).real / ((p + 3) * (p + p))
        residue = (2 - p) / np.sqrt(2) / (p + 3)
        return float(abs(residue) / (2 * p * W) - 1.0)

    grid = np.concatenate([[0.0], np.logspace(-5, 4, 1500)])
    floor = np.abs(np.sqrt((1 + grid**2) / 2 / (9 + grid**2) / (p * p + grid**2))).max()
    return float(scipy.optimize.brentq(excess, floor * (1 + 1e-9), 1.0))


@dataclass(frozen=True)
class Published:
    """A problem, the optimum printed for it (None: no digits are), and how far off that may be.

    `rounding` is that of the print, `above` what the problem posed here has to be above the one that was solved.
    """

    problem: Callable[[], Problem]
    optimum: float | None
    rounding: float = 0.0
    above: float = 0.0


PUBLISHED = {
    # Multivariable Feedback Control (2005): three digits are printed.
    "Skogestad, Postlethwaite, example 2.17": Published(servo_2_17, 1.37, 5e-3),
    "Skogestad, Postlethwaite, plant with RHP zero, design 1": Published(zero_at_half(0.25, 0.25), 2.80, 5e-3),
    "the same, design 2": Published(zero_at_half(0.25, 25), 2.92, 5e-3),
    "the same, design 3": Published(zero_at_half(25, 0.25), 6.73, 5e-3),
    "Skogestad, Postlethwaite, example 9.3": Published(shaped_servo, 2.34, 5e-3),
    # test/test_hinf_design.jl, and test_high_precision_hinf.jl, which allows 0.02.
    "RobustAndOptimalControl.jl, MIT 16.323": Published(mit, 0.923430124918),
    "RobustAndOptimalControl.jl, quadruple tank": Published(quadruple_tank, 0.9534467),
    "RobustAndOptimalControl.jl, DC servo": Published(dc_servo, 4.4825150, 2e-2),
    # Linear Algebra Appl. 425 (2007); RobustAndOptimalControl.jl does not meet it.
    "Benner, Byers, Mehrmann, Xu": Published(benner, 0.806, 5e-4),
    # Syst. Control Lett. 101 (2017): in closed form.
    **{
        f"Glover, Packard, eps = {eps:g}": Published(glover_packard(eps), glover_packard_optimum(eps))
        for eps in (1.0, 0.1, 0.01)
    },
    # Int. J. Control 44 (1986): in closed form.
    **{f"Chu, Doyle, Lee, a = {a:g}": Published(chu_doyle_lee(a), chu_doyle_lee_optimum(a)) for a in (0.5, 1.0, 2.0)},
    # A Course in H-infinity Control Theory (1987), pages 60 and 128: the Hankel norm, five digits.
    "Francis, Nehari problem": Published(francis, 1.2695, 5e-5),
    # Solving Fault Diagnosis Problems (2017), chapter 5: the optimum by hand, without the noise that is added here.
    "Varga, example 5.14": Published(varga_5_14, varga_5_14_optimum(), above=0.01),
    "Scherer, Gahinet, Chilali, example 7": Published(scherer_7, None),
    "SLICOT, example of SB10FD": Published(slicot_sb10fd, None),
}
