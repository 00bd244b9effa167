"""Synthesis problems with known optima, and independent ways to an optimum."""

import control
import cvxpy
import numpy as np
import scipy.linalg

from gimc import Abcd, abcd, append, connect, scale


def siso(numerator: list[float], denominator: list[float]) -> Abcd:
    return abcd(control.tf(numerator, denominator))


def mixed_sensitivity(G: Abcd, W1: Abcd, W2: Abcd, W3: Abcd | None = None) -> Abcd:
    """From [w, u] to [W1 e, W2 u, W3 y, e] with y = G u, e = w - y."""
    p, m = G.D.shape
    blocks = append(G, W1, W2) if W3 is None else append(G, W1, W2, W3)
    q1, q2, q3 = W1.D.shape[0], W2.D.shape[0], 0 if W3 is None else W3.D.shape[0]
    inputs, outputs = blocks.D.shape[1], blocks.D.shape[0]
    feedback = np.zeros((inputs, outputs))
    external = np.zeros((inputs, p + m))
    external[:m, p:] = np.eye(m)  # u into G
    feedback[m : m + p, :p] = -np.eye(p)  # e into W1
    external[m : m + p, :p] = np.eye(p)
    external[m + p : 2 * m + p, p:] = np.eye(m)  # u into W2
    if W3 is not None:
        feedback[2 * m + p :, :p] = np.eye(p)
    z = np.hstack([np.zeros((q1 + q2 + q3, p)), np.eye(q1 + q2 + q3)])
    e = np.hstack([-np.eye(p), np.zeros((p, q1 + q2 + q3))])
    through = np.zeros((q1 + q2 + q3 + p, p + m))
    through[-p:, :p] = np.eye(p)
    return connect(blocks, feedback, external, np.vstack([z, e]), through)


def performance_weight(bandwidth: float, peak: float = 1.5, floor: float = 1e-4) -> Abcd:
    """(s/M + wB) / (s + wB A), Skogestad and Postlethwaite's form."""
    return siso([1 / peak, bandwidth], [1, bandwidth * floor])


def normalised_coprime_plant(G: Abcd) -> Abcd:
    """Robust stabilisation of normalised coprime factors: [w1, w2, u] to [u, y, y], `y = w1 + G (w2 + u)`.

    Glover and McFarlane (1989): the optimum is sqrt(1 + lambda_max(X Z)) without any iteration.
    """
    A, B, C, D = G
    p, m = D.shape
    zero = np.zeros
    outputs = np.vstack([zero((m, A.shape[0])), C, C])
    top = np.hstack([zero((m, p)), zero((m, m)), np.eye(m)])
    y = np.hstack([np.eye(p), D, D])
    return Abcd(A, np.hstack([zero((A.shape[0], p)), B, B]), outputs, np.vstack([top, y, y]))


def normalised_coprime_optimum(G: Abcd) -> float:
    """sqrt(1 + lambda_max(X Z)), Zhou, Doyle and Glover, theorem 18.1 and corollary 18.2, by scipy's Riccati solver."""
    A, B, C, D = G
    X = scipy.linalg.solve_continuous_are(A, B, C.T @ C, np.eye(B.shape[1]) + D.T @ D, s=C.T @ D)
    Z = scipy.linalg.solve_continuous_are(A.T, C.T, B @ B.T, np.eye(C.shape[0]) + D @ D.T, s=B @ D.T)
    return float(np.sqrt(1.0 + np.linalg.eigvals(X @ Z).real.max()))


def lmi_optimum(P: Abcd, nmeas: int, ncon: int) -> float:
    """Optimal norm over all controllers from the LMI of Gahinet and Apkarian (Int. J. Robust Nonlin. 4, 1994)."""
    A, B, C, D = P
    n, p1, m1 = A.shape[0], D.shape[0] - nmeas, D.shape[1] - ncon
    B1, B2, C1, C2 = B[:, :m1], B[:, m1:], C[:p1], C[p1:]
    D11, D12, D21 = D[:p1, :m1], D[:p1, m1:], D[p1:, :m1]
    R, S = cvxpy.Variable((n, n), symmetric=True), cvxpy.Variable((n, n), symmetric=True)
    gamma = cvxpy.Variable()
    NR = scipy.linalg.block_diag(scipy.linalg.null_space(np.hstack([B2.T, D12.T])), np.eye(m1))
    NS = scipy.linalg.block_diag(scipy.linalg.null_space(np.hstack([C2, D21])), np.eye(p1))
    left = cvxpy.bmat([
        [A @ R + R @ A.T, R @ C1.T, B1],
        [C1 @ R, -gamma * np.eye(p1), D11],
        [B1.T, D11.T, -gamma * np.eye(m1)],
    ])  # fmt: skip
    right = cvxpy.bmat([
        [A.T @ S + S @ A, S @ B1, C1.T],
        [B1.T @ S, -gamma * np.eye(m1), D11.T],
        [C1, D11, -gamma * np.eye(p1)],
    ])  # fmt: skip
    coupling = cvxpy.bmat([[R, np.eye(n)], [np.eye(n), S]])
    symmetric = [0.5 * (M + M.T) for M in (NR.T @ left @ NR, NS.T @ right @ NS)]
    problem = cvxpy.Problem(cvxpy.Minimize(gamma), [symmetric[0] << 0, symmetric[1] << 0, coupling >> 0])
    problem.solve(solver=cvxpy.CLARABEL)
    return float(gamma.value)


