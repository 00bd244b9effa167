"""H-infinity synthesis whatever the units and however small the noise: exact optima, scaling, assumptions by name.

Values called exact: smallest level at which both Riccati equations have nonnegative stabilising solutions and
`rho(X Y) < gamma^2`, by the matrix sign function in 400-bit arithmetic.
"""

import json
from itertools import pairwise
from pathlib import Path

import control
import numpy as np
import pytest
import scipy.optimize
from synthesis_problems import (
    integer_plant,
    integer_regulator,
    lmi_optimum,
    plant_with_axis_zero,
    regulator,
    scaled,
    square_minimum_phase_plant,
)

import gimc
from gimc import Abcd, HinfResult, hinf_norm, hinf_synthesis, lft, poles, state_space, sweep_norm

NOISES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
SCALES = (1e-6, 1e-4, 1e-3, 1.0, 1e2, 1e4, 1e6)

#: Refusals that say what is wrong with the problem.
ASSUMPTIONS = (
    gimc.NotStabilisableError,
    gimc.NotDetectableError,
    gimc.RankDeficientD12Error,
    gimc.RankDeficientD21Error,
    gimc.ImaginaryAxisZeroError,
)


def matrices(*rows: list[list[float]]) -> Abcd:
    return Abcd(*(np.array(matrix, dtype=float) for matrix in rows))


def assert_loop(P: Abcd, nmeas: int, ncon: int, result: HinfResult) -> None:
    """Stability and norm of the loop that python-control closes, by its norm, ours and the sweep."""
    loop = lft(P, result.controller, nmeas, ncon)
    closed = state_space(P).lft(result.controller, ncon, nmeas)
    assert poles(loop).real.max() < 0
    assert hinf_norm(loop)[0] == pytest.approx(result.gamma, rel=1e-5)
    assert sweep_norm(loop)[0] == pytest.approx(result.gamma, rel=2e-3)
    assert control.linfnorm(closed, 1e-6)[0] == pytest.approx(result.gamma, rel=2e-3)


def assert_optimum(P: Abcd, nmeas: int, ncon: int, exact: float, above: float = 0.01) -> None:
    result = hinf_synthesis(P, nmeas, ncon)
    assert result.lower_gamma <= exact * (1 + 1e-4)
    assert exact * (1 - 1e-4) <= result.optimal_gamma <= 1.002 * exact
    assert exact * (1 - 1e-4) <= result.gamma <= (1 + above) * exact
    assert_loop(P, nmeas, ncon, result)


@pytest.mark.parametrize("noise", NOISES)
def test_all_states_measured_with_little_noise(noise: float) -> None:
    """Below the optimum the Riccati equation has solutions that do not stabilise: they prove nothing."""
    exact = {1e-2: 0.328128, 1e-3: 0.327831, 1e-4: 0.327821, 1e-5: 0.327821, 1e-6: 0.327821}[noise]
    P = regulator(np.array([[0.0, 1.0], [-2.0, -3.0]]), np.array([[-3.0], [-1.0]]), noise)
    assert_optimum(P, 2, 1, exact)


def test_state_feedback_is_the_limit_of_little_noise() -> None:
    """With x measured the optimum falls to that of a static feedback `u = F x`, found here by search over F alone."""
    A, B2 = np.array([[0.0, 1.0], [-2.0, -3.0]]), np.array([[-3.0], [-1.0]])
    gamma = hinf_synthesis(regulator(A, B2, 1e-6), 2, 1, rtol=1e-4, backoff=1e-3).gamma

    def norm(F: np.ndarray) -> float:
        loop = Abcd(A + B2 @ F[None], np.eye(2), np.vstack([np.eye(2), F[None]]), np.zeros((3, 2)))
        return hinf_norm(loop)[0] if poles(loop).real.max() < 0 else np.inf

    found = scipy.optimize.minimize(norm, [0.5, 0.5], method="Nelder-Mead", options={"maxiter": 800, "fatol": 1e-9})
    assert gamma == pytest.approx(found.fun, rel=2e-3)


