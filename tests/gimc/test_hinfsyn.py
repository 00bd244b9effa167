"""H-infinity synthesis against published optima, closed forms, an LMI, and SLICOT; and its errors."""

from collections.abc import Callable

import control
import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st
from published import PUBLISHED, Problem, dc_servo, mit, quadruple_tank, scherer_7, servo_2_17
from synthesis_problems import (
    lmi_optimum,
    mixed_sensitivity,
    normalised_coprime_optimum,
    normalised_coprime_plant,
    random_system,
    siso,
    stiff_plant,
)

import gimc
from gimc import Abcd, abcd, append, hinf_norm, hinf_synthesis, hinfsyn, lft, poles, series, state_space


@pytest.mark.parametrize("name", PUBLISHED)
def test_published_optimum(name: str) -> None:
    """Within 0.15 % of what is printed; where nothing is, of the LMI's optimum."""
    published = PUBLISHED[name]
    P, nmeas, ncon = published.problem()
    result = hinf_synthesis(P, nmeas, ncon, rtol=2e-4, backoff=1e-3)
    optimum = lmi_optimum(P, nmeas, ncon) if published.optimum is None else published.optimum
    assert optimum * (1 - 1e-3) - published.rounding <= result.gamma
    assert result.gamma <= (1.0015 + published.above) * optimum + published.rounding
    assert_closed_loop(P, nmeas, ncon, result.controller, result.gamma)


def assert_closed_loop(P: Abcd, nmeas: int, ncon: int, K: control.StateSpace, gamma: float) -> None:
    """Stability and norm once more, by python-control's own feedback and norm."""
    closed = state_space(P).lft(K, ncon, nmeas)
    assert closed.poles().real.max() < 0
    assert control.linfnorm(closed, 1e-6)[0] == pytest.approx(gamma, rel=2e-3)


@pytest.mark.parametrize("a", [-3.0, -0.5, 0.0, 0.7, 4.0])
def test_scalar_plant_closed_form(a: float) -> None:
    """Zhou, Doyle and Glover, section 16.4, on a scalar plant: X = Y = 1 / (-a + sqrt(a^2 + 1 - 1/gamma^2))."""
    P = Abcd(np.array([[a]]), np.array([[1.0, 0, 1]]), np.array([[1.0], [0], [1]]), np.zeros((3, 3)))
    P.D[1, 2] = P.D[2, 1] = 1.0

    def slack(gamma: float) -> float:
        return 1.0 / (-a + np.sqrt(a * a + 1.0 - gamma**-2)) - gamma

    lowest = 1.0 / np.sqrt(1.0 + a * a) if a < 0 else 1.0  # where X and Y begin to be positive
    exact = scipy.optimize.brentq(slack, lowest * (1.0 + 1e-9), 1e3)
    result = hinf_synthesis(P, 1, 1, rtol=1e-5, backoff=1e-3)
    assert result.optimal_gamma == pytest.approx(exact, rel=2e-5)
    assert exact * (1 - 1e-4) <= result.gamma <= exact * 1.0015


@pytest.mark.parametrize("seed", range(12))
def test_normalised_coprime_factors(seed: int) -> None:
    """Glover and McFarlane's optimum is known without iteration; D22 is not zero here."""
    G = random_system(seed, 2 + seed % 5, 1 + seed % 3, 1 + (seed + 1) % 3)
    exact = normalised_coprime_optimum(G)
    P = normalised_coprime_plant(G)
    K, gamma = hinfsyn(P, G.D.shape[0], G.D.shape[1])
    assert exact * (1 - 1e-6) <= gamma <= 1.01 * exact
    assert_closed_loop(P, G.D.shape[0], G.D.shape[1], K, gamma)


@pytest.mark.parametrize("seed", range(16))
def test_never_worse_than_lmi(seed: int) -> None:
    """Full D11 and D22, unstable plants, square and fat blocks: within one per cent of the convex optimum."""
    random = np.random.default_rng(seed)
    n, ncon, nmeas = int(random.integers(1, 5)), int(random.integers(1, 3)), int(random.integers(1, 3))
    p1, m1 = ncon + int(random.integers(0, 3)), nmeas + int(random.integers(0, 3))
    P = random_system(100 + seed, n, m1 + ncon, p1 + nmeas)
    best = lmi_optimum(P, nmeas, ncon)
    K, gamma = hinfsyn(P, nmeas, ncon)
    assert gamma <= 1.01 * best
    assert gamma >= 0.999 * best  # nothing beats the optimum
    assert_closed_loop(P, nmeas, ncon, K, gamma)


