"""Model matching and isolation filters against closed forms (Pick, Nehari, least distance), an LMI and a grid."""

from itertools import pairwise

import control
import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
from published import varga_5_14_optimum
from synthesis_problems import lmi_optimum, matching_plant, nehari_distance, random_system, siso, stiff_plant

import gimc
from gimc import (
    Abcd,
    abcd,
    append,
    coprime_factor,
    filter_gain,
    frequency_response,
    isolation_filter,
    isolation_synthesis,
    matching_lower_bound,
    model_matching,
    poles,
    regularise,
)
from gimc.model_matching import Matching

GRID = np.concatenate([[0.0], np.logspace(-5, 4, 1500)])


@pytest.mark.parametrize("zeros", [[1.0], [0.2], [1.0, 2.0], [0.3, 1.0, 5.0]])
def test_nevanlinna_pick(zeros: list[float]) -> None:
    """`min |T1 - T2 Q|` with zeros of T2 in the right half plane: the smallest gamma whose Pick matrix is nonnegative.

    Doyle, Francis and Tannenbaum, Feedback Control Theory (1992), chapter 9.
    """
    T1 = siso([1.0, 3.0], [1.0, 0.4, 0.5])
    z = np.array(zeros)
    values = np.array([(s + 3) / (s * s + 0.4 * s + 0.5) for s in z])
    P0 = 1.0 / (z[:, None] + z)
    exact = np.sqrt(scipy.linalg.eigh(values[:, None] * values * P0, P0, eigvals_only=True)[-1])
    T2 = siso(np.poly(z), np.poly(-z - 1.0))
    result = model_matching(matching_plant(T1, T2, abcd(1.0)), 1, 1, rtol=1e-5, backoff=1e-3)
    assert exact * (1 - 1e-6) <= result.gamma <= exact * 1.002
    assert result.gamma == pytest.approx(result.plain_gamma, rel=1e-9)
    assert poles(result.filter).real.max() < 0


@pytest.mark.parametrize("seed", range(4))
def test_nehari(seed: int) -> None:
    """`min || T1 - Q Ti ||` with Ti square inner is the Hankel norm of the antistable part of `T1 Ti~`."""
    random = np.random.default_rng(seed)
    a = random.uniform(0.3, 3.0, size=2)
    Ti = append(siso([1, -a[0]], [1, a[0]]), siso([1, -a[1]], [1, a[1]]))
    U = np.linalg.qr(random.normal(size=(2, 2)))[0]
    Ti = gimc.scale(Ti, None, U)  # inner, not diagonal
    T1 = random_system(seed, 3, 2, 2, stable=True)
    # T1 U' diag((s+a)/(s-a)): column i has the antistable part T1(a_i) U' e_i 2 a_i / (s - a_i)
    columns = [T1.C @ np.linalg.solve(s * np.eye(3) - T1.A, T1.B) + T1.D for s in a]
    C = np.column_stack([columns[i] @ U[i] * 2 * a[i] for i in range(2)])
    exact = nehari_distance(Abcd(np.diag(a), np.eye(2), C, np.zeros((2, 2))))
    result = model_matching(matching_plant(T1, abcd(np.eye(2)), Ti), 2, 2, rtol=1e-5, backoff=1e-3)
    assert exact * (1 - 1e-6) <= result.gamma <= exact * 1.002


def test_varga_example_5_14() -> None:
    """An optimal filter is improper; with a small eps ours comes within one per cent of its norm."""
    exact = varga_5_14_optimum()
    result = isolation_synthesis(siso([1], [1, 2]), siso([1], [1, 1]), siso([1], [1, 3]), 1e-4, rtol=1e-5, backoff=1e-3)
    assert exact * (1 - 1e-6) <= result.plain_gamma <= result.gamma * (1 + 1e-9)
    assert result.gamma <= 1.01 * exact


VARGA_A = np.array([[-0.8, 0, 0], [0, -0.5, 0.6], [0, -0.6, -0.5]])
VARGA_C = np.array([[0, 1.0, 1], [1, 1, 0]])


