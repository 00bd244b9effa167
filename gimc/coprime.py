"""Left coprime factorisation `P = M^-1 N` with M and N stable (Zhou, Doyle, Glover 1996, sections 5.4 and 13.8).

Signs as in the GIMC literature: with an observer gain L that makes A + L C stable,
`M = (A+LC, L, C, I)`, `N = (A+LC, B+LD, C, D)`. A controller `K = V^-1 U` is factorised by the same function.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gimc.checks import intensity, matrix_of_shape, real_matrix
from gimc.errors import NotDetectableError, NotStabilisableError, UnstableError
from gimc.interconnect import Abcd, Matrix, abcd, state_space
from gimc.modes import unreachable_mode
from gimc.riccati import care
from gimc.scaling import balancing_scales


def lcf(sys: Any, L: ArrayLike | None = None, *, normalised: bool = False) -> tuple[Any, Any]:
    """Left coprime factors (M, N) of `sys`.

    Parameters
    ----------
    sys : control.StateSpace
        Stabilisable and detectable, n states, m inputs, p outputs.
    L : array_like, shape (n, p), optional
        Observer gain with A + L C stable (this sign: plus). Default: the one of the normalised factorisation.
    normalised : bool
        Scale the factors so that `M M^* + N N^* = I` on the imaginary axis. Excludes `L`.

    Returns
    -------
    M, N : control.StateSpace
        Both stable, with the same A, C and order n as `sys`.

    Raises
    ------
    NotStabilisableError, NotDetectableError
        If no coprime factorisation exists.
    UnstableError
        If A + L C is not stable for the given L.
    """
    system = abcd(sys)
    if normalised and L is not None:
        raise ValueError("lcf: a normalised factorisation determines L, do not give both")
    gain = filter_gain(sys) if L is None else real_matrix(L, "lcf", "observer gain L")
    _check_gain(system, gain)
    M, N = coprime_factor(system, gain), coprime_factor(system, gain, system.B, system.D)
    if normalised:
        R = np.eye(system.D.shape[0]) + system.D @ system.D.T
        values, vectors = np.linalg.eigh(R)
        root = (vectors / np.sqrt(values)) @ vectors.T  # R^-1/2
        M, N = (Abcd(F.A, F.B, root @ F.C, root @ F.D) for F in (M, N))
    names = getattr(sys, "output_labels", None)
    return state_space(M, inputs=names, outputs=names), state_space(N, sys)


def coprime_factor(sys: Any, L: Matrix, E1: ArrayLike | None = None, E2: ArrayLike | None = None) -> Abcd:
    """Factor belonging to further inputs: `(A+LC, E1 + L E2, C, E2)`; without E1 and E2 it is M itself.

    Parameters
    ----------
    sys : control.StateSpace
    L : ndarray, shape (n, p)
    E1, E2 : array_like, shapes (n, k) and (p, k)
        How the input enters the state equation and the output, for instance a disturbance or a fault. Where only one
        of them is given the other one is zero.
    """
    A, _, C, _ = abcd(sys)
    if E2 is None:
        if E1 is None:
            return Abcd(A + L @ C, np.array(L), C, np.eye(C.shape[0]))
        state = np.asarray(E1, dtype=float)
        direct = np.zeros((len(C), state.shape[1]))
    else:
        direct = np.asarray(E2, dtype=float)
        state = np.zeros((len(A), direct.shape[1])) if E1 is None else np.asarray(E1, dtype=float)
    return Abcd(A + L @ C, state + L @ direct, C, direct)


def filter_gain(
    sys: Any, process: ArrayLike | None = None, measurement: ArrayLike | None = None, cross: ArrayLike | None = None
) -> Matrix:
    """Observer gain L of the stationary Kalman filter, with the sign that makes A + L C stable.

    `L = -(Y C' + S) R^-1` with `A Y + Y A' - (Y C' + S) R^-1 (Y C' + S)' + Q = 0`.

    Parameters
    ----------
    sys : control.StateSpace
    process : array_like, shape (n, n), optional
        Intensity Q of the noise in the state equation; default `B B'`.
    measurement : array_like, shape (p, p) or (p,), optional
        Intensity R of the noise in the outputs, in the outputs' units squared; default `I + D D'`.
    cross : array_like, shape (n, p), optional
        Intensity S between both; default `B D'` if `process` is left out, else 0.

    The defaults give the normalised coprime factorisation (Zhou, theorem 13.37).

    Raises
    ------
    NotDetectableError, NotStabilisableError, RiccatiError
    ValueError
        If an intensity is not symmetric, has another shape, or is negative (R: not positive).
    """
    A, B, C, D = abcd(sys)
    n, p = A.shape[0], C.shape[0]
    Q = B @ B.T if process is None else intensity("process", process, n, definite=False)
    default_cross = B @ D.T if process is None else np.zeros((n, p))
    S = default_cross if cross is None else matrix_of_shape("cross", cross, n, p)
    R = np.eye(p) + D @ D.T if measurement is None else intensity("measurement", measurement, p, definite=True)
    _check_modes(A, Q, C)
    Ri = np.linalg.inv(R)
    At, Qt = A - S @ Ri @ C, Q - S @ Ri @ S.T
    Y = care(At.T, C.T @ Ri @ C, 0.5 * (Qt + Qt.T))
    return np.asarray(-(Y @ C.T + S) @ Ri)


def _check_modes(A: Matrix, Q: Matrix, C: Matrix) -> None:
    d = balancing_scales(A, np.zeros((A.shape[0], 0)), np.zeros((0, A.shape[0])))
    As = A * d / d[:, None]
    mode = unreachable_mode(As.T, (C * d).T)
    if mode is not None:
        raise NotDetectableError(f"coprime factorisation: the outputs do not see the mode at {mode:.4g} rad/s")
    mode = unreachable_mode(As, Q / d[:, None])
    if mode is not None:
        raise NotStabilisableError(
            f"coprime factorisation: no input (or process noise) reaches the mode at {mode:.4g} rad/s; "
            "project it out first, see gimc.minimal_realisation"
        )


def _check_gain(system: Abcd, L: Matrix) -> None:
    n, p = system.A.shape[0], system.C.shape[0]
    if L.shape != (n, p):
        raise ValueError(f"observer gain L has shape {L.shape}, must be {(n, p)}: states by outputs")
    eigenvalues = np.linalg.eigvals(system.A + L @ system.C)
    if n and eigenvalues.real.max() >= 0:
        worst = eigenvalues[np.argmax(eigenvalues.real)]
        raise UnstableError(f"A + L C is not stable: eigenvalue {worst:.4g} rad/s (is the sign of L right?)")
