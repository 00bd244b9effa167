"""H-infinity synthesis for the general four-block problem: Riccati equations of Doyle, Glover, Khargonekar and Francis.

The formulas are those of Glover and Doyle (Syst. Control Lett. 11, 1988) as printed in Zhou, Doyle and Glover, "Robust
and Optimal Control" (1996), section 17.1, which allow any D11; D22 is taken out before and put back after (section
17.2).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gimc.errors import (
    IllPosedError,
    ImaginaryAxisZeroError,
    InfeasibleError,
    NormMismatchError,
    NotDetectableError,
    NotStabilisableError,
    RankDeficientD12Error,
    RankDeficientD21Error,
    RiccatiError,
    SynthesisError,
)
from gimc.interconnect import Abcd, Matrix, abcd, lft, safe_inverse, state_space
from gimc.modes import axis_zero, unreachable_mode
from gimc.norms import hinf_norm, poles, sweep_norm
from gimc.riccati import care, hinf_are
from gimc.scaling import balance_states

RANK_TOLERANCE = 1e-10  # singular values relative to the largest
NORM_TOLERANCE = 1e-3  # agreement asked of claimed and recomputed norms
FLOOR = 1e-9  # levels below this are not told from zero
BACKOFF_LADDER = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)  # multiples of the back-off tried before giving up


@dataclass(frozen=True)
class HinfResult:
    """What a synthesis found, and how it was checked.

    Attributes
    ----------
    controller : control.StateSpace
        K from measurements to control inputs.
    gamma : float
        H-infinity norm of the closed loop, recomputed from `lft(P, K)` by Hamiltonian bisection.
    frequency : float
        Where it is attained (rad/s).
    swept_gamma : float
        The same norm by an adaptive sweep over frequency.
    claimed_gamma : float
        Level the controller was designed for; `gamma` does not exceed it.
    optimal_gamma : float
        Smallest level found feasible by bisection; `lower_gamma` is the largest one found infeasible.
    lower_gamma : float
    slowest_pole : float
        Largest real part of the closed loop's eigenvalues (rad/s, negative).
    """

    controller: Any
    gamma: float
    frequency: float
    swept_gamma: float
    claimed_gamma: float
    optimal_gamma: float
    lower_gamma: float
    slowest_pole: float


@dataclass(frozen=True)
class _Standard:
    """Plant in the form of Zhou 17.1: D12 = [0; I], D21 = [0 I], D22 = 0; and the scalings that lead back.

    `y_scaled = Ry y`, `u = Ru u_scaled`; z and w are only rotated, so norms are those of the caller's problem.
    """

    sys: Abcd
    nmeas: int
    ncon: int
    Ru: Matrix
    Ry: Matrix
    D22: Matrix

    @property
    def dims(self) -> tuple[int, int, int, int]:
        """(m1, m2, p1, p2)."""
        p, m = self.sys.D.shape
        return m - self.ncon, self.ncon, p - self.nmeas, self.nmeas


@dataclass(frozen=True)
class _Level:
    """Both Riccati solutions at one level gamma."""

    gamma: float
    X: Matrix
    Y: Matrix
    F: Matrix
    L: Matrix


def hinfsyn(
    P: Any,
    nmeas: int,
    ncon: int,
    *,
    rtol: float = 1e-3,
    backoff: float = 5e-3,
    gamma_max: float = 1e8,
) -> tuple[Any, float]:
    """Controller that makes the H-infinity norm of `lft(P, K)` as small as `rtol` and `backoff` say.

    Parameters
    ----------
    P : control.StateSpace
        Generalised plant, inputs [w, u], outputs [z, y].
    nmeas, ncon : int
        Numbers of measurements y (last outputs) and control inputs u (last inputs).
    rtol : float
        Relative width of the bisection's last interval.
    backoff : float
        The controller is computed for (1 + backoff) times the smallest feasible level. At the optimum itself the
        controller has poles that grow without bound; a few per cent cost little and give a well-behaved controller.
    gamma_max : float
        Largest level to try.

    Returns
    -------
    K : control.StateSpace
        Controller, D_K corrected for D22.
    gamma : float
        H-infinity norm of the closed loop, recomputed.

    Raises
    ------
    SynthesisError
        One subclass for each broken assumption; see `gimc.errors`.
    """
    result = hinf_synthesis(P, nmeas, ncon, rtol=rtol, backoff=backoff, gamma_max=gamma_max)
    return result.controller, result.gamma


def hinf_synthesis(
    P: Any,
    nmeas: int,
    ncon: int,
    *,
    rtol: float = 1e-3,
    backoff: float = 5e-3,
    gamma_max: float = 1e8,
) -> HinfResult:
    """As `hinfsyn`, with everything that is known about the result."""
    plant = abcd(P, what="generalised plant")
    _check_numbers(plant, nmeas, ncon, rtol, backoff)
    standard = _standard_form(balance_states(plant), nmeas, ncon)
    best, lower = _bisect(standard, rtol, gamma_max)
    failures = ["no level above the optimum found feasible"]
    for level in _levels(standard, best, backoff):
        try:
            controller = _controller(standard, level)
            result = _verified(plant, controller, nmeas, ncon, level.gamma, best.gamma, lower)
            return _named(result, P, nmeas, ncon)
        except (NormMismatchError, IllPosedError) as error:
            failures.append(str(error))
    raise NormMismatchError(
        f"no controller near the optimum {best.gamma:.6g} passes the check of its closed loop, tried up to "
        f"{1 + BACKOFF_LADDER[-1] * max(backoff, 1e-3):.3g} times the optimum; last: {failures[-1]}. "
        "Penalise u or the noise on y more, or scale w and z to comparable size"
    )


# --- assumptions and standard form --------------------


def _check_numbers(plant: Abcd, nmeas: int, ncon: int, rtol: float, backoff: float) -> None:
    p, m = plant.D.shape
    if not 0 < nmeas < p:
        raise SynthesisError(f"nmeas = {nmeas}: the plant has {p} outputs, 1 to {p - 1} of them can be measurements")
    if not 0 < ncon < m:
        raise SynthesisError(f"ncon = {ncon}: the plant has {m} inputs, 1 to {m - 1} of them can be control inputs")
    if not rtol > 0:
        raise SynthesisError(f"rtol = {rtol}: must be positive")
    if not backoff >= 0:
        raise SynthesisError(f"backoff = {backoff}: must not be negative")


def _standard_form(plant: Abcd, nmeas: int, ncon: int) -> _Standard:
    """Rotate z and w, scale u and y, so that D12 = [0; I] and D21 = [0 I]; check every assumption on the way."""
    A, B, C, D = plant
    p1, m1 = D.shape[0] - nmeas, D.shape[1] - ncon
    Tz, Ru = _column_compression(D[:p1, m1:], RankDeficientD12Error, "D12", "control input", "add a penalty on u to z")
    Tw, Ry = _column_compression(D[p1:, :m1].T, RankDeficientD21Error, "D21", "measurement", "add a noise on y to w")
    left = np.zeros((p1 + nmeas, p1 + nmeas))
    left[:p1, :p1], left[p1:, p1:] = Tz.T, Ry.T
    right = np.zeros((m1 + ncon, m1 + ncon))
    right[:m1, :m1], right[m1:, m1:] = Tw, Ru
    Bs, Cs, Ds = B @ right, left @ C, left @ D @ right
    # Exact where they are known: rounding here would enter every Riccati equation.
    Ds[:p1, m1:] = np.eye(p1, ncon, k=ncon - p1)
    Ds[p1:, :m1] = np.eye(nmeas, m1, k=m1 - nmeas)
    Ds[p1:, m1:] = 0.0
    # States balanced again, now that y and u have their own scale.
    standard = _Standard(balance_states(Abcd(A, Bs, Cs, Ds)), nmeas, ncon, Ru, Ry.T, D[p1:, m1:])
    _check_modes(standard)
    _check_zeros(standard)
    return standard


def _column_compression(
    D12: Matrix, error: type[SynthesisError], name: str, signal: str, remedy: str
) -> tuple[Matrix, Matrix]:
    """Orthogonal T and invertible R with `T' D12 R = [0; I]`. Column scales are taken out before rank is judged."""
    rows, columns = D12.shape
    norms = np.linalg.norm(D12, axis=0)
    if rows < columns:
        raise error(f"{name} cannot have full rank: {columns} {signal}s against {rows} signals; {remedy}")
    if (norms == 0).any():
        raise error(f"{name}: {signal} {int(np.argmin(norms))} (counted from 0) has no direct term; {remedy}")
    U, s, Vt = np.linalg.svd(D12 / norms)
    if s[-1] <= RANK_TOLERANCE * s[0]:
        values = np.array2string(s, precision=3)
        raise error(f"{name} does not have full rank: singular values {values} with {signal}s normalised; {remedy}")
    T = np.hstack([U[:, columns:], U[:, :columns]])
    return T, Vt.T / s / norms[:, None]


def _check_modes(standard: _Standard) -> None:
    A, B, C, _ = standard.sys
    m1, _, p1, _ = standard.dims
    B2, C2 = B[:, m1:], C[p1:]
    mode = unreachable_mode(A, B2)
    if mode is not None:
        raise NotStabilisableError(
            f"(A, B2) is not stabilisable: u does not reach the mode at {_text(mode)} rad/s; "
            "give a weight that integrates a slow pole (for instance at -1e-4 rad/s) instead of one at or beyond 0"
        )
    mode = unreachable_mode(A.T, C2.T)
    if mode is not None:
        raise NotDetectableError(
            f"(C2, A) is not detectable: y does not see the mode at {_text(mode)} rad/s; "
            "give a weight that integrates a slow pole, or measure its output"
        )


def _check_zeros(standard: _Standard) -> None:
    """P12 and P21 have no zeros on the imaginary axis: else a Riccati equation never has a stabilising solution."""
    A, B, C, D = standard.sys
    m1, _, p1, _ = standard.dims
    D12, D21 = D[:p1, m1:], D[p1:, :m1]
    frequency = axis_zero(A - B[:, m1:] @ D12.T @ C[:p1], C[:p1] - D12 @ D12.T @ C[:p1])
    if frequency is not None:
        raise ImaginaryAxisZeroError(
            f"P12 (from u to z) has a zero on the imaginary axis at {frequency:.4g} rad/s: z is blind to the plant "
            "there; weight u or the plant's output at that frequency"
        )
    frequency = axis_zero((A - B[:, :m1] @ D21.T @ C[p1:]).T, (B[:, :m1] - B[:, :m1] @ D21.T @ D21).T)
    if frequency is not None:
        raise ImaginaryAxisZeroError(
            f"P21 (from w to y) has a zero on the imaginary axis at {frequency:.4g} rad/s: w does not excite the plant "
            "there; add a disturbance at the plant's input"
        )


def _text(mode: complex) -> str:
    return f"{mode.real:.4g}" if mode.imag == 0 else f"{mode:.4g}"


# --- one level --------------------


def _solve_level(standard: _Standard, gamma: float, *, by_schur: bool = False) -> _Level | None:
    """Riccati solutions X and Y at level gamma, or None where the level is infeasible (Zhou, theorem 17.1)."""
    A, B, C, D = standard.sys
    m1, _, p1, _ = standard.dims
    B1, C1, D1, Dt = B[:, :m1], C[:p1], D[:p1], D[:, :m1]  # D1. and D.1
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        try:
            X, F = _feedback(A, B, C1, D1, m1, gamma, by_schur=by_schur)
            if not _nonnegative(A, B[:, m1:], C1, D1[:, m1:], X):
                return None
            Y, Lt = _feedback(A.T, C.T, B1.T, Dt.T, p1, gamma, by_schur=by_schur)
            if not _nonnegative(A.T, C[p1:].T, B1.T, Dt[p1:].T, Y):
                return None
            return _Level(gamma, X, Y, F, Lt.T) if _coupling(X, Y) < gamma**2 else None
        except (RiccatiError, np.linalg.LinAlgError):
            return None


def _feedback(
    A: Matrix, B: Matrix, C1: Matrix, D1: Matrix, m1: int, gamma: float, *, by_schur: bool
) -> tuple[Matrix, Matrix]:
    """Solution X of the H-infinity Riccati equation and the feedback `F = -R^-1 (D1' C1 + B' X)`."""
    R = D1.T @ D1
    R[:m1, :m1] -= gamma**2 * np.eye(m1)
    if not by_schur:
        X = hinf_are(A, B, C1, D1, m1, gamma)
        return X, -np.linalg.solve(R, D1.T @ C1 + B.T @ X)
    Ri = np.linalg.inv(R)
    cross = Ri @ D1.T @ C1
    Q, G = C1.T @ C1 - C1.T @ D1 @ cross, B @ Ri @ B.T
    X = care(A - B @ cross, 0.5 * (G + G.T), 0.5 * (Q + Q.T), refine=False)
    return X, -cross - Ri @ B.T @ X


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


def _parrott_bound(standard: _Standard) -> float:
    """No level below this is feasible: the part of D11 that no controller reaches."""
    m1, m2, p1, p2 = standard.dims
    D11 = standard.sys.D[:p1, :m1]
    return max(_largest(D11[: p1 - m2]), _largest(D11[:, : m1 - p2]))


def _largest(matrix: Matrix) -> float:
    return float(np.linalg.norm(matrix, 2)) if matrix.size else 0.0


def _bisect(standard: _Standard, rtol: float, gamma_max: float) -> tuple[_Level, float]:
    """Smallest feasible level within `rtol`, and the largest infeasible one below it.

    In exact arithmetic every level above the optimum is feasible. Rounding can make one fail, and the bisection then
    stops too high: levels below its end are tried again, by both ways to solve a Riccati equation, and it goes on from
    the first that is feasible.
    """
    lowest = _parrott_bound(standard)
    best, lower = _first_feasible(standard, lowest, gamma_max), lowest
    while True:
        best, lower = _narrow(standard, best, lower, rtol)
        below = [best.gamma * factor for factor in (0.995, 0.97) if best.gamma * factor > max(lowest, FLOOR)]
        again = (_solve_level(standard, gamma, by_schur=route) for gamma in below for route in (True, False))
        found = next((level for level in again if level is not None), None)
        if found is None:
            return best, lower
        best, lower = found, lowest


def _first_feasible(standard: _Standard, lowest: float, gamma_max: float) -> _Level:
    gamma = min(max(2.0 * lowest, 1.0), gamma_max)
    while gamma > lowest:
        level = _solve_level(standard, gamma)
        if level is not None:
            return level
        if gamma == gamma_max:
            break
        gamma = min(4.0 * gamma, gamma_max)
    raise InfeasibleError(
        f"no stabilising controller with a norm below gamma_max = {gamma_max:.3g} (D11 alone needs {lowest:.3g}); "
        "allow a larger norm, or look for weights of very different size and zeros near the axis"
    )


def _narrow(standard: _Standard, best: _Level, lower: float, rtol: float) -> tuple[_Level, float]:
    while best.gamma - lower > rtol * best.gamma and best.gamma > FLOOR:
        middle = float(np.sqrt(max(lower, 1e-3 * best.gamma) * best.gamma))
        level = _solve_level(standard, middle)
        if level is None:
            lower = middle
        else:
            best = level
    return best, lower


def _levels(standard: _Standard, best: _Level, backoff: float) -> Iterator[_Level]:
    """Levels to build a controller for: the back-off asked for, then larger ones, by both Riccati solvers."""
    for factor in BACKOFF_LADDER:
        margin = backoff if factor == 1.0 else max(backoff, 1e-3) * factor
        for route in (False, True):
            level = _solve_level(standard, best.gamma * (1.0 + margin), by_schur=route)
            if level is not None:
                yield level


# --- controller --------------------


def _controller(standard: _Standard, level: _Level) -> Abcd:
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
    Bk = np.linalg.solve(Z, -L2 + (B2 + L12) @ Dk)
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


def _named(result: HinfResult, P: Any, nmeas: int, ncon: int) -> HinfResult:
    """Controller with the signal names that a named plant gives it."""
    inputs, outputs = getattr(P, "output_labels", None), getattr(P, "input_labels", None)
    if inputs is None or outputs is None:
        return result
    named = state_space(abcd(result.controller), inputs=inputs[-nmeas:], outputs=outputs[-ncon:])
    return replace(result, controller=named)


def _verified(plant: Abcd, K: Abcd, nmeas: int, ncon: int, claimed: float, optimal: float, lower: float) -> HinfResult:
    """Close the loop in the caller's units, check stability and the norm by two routes."""
    closed = lft(plant, K, nmeas, ncon)
    slowest = float(poles(closed).real.max()) if closed.A.size else -np.inf
    if slowest >= 0:
        raise NormMismatchError(
            f"closed loop unstable at claimed level {claimed:.6g}: pole with real part {slowest:.3g} rad/s"
        )
    gamma, frequency = hinf_norm(closed)
    swept, _ = sweep_norm(closed)
    if gamma > claimed * (1.0 + NORM_TOLERANCE):
        raise NormMismatchError(f"claimed norm {claimed:.6g}, closed loop has {gamma:.6g} at {frequency:.4g} rad/s")
    if abs(swept - gamma) > NORM_TOLERANCE * gamma:
        raise NormMismatchError(f"norm {gamma:.6g} by Hamiltonian, {swept:.6g} by frequency sweep")
    return HinfResult(state_space(K), gamma, frequency, swept, claimed, optimal, lower, slowest)
