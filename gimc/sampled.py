"""Sampled filters and observers: discretisation, and step functions that are one flat matrix product."""

import warnings
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from gimc.checks import intensity, positive
from gimc.errors import NotDetectableError, RiccatiError
from gimc.interconnect import Abcd, Matrix, Response, abcd, safe_inverse
from gimc.modes import unreachable_mode
from gimc.norms import frequency_response
from gimc.scaling import balance_states, balancing_scales

Method = Literal["zoh", "foh", "tustin"]


@dataclass(frozen=True)
class Sampled:
    """Matrices of `x+ = A x + B u, y = C x + D u` at a fixed sample time.

    Attributes
    ----------
    A, B, C, D : ndarray
    sample_time_s : float
    """

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    sample_time_s: float

    def response(self, frequencies_rad_s: ArrayLike) -> Response:
        """Frequency response at `exp(j w sample_time)`, shape (number of frequencies, p, m)."""
        z = np.exp(1j * np.atleast_1d(np.asarray(frequencies_rad_s, dtype=float)) * self.sample_time_s)
        n = self.A.shape[0]
        x = np.linalg.solve(z[:, None, None] * np.eye(n) - self.A, np.broadcast_to(self.B, (z.size, *self.B.shape)))
        return np.asarray(self.C @ x + self.D)


def discretise(sys: Any, sample_time_s: float, method: Method = "foh", *, balance: bool = True) -> Sampled:
    """Sampled version of a continuous system.

    Parameters
    ----------
    sys : control.StateSpace
    sample_time_s : float
    method : {"zoh", "foh", "tustin"}
        "zoh": exact when the input is held between samples (a plant behind a digital controller); delays by half a
        sample. "foh": exact when the input is straight between samples (triangle hold; Franklin, Powell, Workman 1998,
        section 6.3.2); no delay, poles mapped exactly: for filters. "tustin": trapezoidal rule; warps frequency, and
        poles faster than the sampling rate alternate in sign.

    balance : bool
        Scale the states to even size first; inputs and outputs keep the caller's units either way.

    Raises
    ------
    IllPosedError
        If Tustin's rule meets a pole at 2/sample_time_s.
    ValueError
        If the sample time is not finite and positive, or too long for an unstable pole; or for another method.
    """
    h = positive("sample_time_s", sample_time_s)
    if method not in ("zoh", "foh", "tustin"):
        raise ValueError(f"method {method!r}: allowed are 'zoh', 'foh', 'tustin'")
    A, B, C, D = balance_states(abcd(sys)) if balance else abcd(sys)
    n, m = B.shape
    if method == "tustin":
        left = safe_inverse(
            np.eye(n) - 0.5 * h * A, f"I - h A / 2 of Tustin's rule (a pole at 2/h = {2 / h:.6g} rad/s)"
        )
        Ad, Bd = left @ (np.eye(n) + 0.5 * h * A), h * left @ B
        return Sampled(Ad, Bd, C @ left, D + 0.5 * h * C @ left @ B, h)
    # exp of [[A h, B h, 0], [0, 0, I], [0, 0, 0]] holds exp(A h) and the integrals for a constant and for a ramp.
    block = np.zeros((n + 2 * m, n + 2 * m))
    block[:n, :n], block[:n, n : n + m], block[n : n + m, n + m :] = A * h, B * h, np.eye(m)
    exponential = _exponential(block, h)
    Ad, hold, ramp = exponential[:n, :n], exponential[:n, n : n + m], exponential[:n, n + m :]
    if method == "zoh":
        return Sampled(Ad, hold, C, D, h)
    return Sampled(Ad, hold + Ad @ ramp - ramp, C, D + C @ ramp, h)


def _exponential(matrix: Matrix, sample_time_s: float) -> Matrix:
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        exponential = scipy.linalg.expm(matrix)
    if not np.isfinite(exponential).all():
        raise ValueError(f"sample_time_s = {sample_time_s:g}: the unstable poles grow beyond all numbers in one sample")
    return np.asarray(exponential)


def sampling_error(sys: Any, sampled: Sampled, *, fraction: float = 0.1, points: int = 200) -> float:
    """Largest difference of the frequency responses up to `fraction` of the sampling rate, over the largest gain there.

    Parameters
    ----------
    sys : control.StateSpace
        The continuous system.
    sampled : Sampled
    fraction : float
        End of the band as a part of the sampling rate (0.5 is Nyquist's frequency).
    """
    top = 2.0 * np.pi * fraction / sampled.sample_time_s
    w = np.geomspace(top * 1e-6, top, points)
    continuous = frequency_response(sys, w)
    difference = np.linalg.svd(sampled.response(w) - continuous, compute_uv=False)[:, 0]
    return float(difference.max() / max(np.linalg.svd(continuous, compute_uv=False)[:, 0].max(), 1e-300))


