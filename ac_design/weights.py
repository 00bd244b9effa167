"""Weights of the designs of observer, isolation filter, K0 and compensators, in design units."""

import math
from dataclasses import dataclass, field
from typing import Literal

from gimc_controller_node.command_limits import CommandLimits
from gimc_controller_node.controller import NO_APPROACH_K

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
        """Return the text that `acftc design` prints."""
        return f"eps {', '.join(f'{level:g}' for level in self.level)}"


@dataclass(frozen=True)
class FdiWeights:
    """Weights of observer, isolation filter and thresholds, in design units (see `ac_design.model`).

    Attributes
    ----------
    target_time_s : float
        Time constant of T: the residuals are the faults through `1 / (target_time_s s + 1)`.
    noise : MeasurementNoise
        The regularisation "eps" of H.
    error_corner_rad_s, error_at_rest, error_rolloff_rad_s : float
        The weight on `[0 T] - H [N~d N~f]`, `(s + corner) / (s + at_rest * corner) * (s / rolloff + 1)`: large at rest,
        where the estimates are read, and far above T's bandwidth, where steps appear in the other residual. Zeros of
        `[N~d N~f]` in the right half plane near 1 rad/s leave an error of about T there with any H.
    cross_talk : tuple of float
        Weight of the other fault in a residual, relative to its fault: f_p in r_N, f_N in r_p.
    air_flow : float
        Weight of the air flow in the residuals of H for three sensors, relative to the faults.
    process_noise : float
        Noise on commands and air flow in the observer's Riccati equation, over a measurement noise of one: small, so
        that M~ and N~ are slow against the sampling rate.
    sensor_noise : tuple of float
        Noise of the sensors of p_e [Pa], SH [K], T_w [K] (rms at the sampling instants), for the thresholds.
    false_alarms_per_hour : float
        How often noise alone may take a residual over its threshold.
    air_flow_step : float
        Step of the air flow that must not be taken for a fault (1: a tenth of the operating point's flow).
    reduction : float
        Largest error of the order reduction, by its bound of twice the Hankel singular values left out, relative to the
        H-infinity norm of H.
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


@dataclass(frozen=True)
class ControllerWeights:
    """Weights of the synthesis of K0, in design units (see `ac_design.model`).

    Attributes
    ----------
    bandwidth_rad_s : tuple of float
        Where the weights of e_pe and e_SH cross one.
    peak : tuple of float
        What the sensitivities may reach at high frequency.
    integrator_rad_s : tuple of float
        Poles of the errors' weights: the "near-integrators".
    command : tuple of float
        Weights of N and alpha.
    output : tuple of float
        Weights of p_e and SH.
    noise : float
        Size of the sensor noises n_1, n_2.
    disturbance : float
        Size of the air flow's changes.
    factor_speed : float
        Speed of V~'s and U~'s poles (see `ac_design.controller.coprime_gain`).
    reduction : float
        Largest error of the order reduction of K0, in design units.
    limits : CommandLimits
        Limits of the commands; not used in the synthesis, but by the controller.
    lead : tuple of float
        Part of a step of the references of p_e [kPa] and SH [K] that the reference governor
        (`gimc_controller_node.reference_governor`) passes on at once: more than the steps of the paper's experiments,
        less than what shuts the valve at the low point.
    lag_s : tuple of float
        Time constants with which the governor assumes that the loop follows, s: slower than the loop.
    log_offset : tuple of float
        o of the commands' coordinates `(u_0 + o) ln((u + o) / (u_0 + o))`, speed [rpm] and opening [%], for one K0 over
        the whole envelope; infinite: the commands themselves.
    approach_k : float
        How much colder than the air at its inlet the refrigerant has to leave the evaporator: a superheat beyond, which
        shuts the valve, is not asked for; `NO_APPROACH_K`: any is.
    """

    bandwidth_rad_s: tuple[float, float] = (0.3, 0.1)
    peak: tuple[float, float] = (2.0, 2.0)
    integrator_rad_s: tuple[float, float] = (1e-4, 1e-4)
    command: tuple[float, float] = (0.05, 0.1)
    output: tuple[float, float] = (0.1, 0.1)
    noise: float = 1e-4
    disturbance: float = 0.5
    factor_speed: float = 10.0
    reduction: float = 1e-3
    limits: CommandLimits = field(default_factory=CommandLimits)
    lead: tuple[float, float] = (8.0, 3.0)
    lag_s: tuple[float, float] = (2.5, 10.0)
    log_offset: tuple[float, float] = (math.inf, math.inf)
    approach_k: float = NO_APPROACH_K


PAPER_CONTROLLER = ControllerWeights(
    bandwidth_rad_s=(0.3, 0.02),
    peak=(2.0, 10.0),
    integrator_rad_s=(1e-4, 0.2),
    command=(0.365, 0.1),
    output=(0.1, 0.05),
)
"""K0 after the paper's passive case: it holds p_e, leaves SH uncontrolled, and moves valve and compressor.