@pytest.mark.parametrize("problem", [dc_servo, scherer_7, mit, quadruple_tank, servo_2_17])
def test_never_worse_than_slicot(problem: Callable[[], Problem]) -> None:
    """Within one per cent of what SLICOT's controller achieves (which can be more than it claims)."""
    P, nmeas, ncon = problem()
    K, _, claimed, _ = control.hinfsyn(state_space(P), nmeas, ncon)
    achieved, _ = hinf_norm(lft(P, K, nmeas, ncon))
    _, gamma = hinfsyn(P, nmeas, ncon)
    assert gamma <= 1.01 * achieved
    assert gamma <= 1.01 * claimed


@pytest.mark.parametrize("seed", [10, 14])
def test_right_where_slicot_is_silently_wrong(seed: int) -> None:
    """SLICOT's sb10ad reports a norm that its controller does not have, below what the LMI says is possible."""
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 9))
    A, B = random.normal(size=(n, n)), random.normal(size=(n, 5))
    C, D = random.normal(size=(6, n)), random.normal(size=(6, 5))
    D[4:, 3:] = 0.0
    P = Abcd(A, B, C, D)
    K, _, claimed, _ = control.hinfsyn(state_space(P), 2, 2)
    achieved, _ = hinf_norm(lft(P, K, 2, 2))
    _, gamma = hinfsyn(P, 2, 2)
    assert claimed < 0.9 * achieved
    assert gamma < achieved
    assert gamma == pytest.approx(lmi_optimum(P, 2, 2), rel=0.01)


@pytest.mark.parametrize("problem", [servo_2_17, quadruple_tank, dc_servo])
def test_backoff(problem: Callable[[], Problem]) -> None:
    """The norm stays below the level asked for, and the controller's fastest pole comes down."""
    tight = hinf_synthesis(*problem(), backoff=1e-3)
    loose = hinf_synthesis(*problem(), backoff=5e-2)
    assert loose.claimed_gamma == pytest.approx(1.05 * loose.optimal_gamma)
    assert tight.gamma <= loose.gamma <= loose.claimed_gamma * (1 + 1e-6)
    assert np.abs(poles(loose.controller)).max() <= np.abs(poles(tight.controller)).max()


@pytest.mark.parametrize("seed", range(5))
def test_stiff_plant_in_si_units(seed: int) -> None:
    """Mixed sensitivity with near-integrators on a plant with poles from -600 to -1e-3 and entries up to 1e9."""
    system = abcd(stiff_plant(seed))
    G = Abcd(system.A, system.B[:, :2], system.C[:2], system.D[:2, :2])
    integrator = append(siso([0.5, 0.02], [1, 1e-4]), siso([0.5, 0.01], [1, 1e-4]))
    W1 = series(integrator, np.diag([1e-4, 1 / 3]))  # Pa and K to sizes of one
    P = mixed_sensitivity(G, W1, abcd(np.diag([1 / 100, 1 / 0.3])))
    P = gimc.scale(P, right=np.concatenate([[1e4, 3.0], [1.0, 1.0]]))
    result = hinf_synthesis(P, 2, 2)
    assert result.gamma <= 1.01 * result.optimal_gamma
    assert result.swept_gamma == pytest.approx(result.gamma, rel=1e-3)
    assert result.slowest_pole < 0
    # The same problem in other units of u and y has the same optimum.
    units = np.diag([1.0, 1.0, 1e-5, 1e4])
    other = gimc.scale(P, left=np.concatenate([np.ones(4), [1e-5, 1e3]]), right=units)
    assert hinfsyn(other, 2, 2)[1] == pytest.approx(result.gamma, rel=5e-3)


@given(st.integers(0, 10**6), st.integers(1, 6), st.integers(1, 2), st.integers(1, 2))
@settings(max_examples=25, deadline=None, derandomize=True)
def test_properties(seed: int, n: int, nmeas: int, ncon: int) -> None:
    """Internally stable, norm as claimed, and never below the part of D11 that no controller reaches."""
    P = random_system(seed, n, ncon + 3, nmeas + 3)
    result = hinf_synthesis(P, nmeas, ncon)
    closed = lft(P, result.controller, nmeas, ncon)
    assert poles(closed).real.max() < 0
    assert hinf_norm(closed)[0] <= result.claimed_gamma * (1 + 1e-3)
    D12, D21, D11 = P.D[:3, 3:], P.D[3:, :3], P.D[:3, :3]
    left = np.eye(3) - D12 @ np.linalg.pinv(D12)
    right = np.eye(3) - np.linalg.pinv(D21) @ D21
    assert result.gamma >= max(np.linalg.norm(left @ D11, 2), np.linalg.norm(D11 @ right, 2)) * (1 - 1e-9)


