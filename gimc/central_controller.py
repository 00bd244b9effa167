"""Feasibility of one level of an H-infinity problem, and the central controller of a feasible one.

The formulas are those of Glover and Doyle (Syst. Control Lett. 11, 1988) as printed in Zhou, Doyle and Glover, "Robust
and Optimal Control" (1996), section 17.1, which allow any D11.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from gimc.errors import IllPosedError, RiccatiError
from gimc.interconnect import Abcd, Matrix, safe_inverse
from gimc.riccati import care, hinf_are, lyapunov
from gimc.scaling import balance_states
from gimc.standard_form import Standard

Route = Literal["balanced", "plain", "hamiltonian"]

ROUTES: tuple[Route, ...] = ("balanced", "plain", "hamiltonian")
NEWTON_TOLERANCE = 1e-6  # last step, relative to the solution
NEWTON_STEPS = 4
PENCIL_TOLERANCE = 1e-4  # first step below which the pencil's solution has more digits than Newton's residual


@dataclass(frozen=True)
class Level:
    """Both Riccati solutions at one level gamma, and the route by which they were found."""

    gamma: float
    route: Route
    X: Matrix
    Y: Matrix
    F: Matrix
    L: Matrix


def solve_level(standard: Standard, gamma: float, *, route: Route = "balanced") -> Level | None:
    """Riccati solutions X and Y at level gamma, or None where the level is infeasible (Zhou, theorem 17.1)."""
    A, B, C, D = standard.sys
    m1, _, p1, _ = standard.dims
    B1, C1, D1, Dt = B[:, :m1], C[:p1], D[:p1], D[:, :m1]  # D1. and D.1
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        try:
            X, F = _feedback(A, B, C1, D1, m1, gamma, route)
            if not _nonnegative(A, B[:, m1:], C1, D1[:, m1:], X):
                return None
            Y, Lt = _feedback(A.T, C.T, B1.T, Dt.T, p1, gamma, route)
            if not _nonnegative(A.T, C[p1:].T, B1.T, Dt[p1:].T, Y):
                return None
            return Level(gamma, route, X, Y, F, Lt.T) if _coupling(X, Y) < gamma**2 else None
        except (ValueError, np.linalg.LinAlgError):  # RiccatiError, or numbers beyond all bounds
            return None


def _feedback(
    A: Matrix, B: Matrix, C1: Matrix, D1: Matrix, m1: int, gamma: float, route: Route
) -> tuple[Matrix, Matrix]:
    """Solution X of the H-infinity Riccati equation and the feedback `F = -R^-1 (D1' C1 + B' X)`, A + B F stable."""
    R = D1.T @ D1
    R[:m1, :m1] -= gamma**2 * np.eye(m1)

    def feedback(X: Matrix) -> Matrix:
        F = np.asarray(-np.linalg.solve(R, D1.T @ C1 + B.T @ X))
        if (np.linalg.eigvals(A + B @ F).real >= 0).any():
            raise RiccatiError("the solution is not the stabilising one")
        return F

    def refined(X: Matrix, enough: float) -> Matrix:
        """X after Newton's method, or as it is where the first step is not above `enough`."""
        for i in range(NEWTON_STEPS):
            F = feedback(X)
            step = lyapunov((A + B @ F).T, A.T @ X + X @ A + C1.T @ C1 - F.T @ R @ F)
            size = np.linalg.norm(step) / np.linalg.norm(X)
            if i == 0 and size <= enough:
                return X
            X = X + step
            if size <= NEWTON_TOLERANCE:
                return X
        raise RiccatiError("Newton's method does not end")

    if route == "hamiltonian":
        cross = np.linalg.solve(R, D1.T @ C1)
        Q, G = C1.T @ C1 - C1.T @ D1 @ cross, B @ np.linalg.solve(R, B.T)
        X = refined(care(A - B @ cross, 0.5 * (G + G.T), 0.5 * (Q + Q.T), refine=False), 0.0)
        return X, feedback(X)
    X = hinf_are(A, B, C1, D1, m1, gamma, balanced=route == "balanced")
    F = feedback(X)
    try:
        X = refined(X, PENCIL_TOLERANCE)
        return X, feedback(X)
    except RiccatiError:  # the residual is made of squares: with little noise the pencil has digits that it has not
        return X, F


def _nonnegative(A: Matrix, B2: Matrix, C1: Matrix, D12: Matrix, X: Matrix) -> bool:
    """Whether `X >= 0`, asked in a way that rounding and units do not disturb (X may be zero, or span ten decades).

    Without disturbance the best control is `u = -(D12' C1 + B2' X) x`, and along the trajectories x' X x falls. As X is
    the stabilising solution it is nonnegative exactly when this closed loop is stable.
    """
    closed = A - B2 @ (D12.T @ C1 + B2.T @ X)
    return bool((np.linalg.eigvals(closed).real < 0).all())


def _coupling(X: Matrix, Y: Matrix) -> float:
    """Spectral radius of X Y."""
    return float(np.abs(np.linalg.eigvals(X @ Y)).max()) if X.size else 0.0


def parrott_bound(standard: Standard) -> float:
    """No level below this is feasible: the part of D11 that no controller reaches."""
    m1, m2, p1, p2 = standard.dims
    D11 = standard.sys.D[:p1, :m1]
    return max(_largest(D11[: p1 - m2]), _largest(D11[:, : m1 - p2]))


def _largest(matrix: Matrix) -> float:
    return float(np.linalg.norm(matrix, 2)) if matrix.size else 0.0


def central_controller(standard: Standard, level: Level) -> Abcd:
    """Central controller for D22 = 0 (Zhou, theorem 17.1), then back through the scalings and D22."""
    A, B, C, D = standard.sys
    m1, m2, p1, p2 = standard.dims
    gamma2 = level.gamma**2
    D11, B2, C2 = D[:p1, :m1], B[:, m1:], C[p1:]
    D1111, D1112 = D11[: p1 - m2, : m1 - p2], D11[: p1 - m2, m1 - p2 :]
    D1121, D1122 = D11[p1 - m2 :, : m1 - p2], D11[p1 - m2 :, m1 - p2 :]
    Dk = -D1122 - D1121 @ np.linalg.solve(gamma2 * np.eye(m1 - p2) - D1111.T @ D1111, D1111.T @ D1112)
    F, L = level.F, level.L
    F12, F2 = F[m1 - p2 : m1], F[m1:]
    L12, L2 = L[:, p1 - m2 : p1], L[:, p1:]
    Z = np.eye(A.shape[0]) - level.Y @ level.X / gamma2
    try:
        Bk = np.linalg.solve(Z, -L2 + (B2 + L12) @ Dk)
    except np.linalg.LinAlgError:
        raise IllPosedError(f"I - Y X / gamma^2 is singular at level {level.gamma:.6g}") from None
    Ck = F2 - Dk @ (C2 + F12)
    Ak = A + B @ F - Bk @ (C2 + F12)
    Bk, Ck, Dk = Bk @ standard.Ry, standard.Ru @ Ck, standard.Ru @ Dk @ standard.Ry
    return _absorb_d22(balance_states(Abcd(Ak, Bk, Ck, Dk)), standard.D22)


def _absorb_d22(K: Abcd, D22: Matrix) -> Abcd:
    """Controller for the plant with D22 from the one for D22 = 0: `K (I + D22 K)^-1`."""
    if not D22.any():
        return K
    E = safe_inverse(np.eye(D22.shape[0]) + D22 @ K.D, "I + D22 D_K")
    C = E @ D22 @ K.C
    return Abcd(K.A - K.B @ C, K.B @ E, K.C - K.D @ C, K.D @ E)