An actuator fault of 40 rpm is then taken back by 20 rpm, the rest by the valve. The default of `ControllerWeights`
holds both references instead and takes back all of it.
"""

ENVELOPE_CONTROLLER = ControllerWeights(
    bandwidth_rad_s=(1.2, 0.3),
    lead=(16.0, 6.0),
    lag_s=(1.5, 5.0),
    log_offset=(300.0, 2.0),
    approach_k=2.0,
)
"""One K0 for the whole envelope: of the medium point, in the logarithms of the commands."""

CONTROLLERS = {"tracking": ControllerWeights(), "paper": PAPER_CONTROLLER}
"""The K0 that a scenario, or a node's parameter, may choose by name."""


@dataclass(frozen=True)
class BeltWeights:
    """Weights of the synthesis of K0 for a compressor on the belt (`ac_design.belt`), in design units.

    Attributes
    ----------
    bandwidth_rad_s, peak, integrator_rad_s
        Of e_SH, as in `ControllerWeights`.
    command, output : float
        Weights of alpha and SH.
    speed, disturbance : float
        Sizes of the changes of engine speed and air flow.
    noise, speed_noise : float
        Sizes of the noises on e_SH and the engine's speed.
    factor_speed, reduction, limits
        As in `ControllerWeights`.
    lead_k, lag_s : float
        Of the reference governor for SH, as in `ControllerWeights`.
    speed_offset_rpm : float
        N_s of the speed's coordinate `(N_0 + N_s) ln((N + N_s) / (N_0 + N_s))`.
    """

    bandwidth_rad_s: float = 0.6
    peak: float = 2.0
    integrator_rad_s: float = 1e-4
    command: float = 0.1
    output: float = 0.1
    speed: float = 1.0
    disturbance: float = 0.5
    noise: float = 1e-4
    speed_noise: float = 1e-2
    factor_speed: float = 10.0
    reduction: float = 1e-3
    limits: CommandLimits = field(default_factory=CommandLimits)
    lead_k: float = 3.0
    lag_s: float = 10.0
    speed_offset_rpm: float = 300.0


BELT = "belt"
"""Name of the K0 for a compressor on the belt."""

COMPENSATOR_NOISE = MeasurementNoise((0.1, 0.1, 0.05))


@dataclass(frozen=True)
class MatchingWeights:
    """Weights of one compensator's model-matching problem.

    Attributes
    ----------
    disturbance, fault : float
        alpha_d and alpha_f of the paper.
    corner_rad_s, integrator_rad_s : float
        The weight `W = (s + corner) / (s + integrator)` on what must be exact at rest.
    penalty : tuple of float
        Regularisation rho on the parts of q for N and alpha.
    noise : MeasurementNoise
        Regularisation eps on the measurements.
    model_uncertainty : tuple of float
        Model uncertainty: how far the plant's response to N and alpha may differ from the model's, as noise on the
        commands that enters f_e only.
    reduction : float
        Largest error of the order reduction, by its bound of twice the Hankel singular values left out, relative to the
        H-infinity norm of Q.
    """

    disturbance: float = 0.1
    fault: float = 1.0
    corner_rad_s: float = 0.2
    integrator_rad_s: float = 1e-3
    penalty: tuple[float, float] = (0.5, 0.5)
    noise: MeasurementNoise = COMPENSATOR_NOISE
    model_uncertainty: tuple[float, float] = (0.0, 0.0)
    reduction: float = 1e-3


@dataclass(frozen=True)
class CompensatorWeights:
    """Weights of the three compensators.

    Attributes
    ----------
    guard : MatchingWeights
        Of Q_both, for both faults at once. It penalises the valve more: a valve that moves under noise shifts the
        plant's mean, which looks like a fault.
    actuator, sensor : MatchingWeights
        Of Q_act and Q_sen.
    handover_time_s : float
        Time constants (two lags) with which Q_act or Q_sen takes over from the guard once its fault is isolated.
    fade_time_s : float
        Time constant with which it fades out again.
    washout_time_s : float
        Time constants (two lags) of the washout of the compensators' outputs while no fault is isolated.
    """

    guard: MatchingWeights = MatchingWeights(
        corner_rad_s=0.3,
        penalty=(0.2, 1.0),
        noise=MeasurementNoise((0.032, 0.032, 0.016)),
        model_uncertainty=(0.01, 0.07),
        reduction=2e-5,
    )
    actuator: MatchingWeights = MatchingWeights(penalty=(0.2, 0.2), reduction=4e-6)
    sensor: MatchingWeights = MatchingWeights()
    handover_time_s: float = 20.0
    fade_time_s: float = 5.0
    washout_time_s: float = 50.0


QUICK_GUARD = MatchingWeights(penalty=(0.1, 1.0), noise=MeasurementNoise((0.01, 0.01, 0.005)), reduction=2e-5)
"""A guard for sensors with less noise than assumed: it keeps the peak of a fault near its lower bound.

Under the assumed noise it moves the commands twice as much as the default guard, and with them the plant's mean, which
looks like a fault.
"""