def three_by_four() -> Abcd:
    return matrices(
        [[-3, -3, 0], [0, -3, 1], [-3, 5, -5]],
        [[-5, -2, 4, -3], [5, -2, -2, -4], [2, 4, 4, -4]],
        [[2, -1, -2], [3, 1, 4], [4, 4, -4]],
        [[0, 0, 0, 1], [0, -2, -3, 0], [-2, 2, 1, 0]],
    )


@pytest.mark.parametrize("scale", SCALES)
def test_unit_of_z(scale: float) -> None:
    P = three_by_four()
    assert lmi_optimum(P, 2, 1) == pytest.approx(1.765433, rel=1e-5)  # the exact value, by another route
    assert_optimum(scaled(P, 2, scale), 2, 1, 1.765433 * scale)


@pytest.mark.parametrize("seed", range(3000, 3030))
def test_integer_plants_in_any_unit_of_z(seed: int) -> None:
    """Either solved at every scale, with the same optimum, or refused at every scale for the same reason."""
    P, nmeas, ncon = integer_plant(seed)
    found: list[float | type[Exception]] = []
    for scale in (1e-6, 1e-3, 1.0, 1e3, 1e6):
        try:
            result = hinf_synthesis(scaled(P, nmeas, scale), nmeas, ncon)
        except ASSUMPTIONS as error:
            found.append(type(error))
            continue
        assert result.gamma <= 1.01 * result.optimal_gamma
        found.append(result.optimal_gamma / scale)
    if isinstance(found[2], float):
        assert found == pytest.approx([found[2]] * 5, rel=2e-3)
    else:
        assert found == [found[2]] * 5


@pytest.mark.parametrize("seed", range(4000, 4030))
def test_integer_plants_with_little_noise(seed: int) -> None:
    """None is refused without a reason in the problem, and less noise never makes the optimum larger."""
    optima = []
    for noise in NOISES:
        P, nmeas, ncon = integer_regulator(seed, noise)
        try:
            result = hinf_synthesis(P, nmeas, ncon)
        except ASSUMPTIONS:
            return
        assert result.gamma <= 1.05 * result.optimal_gamma  # at 1e-6 some controllers keep few digits
        assert_loop(P, nmeas, ncon, result)
        optima.append(result.optimal_gamma)
    assert all(smaller <= larger * (1 + 2e-3) for larger, smaller in pairwise(optima))


def test_optimum_zero() -> None:
    P = matrices([[-5]], [[0, -3]], [[-3], [3]], [[-3, 2], [-2, 0]])
    result = hinf_synthesis(P, 1, 1)
    assert result.gamma < 1e-12
    assert result.slowest_pole < 0


@pytest.mark.parametrize("seed", range(5000, 5020))
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_optimum_zero_of_square_plants(seed: int, scale: float) -> None:
    """`P11 + P12 Q P21` can be made zero when P12 and P21 have stable inverses: the loop is rounding, and stable."""
    P, nmeas, ncon = square_minimum_phase_plant(seed)
    P = scaled(P, nmeas, scale)
    result = hinf_synthesis(P, nmeas, ncon)
    assert result.gamma <= 1e-7 * scale
    assert poles(lft(P, result.controller, nmeas, ncon)).real.max() < 0


@pytest.mark.parametrize("scale", SCALES)
def test_zero_on_the_axis_in_any_unit(scale: float) -> None:
    """One state, seen by z only through u: nothing cancels in the pencil, whatever the unit of z."""
    P = matrices(
        [[-5]],
        [[-1, -5, 2]],
        [[1], [-1], [2], [-4]],
        [[0, 1, -1], [0, -1, -3], [0, 2, -3], [-1, 0, 0]],
    )
    with pytest.raises(gimc.ImaginaryAxisZeroError, match=r"P12 .* at 0 rad/s"):
        hinf_synthesis(scaled(P, 1, scale), 1, 2)


@pytest.mark.parametrize("seed", range(6000, 6040))
def test_integer_plants_with_zeros_on_the_axis(seed: int) -> None:
    P, nmeas, ncon = plant_with_axis_zero(seed)
    for scale in (1e-6, 1.0, 1e6):
        with pytest.raises(ASSUMPTIONS):
            hinf_synthesis(scaled(P, nmeas, scale), nmeas, ncon)