@pytest.mark.parametrize("eps", [0.1, 1e-2])
def test_varga_example_5_16(eps: float) -> None:
    """Two actuator faults, two noises, reference 10/(s+10) I: as good as the LMI, and above the pointwise bound."""
    Gf = Abcd(VARGA_A, np.array([[1.0, 1], [1, 0], [0, 1]]), VARGA_C, np.zeros((2, 2)))
    Gw = Abcd(VARGA_A, 0.25 * np.array([[0.0, 0], [0, 1], [1, 0]]), VARGA_C, np.zeros((2, 2)))
    T = append(siso([10], [1, 10]), siso([10], [1, 10]))
    result = isolation_synthesis(Gw, Gf, T, eps)
    N = gimc.stack_inputs(Gw, Gf)
    both = append(T, N)
    B = np.vstack([np.hstack([both.B[:2, :0], np.zeros((2, 2)), both.B[:2, :2]]), N.B])
    D = np.block([[np.zeros((2, 4)), -np.eye(2)], [np.zeros((2, 4)), np.zeros((2, 2))]])
    P = Abcd(both.A, np.hstack([B, np.zeros((5, 2))]), both.C, D)
    best = lmi_optimum(regularise(P, 2, 2, eps=eps), 2, 2)
    assert 0.999 * best <= result.gamma <= 1.01 * best
    assert result.lower_bound <= result.gamma
    assert_isolation(result, Gw, Gf, T, np.full(2, eps))


def assert_isolation(result: Matching, Nd: object, Nf: object, T: object, eps: np.ndarray) -> None:
    """The definition on a grid: norm of [0 T 0] - H [Nd Nf eps] at most gamma, at least the bound."""
    assert poles(result.filter).real.max() < 0
    H, D, F, Tj = (frequency_response(G, GRID) for G in (result.filter, Nd, Nf, T))
    noise = np.broadcast_to(np.diag(eps), (GRID.size, eps.size, eps.size))
    error = np.concatenate([-H @ D, Tj - H @ F, -H @ noise], axis=2)
    norms = np.linalg.svd(error, compute_uv=False)[:, 0]
    assert norms.max() <= result.gamma * (1 + 1e-4)
    assert norms.max() >= result.lower_bound * (1 - 1e-3)
    plain = np.linalg.svd(error[:, :, : -eps.size], compute_uv=False)[:, 0]
    assert plain.max() <= result.plain_gamma * (1 + 1e-4)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("measurements", [2, 3])
def test_isolation_on_a_stiff_plant(seed: int, measurements: int) -> None:
    """One disturbance, two faults: with two measurements no filter exists, as the bound says; with three there is."""
    system = abcd(stiff_plant(seed))
    sizes = np.array([200.0, 0.1, 0.05])[:measurements]
    plant = Abcd(system.A, system.B, system.C[:measurements], system.D[:measurements])
    excited = plant.B * np.array([1.0, 0.01, 0.01, 1.0])
    L = filter_gain(plant, excited @ excited.T, sizes**2)
    zero = np.zeros((measurements, 1))
    Nd = coprime_factor(plant, L, 0.02 * plant.B[:, 2:3], zero)
    sensor = 5000.0 * np.eye(measurements)[:, :1]
    Nf = coprime_factor(plant, L, np.hstack([4.0 * plant.B[:, :1], np.zeros((11, 1))]), np.hstack([zero, sensor]))
    T = append(siso([1], [10, 1]), siso([1], [10, 1]))
    eps = 0.1 * sizes
    result = isolation_synthesis(Nd, Nf, T, eps)
    assert result.filter.nstates == 13  # 11 shared by Nd and Nf, 2 of T
    assert 0 <= result.suboptimality <= 0.01
    assert_isolation(result, Nd, Nf, T, eps)
    if measurements == 2:
        assert result.plain_lower_bound > 0.9
    else:
        assert result.plain_lower_bound < 1e-6
        assert result.gamma < 0.98


def test_isolated_residuals_follow_their_faults() -> None:
    """Step responses of `H [Nd Nf]`: each fault in its own residual as T has it, nothing from the disturbance."""
    system = random_system(21, 5, 3, 3, stable=True, direct=False)
    L = filter_gain(system)
    Nd = coprime_factor(system, L, system.B[:, :1], np.zeros((3, 1)))
    Nf = coprime_factor(system, L, np.c_[system.B[:, 1], np.zeros(5)], np.c_[np.zeros(3), [1.0, 0, 0]])
    T = append(siso([1], [10, 1]), siso([1], [10, 1]))
    H, gamma = isolation_filter(Nd, Nf, T, 1e-4)
    response = control.step_response(control.ss(*gimc.series(H, gimc.stack_inputs(Nd, Nf))), np.linspace(0, 60, 400))
    wanted = 1 - np.exp(-response.time / 10)
    expected = np.zeros_like(response.outputs)
    expected[0, 1], expected[1, 2] = wanted, wanted
    assert np.abs(response.outputs - expected).max() <= 3 * gamma
    assert gamma < 0.1