def matching_plant(T1: Abcd, T2: Abcd, T3: Abcd) -> Abcd:
    """Return [[T1, -T2], [T3, 0]], for `min || T1 - T2 Q T3 ||` over stable Q."""
    blocks = append(T1, T2, T3)
    (p1, m1), m2, p2 = T1.D.shape, T2.D.shape[1], T3.D.shape[0]
    split = np.zeros((2 * m1 + m2, m1 + m2))
    split[:m1, :m1] = np.eye(m1)
    split[m1 : m1 + m2, m1:] = np.eye(m2)
    split[m1 + m2 :, :m1] = np.eye(m1)
    join = np.zeros((p1 + p2, 2 * p1 + p2))
    join[:p1, :p1], join[:p1, p1 : 2 * p1], join[p1:, 2 * p1 :] = np.eye(p1), -np.eye(p1), np.eye(p2)
    return scale(blocks, join, split)


def nehari_distance(G: Abcd) -> float:
    """Distance of an antistable system from the stable ones: the Hankel norm of its mirror image (Nehari's theorem)."""
    mirrored = Abcd(-G.A, G.B, -G.C, G.D)
    Pc = scipy.linalg.solve_continuous_lyapunov(mirrored.A, -mirrored.B @ mirrored.B.T)
    Qo = scipy.linalg.solve_continuous_lyapunov(mirrored.A.T, -mirrored.C.T @ mirrored.C)
    return float(np.sqrt(np.linalg.eigvals(Pc @ Qo).real.max()))


def stiff_plant(seed: int) -> control.StateSpace:
    """Eleven states, poles from -600 to -1e-3 rad/s, states and outputs in units that differ by up to 1e9."""
    random = np.random.default_rng(seed)
    rates = np.array([600, 80, 20, 8, 3, 1, 0.4, 0.1, 0.05, 0.01, 0.001])
    n = rates.size
    A = np.diag(-rates) + np.triu(0.3 * random.normal(size=(n, n)) * np.sqrt(np.outer(rates, rates)), 1)
    mix = np.eye(n) + 0.3 * random.normal(size=(n, n))
    A = mix @ A @ np.linalg.inv(mix)
    B = mix @ (np.sqrt(rates)[:, None] * random.normal(size=(n, 4)))
    C = random.normal(size=(3, n)) @ np.linalg.inv(mix)
    units = 10.0 ** random.uniform(-3, 6, size=n)
    A, B, C = A * units[:, None] / units, B * units[:, None], C / units
    gain = np.abs(C @ np.linalg.solve(A, B)).mean(axis=1)
    C = C * (np.array([1e4, 3.0, 2.0]) / gain)[:, None]  # Pa, K, K
    B = B / np.array([20.0, 0.05, 0.01, 3.0])  # rad/s, opening, kg/s, K
    return control.ss(A, B, C, np.zeros((3, 4)))


def random_system(seed: int, n: int, m: int, p: int, *, stable: bool = False, direct: bool = True) -> Abcd:
    random = np.random.default_rng(seed)
    A = random.normal(size=(n, n))
    if stable:
        A = A - (np.linalg.eigvals(A).real.max() + random.uniform(0.05, 1.0)) * np.eye(n)
    D = random.normal(size=(p, m)) if direct else np.zeros((p, m))
    return Abcd(A, random.normal(size=(n, m)), random.normal(size=(p, n)), D)


def scaled(P: Abcd, nmeas: int, factor: float) -> Abcd:
    """Return the generalised plant with z in another unit: `factor` times as large."""
    rows = np.ones(P.D.shape[0])
    rows[: rows.size - nmeas] = factor
    return Abcd(P.A, P.B, P.C * rows[:, None], P.D * rows[:, None])


