"""Detection thresholds: from the noise of the residuals, its rate of false alarms, and a change of the air flow."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, solve_discrete_lyapunov

Matrix = NDArray[np.float64]


def residual_covariances(
    observer: tuple[Matrix, Matrix, Matrix], filter_: tuple[Matrix, Matrix, Matrix, Matrix], noise: Matrix
) -> tuple[Matrix, Matrix]:
    """Compute the covariance of the residual under white sensor noise, at one tick and from one tick to the next.

    Parameters
    ----------
    observer : (a, b, c)
        `xi+ = a xi + b y`, `f_e = c xi - y`; shapes (n, n), (n, p), (p, n).
    filter_ : (a, b, c, d)
        `eta+ = a eta + b f_e`, `r = c eta + d f_e`.
    noise : ndarray, shape (p,) or (p, p)
        Standard deviations of the measurements, or a factor S of their covariance `S S'`.

    Returns
    -------
    covariance, shifted : ndarray, shape (nr, nr)
        `E r_k r_k'` and `E r_{k+1} r_k'`.
    """
    a, b, c = observer
    ha, hb, hc, hd = filter_
    A = block_diag(a, ha)
    A[len(a) :, : len(a)] = hb @ c
    factor = np.diag(noise) if noise.ndim == 1 else noise
    B = np.vstack([b, -hb]) @ factor
    C, D = np.hstack([hd @ c, hc]), -hd @ factor
    state = solve_discrete_lyapunov(A, B @ B.T)
    covariance = C @ state @ C.T + D @ D.T
    shifted = C @ (A @ state @ C.T + B @ D.T)
    return covariance, shifted


def noise_thresholds(covariance: Matrix, shifted: Matrix, sample_time_s: float, alarms_per_hour: float) -> Matrix:
    """Compute thresholds that noise alone crosses `alarms_per_hour` times an hour, each residual separately.

    Rice's formula for the crossings of a level by a stationary Gaussian process (S. O. Rice, "Mathematical analysis of
    random noise", 1944), for both signs, with the zero-crossing rate from the correlation of neighbouring ticks:
    `rate = 2 nu_0 exp(-z^2 / 2)`, `nu_0 = arccos(rho) / (2 pi T)`.

    Returns
    -------
    ndarray, shape (nr,)
        In the unit of the residuals.
    """
    sigma = np.sqrt(np.diag(covariance))
    correlation = np.clip(np.diag(shifted) / np.diag(covariance), -1.0, 1.0)
    crossings = np.arccos(correlation) / (2.0 * math.pi * sample_time_s)
    ratio = 2.0 * crossings * 3600.0 / alarms_per_hour
    return np.asarray(sigma * np.sqrt(2.0 * np.log(np.maximum(ratio, math.e))))


def step_peaks(
    plant: tuple[Matrix, Matrix, Matrix],
    observer: tuple[Matrix, Matrix, Matrix],
    filter_: tuple[Matrix, Matrix, Matrix, Matrix],
    ticks: int,
) -> Matrix:
    """Compute the peaks of the residuals after a unit step of an unknown input.

    Parameters
    ----------
    plant : (A, b, C)
        Sampled plant: `x+ = A x + b`, `y = C x`; shapes (n, n), (n,), (p, n).
    observer, filter_
        As in `residual_covariances`.
    ticks : int
        Length of the simulation.

    Returns
    -------
    ndarray, shape (nr,)
    """
    (A, step, C), (a, b, c), (ha, hb, hc, hd) = plant, observer, filter_
    x, xi, eta = np.zeros(len(A)), np.zeros(len(a)), np.zeros(len(ha))
    peaks = np.zeros(len(hc))
    for _ in range(ticks):
        y = C @ x
        innovation = c @ xi - y
        peaks = np.maximum(peaks, np.abs(hc @ eta + hd @ innovation))
        x, xi, eta = A @ x + step, a @ xi + b @ y, ha @ eta + hb @ innovation
    return peaks