def test_smaller_noise_never_worsens_the_match() -> None:
    system = random_system(22, 4, 2, 2, stable=True, direct=False)
    Nd = Abcd(system.A, system.B[:, :1], system.C, np.zeros((2, 1)))
    Nf = Abcd(system.A, system.B[:, 1:], system.C, np.zeros((2, 1)))
    found = [isolation_synthesis(Nd, Nf, siso([1], [10, 1]), eps) for eps in (1.0, 0.1, 0.01, 1e-3, 1e-4)]
    gammas = [result.gamma for result in found]
    assert all(smaller <= 1.01 * larger for larger, smaller in pairwise(gammas))
    assert gammas[0] > 2 * gammas[-1]


def test_bound_is_exact_for_constants() -> None:
    """Parrott's theorem: for constant matrices a static filter reaches the bound."""
    random = np.random.default_rng(5)
    P = np.zeros((5, 6))
    P[:3, :4], P[:3, 4:], P[3:, :4] = random.normal(size=(3, 4)), random.normal(size=(3, 2)), random.normal(size=(2, 4))
    bound, _ = matching_lower_bound(abcd(P), 2, 2)
    result = model_matching(abcd(P), 2, 2, rtol=1e-6, backoff=1e-4)
    assert result.gamma == pytest.approx(bound, rel=2e-4)


def test_weak_penalty_and_noise_regularise() -> None:
    """P12 and P21 strictly proper: refused by name without rho and eps, solved with them, gamma falling towards 0."""
    P = matching_plant(siso([1], [1, 1]), siso([1], [1, 2]), siso([1], [1, 3]))
    with pytest.raises(gimc.RankDeficientD12Error, match="penalty"):
        model_matching(P, 1, 1)
    with pytest.raises(gimc.RankDeficientD21Error, match="noise"):
        model_matching(P, 1, 1, rho=1e-2)
    gammas = [model_matching(P, 1, 1, rho=size, eps=size).plain_gamma for size in (1e-1, 1e-2, 1e-3)]
    assert gammas[0] > 2 * gammas[1] > 4 * gammas[2]


def test_errors() -> None:
    lag, unstable = siso([1], [1, 1]), siso([1], [1, -1])
    with pytest.raises(gimc.UnstableError, match="Nf has to be stable"):
        isolation_filter(lag, unstable, lag, 0.1)
    with pytest.raises(ValueError, match="Nf has shape"):
        isolation_filter(append(lag, lag), lag, lag, 0.1)
    with pytest.raises(ValueError, match="eps = 0"):
        isolation_filter(lag, lag, lag, 0)
    with pytest.raises(gimc.UnstableError, match="stable"):
        model_matching(matching_plant(unstable, abcd(1.0), abcd(1.0)), 1, 1)
    closed_loop = Abcd(-np.eye(1), np.ones((1, 2)), np.ones((2, 1)), np.array([[0, 1.0], [1, 0.5]]))
    with pytest.raises(gimc.SynthesisError, match="not zero"):
        model_matching(closed_loop, 1, 1)


@pytest.mark.parametrize("seed", [16, 72, 75, 83, 101])
@pytest.mark.parametrize("eps", [0.1, 1e-3])
def test_bounds_are_bounds(seed: int, eps: float) -> None:
    """Gains of 1e10 within a chain of three lags leave directions that rounding decides: no bound from those."""
    random = np.random.default_rng(seed)
    A = np.array([[-4.0, 1e5, 0], [0, -2, -1e5], [0, 0, -3]])
    p, nd = int(random.integers(1, 3)), int(random.integers(1, 3))
    B, C, D = (
        random.integers(low, high, shape).astype(float)
        for low, high, shape in ((-3, 4, (3, nd + 1)), (-3, 4, (p, 3)), (-2, 3, (p, nd + 1)))
    )
    Nd, Nf = Abcd(A, B[:, :nd], C, D[:, :nd]), Abcd(A, B[:, nd:], C, D[:, nd:])
    result = isolation_synthesis(Nd, Nf, siso([1], [1, 1]), eps)
    assert result.plain_lower_bound <= result.plain_gamma * (1 + 1e-6)
    assert result.lower_bound <= result.gamma * (1 + 1e-6)