def regulator(A: np.ndarray, B2: np.ndarray, noise: float, penalty: float = 1.0, C2: np.ndarray | None = None) -> Abcd:
    """Return the plant with z = [x; penalty u], y = C2 x + noise, process noise on every state; C2 is I if left out."""
    n, m = B2.shape
    C2 = np.eye(n) if C2 is None else C2
    p = C2.shape[0]
    D = np.zeros((n + m + p, n + p + m))
    D[n : n + m, n + p :], D[n + m :, n : n + p] = penalty * np.eye(m), noise * np.eye(p)
    return Abcd(A, np.hstack([np.eye(n), np.zeros((n, p)), B2]), np.vstack([np.eye(n), np.zeros((m, n)), C2]), D)


def integer_regulator(seed: int, noise: float) -> tuple[Abcd, int, int]:
    """Return a `regulator` with entries from -5 to 5, one to four states, all states or some outputs measured."""
    random = np.random.default_rng(seed)
    n, m = int(random.integers(1, 5)), int(random.integers(1, 3))
    A, B2 = (random.integers(-5, 6, shape).astype(float) for shape in ((n, n), (n, m)))
    C2 = np.eye(n) if random.random() < 0.5 else random.integers(-5, 6, (int(random.integers(1, 3)), n)).astype(float)
    return regulator(A, B2, noise, 1.0, C2), C2.shape[0], m


def integer_plant(seed: int) -> tuple[Abcd, int, int]:
    """Return a generalised plant with entries from -5 to 5, D22 = 0."""
    random = np.random.default_rng(seed)
    n, ncon, nmeas = int(random.integers(1, 5)), int(random.integers(1, 3)), int(random.integers(1, 3))
    p, m = ncon + nmeas + int(random.integers(0, 3)), nmeas + ncon + int(random.integers(0, 3))
    A, B, C, D = (random.integers(-5, 6, shape).astype(float) for shape in ((n, n), (n, m), (p, n), (p, m)))
    D[p - nmeas :, m - ncon :] = 0.0
    return Abcd(A, B, C, D), nmeas, ncon


def plant_with_axis_zero(seed: int) -> tuple[Abcd, int, int]:
    """Return an integer plant whose P12 (odd seeds: P21) has a zero at 0 or 3 rad/s, exactly.

    z is blind to a mode of `A + B2 F`, since `C1 + D12 F` is zero there.
    """
    random = np.random.default_rng(seed)

    def integers(*shape: int) -> np.ndarray:
        return random.integers(-5, 6, shape).astype(float)

    n, ncon, nmeas = int(random.integers(1, 5)), int(random.integers(1, 3)), int(random.integers(1, 3))
    p1, m1 = ncon + int(random.integers(0, 3)), nmeas + int(random.integers(0, 3))
    k = 1 if n < 2 or random.random() < 0.4 else 2
    modes, seen = integers(n, n), integers(p1, n)
    modes[k:, :k], seen[:, :k] = 0.0, 0.0
    modes[:k, :k] = 0.0 if k == 1 else np.array([[0.0, 3.0], [-3.0, 0.0]])
    T = (np.triu(integers(n, n), 1) + np.eye(n)) @ (np.tril(integers(n, n), -1) + np.eye(n))  # determinant one
    inverse = np.round(np.linalg.inv(T))
    B2, D12, F = integers(n, ncon), integers(p1, ncon), integers(ncon, n)
    A, C1 = T @ modes @ inverse - B2 @ F, seen @ inverse - D12 @ F
    D = np.block([[integers(p1, m1), D12], [integers(nmeas, m1), np.zeros((nmeas, ncon))]])
    P = Abcd(A, np.hstack([integers(n, m1), B2]), np.vstack([C1, integers(nmeas, n)]), D)
    return (P, nmeas, ncon) if seed % 2 == 0 else (Abcd(P.A.T, P.C.T, P.B.T, P.D.T), ncon, nmeas)


def square_minimum_phase_plant(seed: int) -> tuple[Abcd, int, int]:
    """Return an integer plant whose optimum is zero: P12 and P21 square and invertible with all zeros stable."""
    random = np.random.default_rng(seed)
    while True:
        n, size = int(random.integers(1, 4)), int(random.integers(1, 3))
        shapes = ((n, n), (n, 2 * size), (2 * size, n), (2 * size, 2 * size))
        A, B, C, D = (random.integers(-5, 6, shape).astype(float) for shape in shapes)
        D[size:, size:] = 0.0
        D12, D21 = D[:size, size:], D[size:, :size]
        if abs(np.linalg.det(D12)) < 0.5 or abs(np.linalg.det(D21)) < 0.5:
            continue
        zeros = [
            np.linalg.eigvals(A - B[:, size:] @ np.linalg.solve(D12, C[:size])),
            np.linalg.eigvals(A - B[:, :size] @ np.linalg.solve(D21, C[size:])),
        ]
        if max(values.real.max() for values in zeros) < -0.1:
            return Abcd(A, B, C, D), size, size
