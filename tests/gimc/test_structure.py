"""Lemma 1 of the paper, frequency by frequency, against the loop in state space."""

import control
import numpy as np
import pytest

from gimc.structure import FaultySystem, closed_loop, disturbance_factor, fault_factor


def random_loop(seed: int) -> tuple[FaultySystem, np.ndarray, control.StateSpace, np.ndarray]:
    """A stable random plant with three measurements, its observer gain, a controller of two of them and its gain."""
    random = np.random.default_rng(seed)
    n, m, p = 5, 2, 3
    A = random.normal(size=(n, n)) - 4.0 * np.eye(n)
    system = FaultySystem(
        A=A,
        B=random.normal(size=(n, m)),
        C=random.normal(size=(p, n)),
        D=np.zeros((p, m)),
        E1=random.normal(size=(n, 1)),
        E2=random.normal(size=(p, 1)),
        F1=random.normal(size=(n, 2)),
        F2=random.normal(size=(p, 2)),
    )
    K = control.ss(-np.eye(2), random.normal(size=(2, 2)), random.normal(size=(m, 2)), random.normal(size=(m, 2)))
    return system, 0.3 * random.normal(size=(n, p)), K, 0.2 * random.normal(size=(2, m))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("omega", [0.01, 0.7, 30.0])
def test_lemma_1(seed: int, omega: float) -> None:
    system, L, K, Lk = random_loop(seed)
    s = 1j * omega
    n, eye2, eye3 = len(system.A), np.eye(2), np.eye(3)
    observer = np.linalg.inv(s * np.eye(n) - system.A - L @ system.C)
    M = eye3 + system.C @ observer @ L
    N = system.C @ observer @ system.B
    Nd, Nf = disturbance_factor(system, L)(s), fault_factor(system, L)(s)
    factor = K.C @ np.linalg.inv(s * eye2 - K.A - Lk @ K.C)
    V, U = eye2 + factor @ Lk, (factor @ (K.B + Lk @ K.D) + K.D) @ np.eye(2, 3)  # K reads two of three outputs
    Q = np.array([[0.3, -0.1, 0.2], [0.5, 0.4, -0.6]]) / (s + 1.0)

    Kw, P = np.linalg.solve(V, U), np.linalg.solve(M, N)
    So, Si = np.linalg.inv(eye3 + P @ Kw), np.linalg.inv(eye2 + Kw @ P)
    hit = np.hstack([Nd, Nf])
    u_lemma = -Si @ np.linalg.solve(V, (U @ np.linalg.inv(M) + Q) @ hit)
    y_lemma = So @ np.linalg.solve(M, (eye3 - N @ np.linalg.solve(V, Q)) @ hit)

    loop = closed_loop(system, K, Lk)(s)
    from_q = loop[:, 5:] @ (-Q @ hit)  # q = Q f_e and f_e = -(N~d d + N~f f)
    assert loop[:2, 2:5] + from_q[:2] == pytest.approx(u_lemma, rel=1e-9, abs=1e-10)
    assert loop[2:, 2:5] + from_q[2:] == pytest.approx(y_lemma, rel=1e-9, abs=1e-10)
    assert loop[:2, :2] == pytest.approx(Si @ Kw[:, :2], rel=1e-9, abs=1e-10)


def test_a_direct_feedthrough_is_refused() -> None:
    system, _, K, Lk = random_loop(0)
    fed_through = FaultySystem(**{**system.__dict__, "D": np.ones((3, 2))})
    with pytest.raises(ValueError, match="direct feedthrough"):
        closed_loop(fed_through, K, Lk)
