"""H-infinity norm by two independent routes: Hamiltonian eigenvalues, and an adaptive sweep over frequency."""

from collections.abc import Callable

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from gimc.checks import relative_tolerance, whole_number
from gimc.errors import UnstableError
from gimc.interconnect import Abcd, Matrix, Response, abcd
from gimc.scaling import balance_states

MAX_ITERATIONS = 60


def poles(sys: object) -> NDArray[np.complex128]:
    """Eigenvalues of A, computed on the balanced state (units of the states then do not matter)."""
    return np.asarray(np.linalg.eigvals(balance_states(abcd(sys)).A), dtype=complex)


def is_stable(sys: object) -> bool:
    """Whether all poles lie in the open left half plane."""
    return bool((poles(sys).real < 0).all())


def frequency_response(sys: object, frequencies_rad_s: ArrayLike) -> Response:
    """`G(j w)` at every frequency, shape (number of frequencies, p, m). Infinite frequencies give D."""
    return response_function(sys)(frequencies_rad_s)


def response_function(sys: object) -> Callable[[ArrayLike], Response]:
    """`frequency_response` of one system for many calls.

    Complex Schur form once, then back substitution for all frequencies at a time: unitary, hence accurate on stiff
    systems where an eigenvector basis is not.
    """
    A, B, C, D = balance_states(abcd(sys))
    n = A.shape[0]
    T, U = scipy.linalg.schur(A, output="complex") if n else (A, A)
    Bs, Cs = U.conj().T @ B, C @ U

    def response(frequencies_rad_s: ArrayLike) -> Response:
        w = np.atleast_1d(np.asarray(frequencies_rad_s, dtype=float))
        if np.isnan(w).any():
            raise ValueError("frequencies_rad_s: nan is no frequency")
        result = np.broadcast_to(D.astype(complex), (w.size, *D.shape)).copy()
        finite = np.isfinite(w)
        if n == 0 or not finite.any():
            return result
        wf = w[finite]
        x = np.zeros((n, wf.size, B.shape[1]), dtype=complex)  # (jw - T) x = Bs
        with np.errstate(divide="ignore", invalid="ignore"):
            for i in range(n - 1, -1, -1):
                known = (T[i, i + 1 :] @ x[i + 1 :].reshape(n - i - 1, x[0].size)).reshape(x[0].shape)
                x[i] = (known + Bs[i]) / (1j * wf - T[i, i])[:, None]
        result[finite] += np.tensordot(Cs, x, axes=1).transpose(1, 0, 2)
        return result

    return response


def largest_singular_values(sys: object, frequencies_rad_s: ArrayLike) -> Matrix:
    """Largest singular value of `G(j w)` at every frequency (infinite on a pole)."""
    return _largest_singular_values(frequency_response(sys, frequencies_rad_s))


def _largest_singular_values(response: Response) -> Matrix:
    if 0 in response.shape[1:]:
        return np.zeros(response.shape[0])
    finite = np.isfinite(response).all(axis=(1, 2))
    values = np.full(response.shape[0], np.inf)
    values[finite] = np.linalg.svd(response[finite], compute_uv=False)[:, 0]
    return values