#: Exact optima of COMPleib models (Leibfritz 2004) with penalty and noise 1e-3 and 1e-5 where the model has none.
COMPLEIB = {
    "AC3": (2.96928, 2.96752), "AC4": (0.557292, 0.557292), "AC8": (1.61654, 1.61654), "AC11": (2.8082, 2.80802),
    "AC15": (14.8636, 14.8636), "AC16": (14.8557, 14.8557), "AC17": (6.61258, 6.61258), "HE1": (0.0741394, 0.0736225),
    "HE4": (22.845, 22.8386), "REA1": (0.861755, 0.861755), "REA2": (1.13415, 1.13415), "REA3": (74.2523, 74.2523),
    "TG1": (3.46537, 3.46537), "AGS": (8.17332, 8.17332), "WEC1": (3.63645, 3.63645), "WEC2": (3.59827, 3.59827),
    "WEC3": (3.76861, 3.76861), "BDT1": (0.266227, 0.266227), "NN2": (1.7646, 1.76449),
    "NN10": (0.00373618, 3.69834e-05), "NN12": (6.29126, 6.28341), "NN15": (0.0977489, 0.0977428),
    "DIS1": (4.15946, 4.15946), "MFP": (4.18761, 4.18656), "PSM": (0.920282, 0.920282), "EB1": (3.10422, 3.10422),
    "EB2": (1.76768, 1.76768),
}  # fmt: skip


def compleib(name: str, size: float) -> tuple[Abcd, int, int]:
    """Return a COMPleib model, with penalty and noise of that size where its D12 or D21 has no full rank."""
    file = Path(__file__).parents[3] / "shared" / "data" / "compleib.json"
    if not file.exists():
        pytest.skip("shared/data/compleib.json is not there")
    model = {key: np.array(value, dtype=float) for key, value in json.loads(file.read_text())[name].items()}
    A, B1, B2, C1, C2, D11, D12, D21 = (model[key] for key in ("A", "B1", "B", "C1", "C", "D11", "D12", "D21"))
    n, ncon, nmeas = A.shape[0], B2.shape[1], C2.shape[0]
    if np.linalg.matrix_rank(D12) < ncon:
        C1, D11 = np.vstack([C1, np.zeros((ncon, n))]), np.vstack([D11, np.zeros((ncon, D11.shape[1]))])
        D12 = np.vstack([D12, size * np.eye(ncon)])
    if np.linalg.matrix_rank(D21) < nmeas:
        B1, D11 = np.hstack([B1, np.zeros((n, nmeas))]), np.hstack([D11, np.zeros((D11.shape[0], nmeas))])
        D21 = np.hstack([D21, size * np.eye(nmeas)])
    D = np.block([[D11, D12], [D21, np.zeros((nmeas, ncon))]])
    return Abcd(A, np.hstack([B1, B2]), np.vstack([C1, C2]), D), nmeas, ncon


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize("name", COMPLEIB)
def test_compleib(name: str, which: int) -> None:
    P, nmeas, ncon = compleib(name, (1e-3, 1e-5)[which])
    result = hinf_synthesis(P, nmeas, ncon)
    exact = COMPLEIB[name][which]  # six digits, found to 1e-4
    assert exact * (1 - 3e-4) <= result.optimal_gamma <= 1.002 * exact
    assert exact * (1 - 3e-4) <= result.gamma <= 1.01 * exact


@pytest.mark.parametrize("name", ["ROC7", "TF1"])
def test_compleib_with_a_mode_at_zero_that_z_or_w_does_not_touch(name: str) -> None:
    with pytest.raises(gimc.ImaginaryAxisZeroError, match="at 0 rad/s"):
        hinf_synthesis(*compleib(name, 1e-3))


def test_compleib_of_21_states() -> None:
    P, nmeas, ncon = compleib("JE2", 1e-3)
    result = hinf_synthesis(P, nmeas, ncon)
    assert result.gamma <= 1.01 * result.optimal_gamma
    assert_loop(P, nmeas, ncon, result)
