"""What the design of the observer and of the isolation filter is free to choose."""

from dataclasses import dataclass


@dataclass(frozen=True)
class FdiWeights:
    """Weights of observer, isolation filter and thresholds, in design units (see `fdi_node.design_model`).

    Attributes
    ----------
    target_time_s : float
        Time constant of T: the residuals are the faults through `1 / (target_time_s s + 1)`.
    noise : tuple of float
        Measurement noise of p_e, SH, T_w that H has to bear (the regularisation "eps") at high frequency,
    noise_at_rest : float
        the part of it that is left at rest: small, so that the estimates are exact there,
    noise_corner_rad_s : float
        and the frequency from which it counts in full.
    process_noise : float
        Noise on commands and air flow in the observer's Riccati equation, over a measurement noise of one.
    sensor_noise : tuple of float
        What the sensors of p_e [Pa], SH [K], T_w [K] really have (rms at the sampling instants), for the thresholds.
    false_alarms_per_hour : float
        How often noise alone may take a residual over its threshold.
    reduction : float
        Hankel singular values below this part of the largest are left out of H.
    """

    target_time_s: float = 10.0
    noise: tuple[float, float, float] = (0.02, 0.02, 0.02)
    noise_at_rest: float = 0.01
    noise_corner_rad_s: float = 0.1
    process_noise: float = 3.0
    sensor_noise: tuple[float, float, float] = (200.0, 0.1, 0.05)
    false_alarms_per_hour: float = 1e-3
    reduction: float = 1e-4