def hinf_norm(sys: object, *, rtol: float = 1e-6) -> tuple[float, float]:
    """H-infinity norm of a stable system, and the frequency where it is attained.

    Two-step algorithm of Bruinsma and Steinbuch (Syst. Control Lett. 14, 1990) after Boyd, Balakrishnan, Kabamba
    (1989): the level `gamma` is crossed at the imaginary eigenvalues of a Hamiltonian matrix, and the largest singular
    value between two crossings gives the next level. Eigenvalues near the axis are taken as candidates generously,
    because a false one costs an evaluation only.

    Parameters
    ----------
    sys : control.StateSpace, Abcd or array_like
    rtol : float
        The norm lies between the value returned and (1 + 2 rtol) times it; 1e-12 to 0.1.

    Returns
    -------
    norm : float
    frequency : float
        In rad/s; 0 or inf are possible.

    Raises
    ------
    UnstableError
        If a pole is not in the open left half plane.
    ValueError
        If `rtol` is out of range, or `sys` no system (see `abcd`).
    """
    rtol = relative_tolerance(rtol, highest=0.1)
    system = balance_states(abcd(sys))
    eigenvalues = _stable_poles(system)
    respond = response_function(system)
    frequencies = _first_frequencies(eigenvalues)
    values = _largest_singular_values(respond(frequencies))
    best = int(np.argmax(values))
    norm, frequency = float(values[best]), float(frequencies[best])
    if norm == 0.0:
        values = _largest_singular_values(respond(np.geomspace(1e-8, 1e8, 400)))
        if not values.any():
            return 0.0, 0.0
        norm = float(values.max())
    for _ in range(MAX_ITERATIONS):
        candidates = _crossings(system, norm * (1.0 + 2.0 * rtol))
        if candidates.size == 0:
            break
        values = _largest_singular_values(respond(candidates))
        best = int(np.argmax(values))
        if values[best] <= norm * (1.0 + 2.0 * rtol):
            if values[best] > norm:
                norm, frequency = float(values[best]), float(candidates[best])
            break
        norm, frequency = float(values[best]), float(candidates[best])
    return norm, frequency


def sweep_norm(sys: object, *, points_per_decade: int = 30, rounds: int = 12) -> tuple[float, float]:
    """Largest singular value over a dense frequency grid, refined around its local maxima: the check of `hinf_norm`.

    A lower bound of the norm that shares nothing with `hinf_norm` but the evaluation of `G(j w)`.

    Returns
    -------
    norm, frequency : float
        The largest value found and where (rad/s).
    """
    whole_number("points_per_decade", points_per_decade, 1, 10**4)
    whole_number("rounds", rounds, 1, 100)
    system = balance_states(abcd(sys))
    eigenvalues = _stable_poles(system)
    moduli = np.abs(eigenvalues) if eigenvalues.size else np.ones(1)
    low, high = np.log10(moduli.min()) - 2, np.log10(moduli.max()) + 2
    grid = np.logspace(low, high, int((high - low) * points_per_decade) + 1)
    around = np.abs(eigenvalues.imag)[:, None] + np.abs(eigenvalues.real)[:, None] * np.array(
        [-1.0, -0.3, 0.0, 0.3, 1.0]
    )
    grid = np.unique(np.concatenate([grid, moduli, around[around > 0].ravel()]))
    respond = response_function(system)
    values = _largest_singular_values(respond(grid))
    ends = np.array([0.0, np.inf])
    end_values = _largest_singular_values(respond(ends))
    best, where = float(end_values.max()), float(ends[np.argmax(end_values)])
    peaks = _promising_peaks(values)
    if peaks.size:
        left, right = grid[np.maximum(peaks - 1, 0)], grid[np.minimum(peaks + 1, grid.size - 1)]
        value, frequency = _highest_peak(respond, left, right, rounds)
        if value > best:
            best, where = value, frequency
    return best, where


def _promising_peaks(values: Matrix) -> NDArray[np.intp]:
    """Indices of local maxima that could hide the global one between grid points."""
    padded = np.concatenate([[-np.inf], values, [-np.inf]])
    local = (padded[1:-1] >= padded[:-2]) & (padded[1:-1] >= padded[2:])
    return np.flatnonzero(local & (values >= 0.7 * values.max()))[:50]


def _highest_peak(
    respond: Callable[[ArrayLike], Response], left: Matrix, right: Matrix, rounds: int
) -> tuple[float, float]:
    """Largest value between pairs of frequencies, all refined at a time, and where it is."""
    pairs = np.arange(left.size)
    values = frequencies = left
    for _ in range(rounds):
        inner = np.geomspace(left, right, 9)
        all_values = _largest_singular_values(respond(inner.ravel())).reshape(inner.shape)
        best = np.argmax(all_values, axis=0)
        values, frequencies = all_values[best, pairs], inner[best, pairs]
        left, right = inner[np.maximum(best - 1, 0), pairs], inner[np.minimum(best + 1, 8), pairs]
    highest = int(np.argmax(values))
    return float(values[highest]), float(frequencies[highest])