def simple() -> Abcd:
    D = np.array([[0, 0, 0], [0, 0, 1], [0, 1, 0.0]])
    return Abcd(np.diag([1.0, -2.0]), np.array([[1, 0, 1], [1, 0, 1.0]]), np.array([[1, 1], [0, 0], [1, 1.0]]), D)


def broken(**changes: object) -> Abcd:
    P = simple()
    for name, change in changes.items():
        change(getattr(P, name))  # type: ignore[operator]
    return P


def put(index: object, value: float) -> Callable[[np.ndarray], None]:
    def change(matrix: np.ndarray) -> None:
        matrix[index] = value

    return change


BROKEN = {
    "u does not reach": (broken(B=put((0, 2), 0.0)), gimc.NotStabilisableError),
    "y does not see": (broken(C=put((2, 0), 0.0)), gimc.NotDetectableError),
    "D12": (broken(D=put((1, 2), 0.0)), gimc.RankDeficientD12Error),
    "D21": (broken(D=put((2, 1), 0.0)), gimc.RankDeficientD21Error),
}


@pytest.mark.parametrize("words", BROKEN)
def test_broken_assumption_is_named(words: str) -> None:
    plant, error = BROKEN[words]
    with pytest.raises(error, match=words) as raised:
        hinfsyn(plant, 1, 1)
    assert "\n" not in str(raised.value)
    assert isinstance(raised.value, ValueError)


def test_zero_on_the_imaginary_axis_is_named() -> None:
    # z = [W y; u] would see the oscillator; with z = u only it is seen by nothing.
    A = np.array([[0, 2.0], [-2, 0]])
    P = Abcd(A, np.array([[1, 0, 0], [0, 0, 1.0]]), np.array([[0, 0], [1, 0.0]]), np.array([[0, 0, 1], [0, 1, 0.0]]))
    with pytest.raises(gimc.ImaginaryAxisZeroError, match="at 2 rad/s"):
        hinfsyn(P, 1, 1)
    dual = Abcd(P.A.T, P.C.T, P.B.T, P.D.T)
    with pytest.raises(gimc.ImaginaryAxisZeroError, match="P21"):
        hinfsyn(dual, 1, 1)


@pytest.mark.parametrize(("nmeas", "ncon"), [(0, 1), (3, 1), (1, 0), (1, 3)])
def test_wrong_numbers(nmeas: int, ncon: int) -> None:
    with pytest.raises(gimc.SynthesisError, match="must be a whole number from 1 to 2"):
        hinfsyn(simple(), nmeas, ncon)


def test_level_out_of_reach() -> None:
    with pytest.raises(gimc.InfeasibleError, match="gamma_max = 1"):
        hinfsyn(simple(), 1, 1, gamma_max=1.0)
    P, nmeas, ncon = mit()  # optimum 0.9234: within reach of a gamma_max below one
    assert hinfsyn(P, nmeas, ncon, gamma_max=0.95)[1] < 0.95
    with pytest.raises(gimc.InfeasibleError, match=r"gamma_max = 0\.92"):
        hinfsyn(P, nmeas, ncon, gamma_max=0.92)


def test_sampled_plant_is_refused() -> None:
    P = simple()
    with pytest.raises(ValueError, match="continuous-time"):
        hinfsyn(control.ss(*P, 0.1), 1, 1)


def test_mismatch_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    """A controller that does not reach the level it was made for is refused, whatever the formulas say."""
    module = __import__("sys").modules["gimc.hinfsyn"]
    honest = module.central_controller

    def spoilt(*arguments: object) -> Abcd:
        K = honest(*arguments)
        return Abcd(K.A, K.B, 0.8 * K.C, K.D)

    monkeypatch.setattr(module, "central_controller", spoilt)
    with pytest.raises(gimc.NormMismatchError, match="claimed norm"):
        hinfsyn(*servo_2_17())
