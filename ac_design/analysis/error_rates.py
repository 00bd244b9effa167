"""False alarms and missed detections, computed and counted in simulated noise.

``python -m ac_design.analysis.error_rates`` prints the table of `docs/control.md`. The chain is the sampled linear one:
noise into observer and isolation filter, residuals against their thresholds.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.special import ndtr

from ac_common.units import KPA, RPM
from ac_design.model import sensor_noise
from ac_design.store import design_fdi as design
from ac_design.thresholds import residual_covariances
from ac_design.weights import FdiWeights, SuperheatSensor
from fdi_node import FdiDesign

Matrix = NDArray[np.float64]

HOUR_S = 3600.0


@dataclass(frozen=True)
class ErrorRates:
    """Rates of false alarms and missed detections of one residual.

    Attributes
    ----------
    sigma, threshold : float
        Standard deviation of the residual under noise, and its threshold [rad/s or Pa].
    false_alarms_per_hour : float
        Crossings of the threshold by noise alone (Rice), which the confirmation time makes rarer still.
    missed : float
        Probability that the residual of a fault of the given size, settled, is below its threshold at a tick.
    smallest : float
        Size of a fault that is missed with a probability of a thousandth [rad/s or Pa].
    """

    sigma: float
    threshold: float
    false_alarms_per_hour: float
    missed: float
    smallest: float


def error_rates(fdi: FdiDesign, noise: Matrix, sizes: tuple[float, float]) -> tuple[ErrorRates, ...]:
    """Compute the rates of false alarms and missed detections of both residuals.

    Parameters
    ----------
    fdi : FdiDesign
    noise : ndarray, shape (3, 3)
        As `ac_design.model.sensor_noise` gives it.
    sizes : tuple of float
        Sizes of the faults for which the probability of a missed detection is computed [rad/s, Pa].

    Returns
    -------
    tuple of ErrorRates
        Of r_N and r_p.
    """
    covariance, shifted = residual_covariances(*_chain(fdi), noise)
    rates = []
    for i, (threshold, size) in enumerate(zip(fdi.thresholds.tolist(), sizes, strict=True)):
        sigma = math.sqrt(covariance[i, i])
        zero_crossings = math.acos(min(1.0, shifted[i, i] / covariance[i, i])) / (2.0 * math.pi * fdi.sample_time_s)
        rates.append(
            ErrorRates(
                sigma,
                threshold,
                false_alarms_per_hour=2.0 * zero_crossings * HOUR_S * math.exp(-0.5 * (threshold / sigma) ** 2),
                missed=float(ndtr((threshold - abs(size)) / sigma) - ndtr((-threshold - abs(size)) / sigma)),
                smallest=threshold + 3.09 * sigma,
            )
        )
    return tuple(rates)


def simulated_residuals(fdi: FdiDesign, noise: Matrix, runs: int, ticks: int, seed: int) -> Matrix:
    """Return the residuals of `runs` independent runs under noise, shape (runs, ticks, 2), all simulated at once."""
    (a, b, c), (ha, hb, hc, hd) = _chain(fdi)
    A = block_diag(a, ha)
    A[len(a) :, : len(a)] = hb @ c
    B, C, D = np.vstack([b, -hb]) @ noise, np.hstack([hd @ c, hc]), -hd @ noise
    random = np.random.default_rng(seed)
    state, seen = np.zeros((runs, len(A))), np.empty((runs, ticks, 2))
    for k in range(ticks):
        white = random.standard_normal((runs, 3))
        seen[:, k] = state @ C.T + white @ D.T
        state = state @ A.T + white @ B.T
    return seen


def _chain(fdi: FdiDesign) -> tuple[tuple[Matrix, Matrix, Matrix], tuple[Matrix, Matrix, Matrix, Matrix]]:
    return (fdi.a, fdi.b[:, 3:], fdi.c), (fdi.h_a, fdi.h_b, fdi.h_c, fdi.h_d)


def main() -> None:
    """Print the rates at all operating points for both sensors of the superheat."""
    sensors: tuple[SuperheatSensor, ...] = ("direct", "derived")
    print(
        "| point | superheat | residual | sigma | threshold | false alarms/h | missed at 1/4 size | least size found |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for point in ("low", "med", "high"):
        for superheat in sensors:
            weights = FdiWeights(superheat=superheat)
            fdi = design(point, 0.1, weights)
            rates = error_rates(fdi, sensor_noise(point, weights), (10.0 * RPM, 1.25 * KPA))
            for name, unit, rate in zip(("r_N, rpm", "r_p, kPa"), (RPM, KPA), rates, strict=True):
                sizes = [f"{value / unit:.2f}" for value in (rate.sigma, rate.threshold)]
                cells = [point, superheat, name, *sizes, f"{rate.false_alarms_per_hour:.0e}", f"{rate.missed:.0e}"]
                print("| " + " | ".join([*cells, f"{rate.smallest / unit:.2f}"]) + " |")


if __name__ == "__main__":
    main()