def _stable_poles(system: Abcd) -> NDArray[np.complex128]:
    eigenvalues = np.asarray(np.linalg.eigvals(system.A), dtype=complex)
    if eigenvalues.size and eigenvalues.real.max() >= 0:
        worst = eigenvalues[np.argmax(eigenvalues.real)]
        raise UnstableError(f"the H-infinity norm of an unstable system is not defined: pole at {worst:.6g} rad/s")
    return eigenvalues


def _first_frequencies(eigenvalues: NDArray[np.complex128]) -> Matrix:
    """Zero, infinity, the poles' own frequencies and a coarse grid across their range."""
    moduli = np.abs(eigenvalues) if eigenvalues.size else np.ones(1)
    grid = np.geomspace(moduli.min() / 100, moduli.max() * 100, 120)
    resonant = np.abs(eigenvalues.imag)
    return np.concatenate([[0.0, np.inf], moduli, resonant[resonant > 0], grid])


def _crossings(system: Abcd, gamma: float) -> Matrix:
    """Frequencies where a singular value of G may equal gamma, and the middles between them."""
    root = np.sqrt(gamma)
    A, B, C, D = system.A, system.B / root, system.C / root, system.D / gamma
    if A.shape[0] == 0:
        return np.zeros(0)
    R = np.eye(D.shape[1]) - D.T @ D
    if np.linalg.eigvalsh(R)[0] > 1e-6:
        RiDC = np.linalg.solve(R, D.T @ C)
        RiB = np.linalg.solve(R, B.T)
        F = A + B @ RiDC
        hamiltonian = np.block([[F, B @ RiB], [-C.T @ C - C.T @ D @ RiDC, -F.T]])
        eigenvalues = np.linalg.eigvals(hamiltonian)
        size = np.linalg.norm(hamiltonian, 1)
    else:
        eigenvalues, size = _pencil_eigenvalues(A, B, C, D)
    near_axis = np.abs(eigenvalues.real) <= 1e-4 * np.abs(eigenvalues) + 1e-12 * size
    crossings = np.unique(np.abs(eigenvalues[near_axis].imag))
    crossings = crossings[crossings > 0]
    if crossings.size == 0:
        return np.zeros(0)
    edges = np.concatenate([[crossings[0] / 10], crossings, [crossings[-1] * 10]])
    middles = np.concatenate([np.sqrt(edges[1:] * edges[:-1]), 0.5 * (edges[1:] + edges[:-1])])
    return np.unique(np.concatenate([crossings, middles]))


def _pencil_eigenvalues(A: Matrix, B: Matrix, C: Matrix, D: Matrix) -> tuple[NDArray[np.complex128], float]:
    """Finite eigenvalues of the extended pencil for level 1; needs no inverse of `I - D'D`, nearly singular here."""
    n, m, p = A.shape[0], B.shape[1], C.shape[0]
    zeros = np.zeros
    matrix = np.block([
        [A, zeros((n, n)), B, zeros((n, p))],
        [zeros((n, n)), -A.T, zeros((n, m)), -C.T],
        [C, zeros((p, n)), D, -np.eye(p)],
        [zeros((m, n)), B.T, -np.eye(m), D.T],
    ])  # fmt: skip
    mass = np.zeros_like(matrix)
    mass[: 2 * n, : 2 * n] = np.eye(2 * n)
    alpha, beta = scipy.linalg.eigvals(matrix, mass, homogeneous_eigvals=True)
    size = float(np.linalg.norm(matrix, 1))
    finite = np.abs(alpha) < 1e12 * size * np.abs(beta)
    return np.asarray(alpha[finite] / beta[finite]), size
