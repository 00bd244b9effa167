"""What the design of the observer and of the isolation filter is free to choose."""

from dataclasses import dataclass
from typing import Literal

SuperheatSensor = Literal["direct", "derived"]
"""Superheat measured by itself, or from an outlet thermocouple and the *measured* pressure: `T_out - T_sat(p_e)`."""


@dataclass(frozen=True)
class MeasurementNoise:
    """Noise on the measurements that regularises a filter's design: `level_i (s + at_rest * corner) / (s + corner)`.

    Attributes
    ----------
    level : tuple of float
        On p_e, SH and, with three sensors, T_w at high frequency, in design units.
    at_rest : float
        The part of it that is left at rest: small, so that estimates are exact there.
    corner_rad_s : float
        The frequency from which it counts in full.
    """

    level: tuple[float, ...]
    at_rest: float = 0.01
    corner_rad_s: float = 0.1

    def __str__(self) -> str:
        """As `acftc design` prints it."""
        return f"eps {', '.join(f'{level:g}' for level in self.level)}"


@dataclass(frozen=True)
class FdiWeights:
    """Weights of observer, isolation filter and thresholds, in design units (see `ac_design.model`).

    Attributes
    ----------
    target_time_s : float
        Time constant of T: the residuals are the faults through `1 / (target_time_s s + 1)`.
    noise : MeasurementNoise
        What H has to bear: the regularisation "eps".
    error_corner_rad_s, error_at_rest, error_rolloff_rad_s : float
        The weight on `[0 T] - H [N~d N~f]`, `(s + corner) / (s + at_rest * corner) * (s / rolloff + 1)`: an error is
        dear at rest, where the estimates are read, and far above T's bandwidth, where steps cross over into the other
        residual. Zeros of `[N~d N~f]` in the right half plane near 1 rad/s leave an error of about T there whatever H
        does.
    cross_talk : tuple of float
        How much dearer the other fault is in a residual than its own one: f_p in r_N, f_N in r_p.
    air_flow : float
        How dear the air flow is in the residuals of H for three sensors, against the faults.
    process_noise : float
        Noise on commands and air flow in the observer's Riccati equation, over a measurement noise of one: small, so
        that M~ and N~ are slow against the sampling rate.
    sensor_noise : tuple of float
        What the sensors of p_e [Pa], SH [K], T_w [K] really have (rms at the sampling instants), for the thresholds.
    false_alarms_per_hour : float
        How often noise alone may take a residual over its threshold.
    air_flow_step : float
        Step of the air flow that must not be taken for a fault (1: a tenth of the operating point's flow).
    reduction : float
        How far the order reduction may be off, by its bound of twice the Hankel singular values left out, as a part of
        the H-infinity norm of H.
    superheat : "direct" or "derived"
        The superheat's sensor; derived, f_p and the noise of p_e enter both readings.
    """

    target_time_s: float = 10.0
    noise: MeasurementNoise = MeasurementNoise((0.02, 0.02, 0.02))
    error_corner_rad_s: float = 0.05
    error_at_rest: float = 0.01
    error_rolloff_rad_s: float = 1.0
    cross_talk: tuple[float, float] = (2.0, 4.0)
    air_flow: float = 1.0
    process_noise: float = 0.1
    sensor_noise: tuple[float, float, float] = (200.0, 0.1, 0.05)
    false_alarms_per_hour: float = 1e-3
    air_flow_step: float = 1.0
    reduction: float = 1e-4
    superheat: SuperheatSensor = "direct"