class SampledFilter:
    """A sampled linear filter that runs without allocating memory.

    Parameters
    ----------
    sampled : Sampled

    Notes
    -----
    `[y; x+] = [[C, D], [A, B]] [x; u]` is one matrix product a step.
    """

    def __init__(self, sampled: Sampled) -> None:
        self.sampled = sampled
        n, m = sampled.B.shape
        p = sampled.C.shape[0]
        self._n, self._p = n, p
        self._matrix = np.ascontiguousarray(np.block([[sampled.C, sampled.D], [sampled.A, sampled.B]]))
        self._in = np.zeros(n + m)
        self._out = np.zeros(p + n)
        self._state, self._input = self._in[:n], self._in[n:]
        self._output, self._next = self._out[:p], self._out[p:]

    @property
    def state(self) -> Matrix:
        """Copy of the state, shape (n,)."""
        return self._state.copy()

    def step(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Output for input u (m,) now, and one sample on. The array returned is overwritten by the next step."""
        self._input[:] = u
        np.dot(self._matrix, self._in, out=self._out)
        self._state[:] = self._next
        return self._output

    def reset(self, state: ArrayLike | float = 0.0) -> None:
        """Set the state: 0, or an array of shape (n,)."""
        self._state[:] = state

    def rest_at(self, u: ArrayLike) -> Matrix:
        """Set the state to rest at constant input u (m,), and return the output there. Needs no pole at 1."""
        S = self.sampled
        held = np.asarray(u, dtype=float)
        self._state[:] = np.linalg.solve(np.eye(self._n) - S.A, S.B @ held)
        return np.asarray(S.C @ self._state + S.D @ held)


@dataclass(frozen=True)
class ObserverDesign:
    """Left coprime factors of the sampled plant.

    `M = (A+LC, L, C, I)`, `N = (A+LC, B, C, 0)` in discrete time, with A, B the exact zero-order-hold samples: the
    innovation `f_e = N u - M y` of a fault-free linear plant under held inputs is zero at every sampling instant.

    Attributes
    ----------
    plant : Sampled
        A, B, C, D of the sampled plant (D = 0).
    L : ndarray, shape (n, p)
        Gain of the discrete filter, A + L C has its poles inside the unit circle.
    covariance : ndarray, shape (p, p)
        Of the innovation, for the noise intensities the design was made for.
    """

    plant: Sampled
    L: Matrix
    covariance: Matrix


def sampled_observer(
    sys: Any, sample_time_s: float, process: ArrayLike | None = None, measurement: ArrayLike | None = None
) -> ObserverDesign:
    """Discrete observer for a plant whose inputs are held between samples.

    Parameters
    ----------
    sys : control.StateSpace
        Continuous plant, D = 0; every known input (also measured disturbances) is a column of B.
    sample_time_s : float
    process : array_like, shape (n, n), optional
        Intensity of the continuous noise on the states; default `B B'`. Sampled exactly (Van Loan, IEEE TAC 23, 1978).
    measurement : array_like, shape (p, p) or (p,), optional
        Intensity of the continuous measurement noise; default the identity. Its variance at one sample is this over
        `sample_time_s`, so that one continuous design serves every sample time.

    Raises
    ------
    ValueError
        If D is not zero, the sample time not finite and positive, or an intensity not symmetric and nonnegative
        definite (`measurement`: positive).
    NotDetectableError, RiccatiError
    """
    system = abcd(sys)
    if system.D.any():
        raise ValueError(
            "sampled_observer: the plant has a direct term; the innovation would need an input not sent yet"
        )
    sample_time_s = positive("sample_time_s", sample_time_s)
    n, p = system.A.shape[0], system.C.shape[0]
    Q = system.B @ system.B.T if process is None else intensity("process", process, n, definite=False)
    Rd = (np.eye(p) if measurement is None else intensity("measurement", measurement, p, definite=True)) / sample_time_s
    if n == 0:
        return ObserverDesign(discretise(system, sample_time_s, "zoh"), np.zeros((0, p)), Rd)
    d = balancing_scales(system.A, np.sqrt(np.abs(np.diag(Q)))[:, None], np.zeros((0, n)))
    balanced = Abcd(system.A * d / d[:, None], system.B / d[:, None], system.C * d, system.D)
    mode = unreachable_mode(balanced.A.T, balanced.C.T)
    if mode is not None:
        raise NotDetectableError(f"sampled_observer: the outputs do not see the mode at {mode:.4g} rad/s")
    Qd = _sampled_intensity(balanced.A, Q / d / d[:, None], sample_time_s)
    Ad = scipy.linalg.expm(balanced.A * sample_time_s)
    r = np.sqrt(np.diag(Rd))
    Cs, Rs = balanced.C / r[:, None], Rd / r / r[:, None]
    try:
        Y = scipy.linalg.solve_discrete_are(Ad.T, Cs.T, Qd, Rs)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise RiccatiError(f"sampled_observer: the filter Riccati equation has no solution: {error}") from None
    covariance = Cs @ Y @ Cs.T + Rs
    Ls = -np.linalg.solve(covariance, Cs @ Y @ Ad.T).T  # for outputs divided by r
    L = d[:, None] * Ls / r
    hold = discretise(balanced, sample_time_s, "zoh", balance=False)
    plant = Sampled(hold.A * d[:, None] / d, hold.B * d[:, None], system.C, system.D, hold.sample_time_s)
    if np.abs(np.linalg.eigvals(Ad + Ls @ Cs)).max(initial=0.0) >= 1.0:
        raise RiccatiError("sampled_observer: A + L C is not stable")
    return ObserverDesign(plant, L, covariance * r * r[:, None])


class SampledObserver:
    """Innovation `f_e = N u - M y` of a sampled plant, one tick at a time, without allocating memory.

    Parameters
    ----------
    design : ObserverDesign

    Notes
    -----
    A tick is `innovate(y)` and, once the command is known, `advance(u)`: the innovation at tick k uses commands up to
    k-1 only.
    """

    def __init__(self, design: ObserverDesign) -> None:
        self.design = design
        plant = design.plant
        n, m = plant.B.shape
        p = plant.C.shape[0]
        d = balancing_scales(plant.A, np.abs(design.L @ plant.C @ np.ones((n, 1))), np.zeros((0, n)))
        self._scales, self._n = d, n
        self._C = np.ascontiguousarray(plant.C * d)
        step = np.hstack([plant.A * d / d[:, None], design.L / d[:, None], plant.B / d[:, None]])
        self._step = np.ascontiguousarray(step)  # x+ = A x + L f_e + B u
        self._in = np.zeros(n + p + m)
        self._next = np.zeros(n)
        self._state, self._innovation, self._input = self._in[:n], self._in[n : n + p], self._in[n + p :]

    @property
    def state(self) -> Matrix:
        """Predicted plant state in the caller's units, shape (n,), a copy."""
        return self._state * self._scales

    def innovate(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Innovation (p,) for measurement y (p,) of this tick. The array returned is overwritten by the next call."""
        np.dot(self._C, self._state, out=self._innovation)
        self._innovation -= y
        return self._innovation

    def advance(self, u: NDArray[np.float64]) -> None:
        """Go to the next tick with input u (m,) held in between."""
        self._input[:] = u
        np.dot(self._step, self._in, out=self._next)
        self._state[:] = self._next

    def reset(self, state: ArrayLike | float = 0.0) -> None:
        """Set the predicted state: 0, or an array of shape (n,) in the caller's units."""
        self._state[:] = np.asarray(state, dtype=float) / self._scales
        self._innovation[:] = 0.0


def _sampled_intensity(A: Matrix, Q: Matrix, h: float) -> Matrix:
    """Covariance of the state noise over one sample, `int_0^h exp(A s) Q exp(A' s) ds`.

    Van Loan's exponential overflows for stiff plants (it holds exp(-A h)): computed over a short step, then doubled:
    `Q(2s) = Q(s) + exp(A s) Q(s) exp(A' s)`.
    """
    n = A.shape[0]
    size = np.linalg.norm(A, 1) * h if n else 0.0
    halvings = max(0, int(np.ceil(np.log2(max(size, 1e-300)))))
    s = h / 2.0**halvings
    exponential = scipy.linalg.expm(np.block([[-A, Q], [np.zeros((n, n)), A.T]]) * s)
    step = exponential[n:, n:].T
    covariance = step @ exponential[:n, n:]
    for _ in range(halvings):
        covariance = covariance + step @ covariance @ step.T
        step = step @ step
    return np.asarray(0.5 * (covariance + covariance.T))
