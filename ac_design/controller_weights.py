"""What the designs of K0, Q_act and Q_sen are free to choose, in design units (see `ac_design.model`)."""

from dataclasses import dataclass

from ac_design.weights import MeasurementNoise


@dataclass(frozen=True)
class CommandLimits:
    """What compressor and valve can do.

    Attributes
    ----------
    low, high : tuple of float
        Least and largest compressor speed [rpm] and valve opening [%].
    rate : tuple of float
        Fastest change, up and down: compressor [rpm/s], valve [%/s]. The defaults are those of an electric scroll
        compressor, which its inverter takes from standstill to full speed in six seconds, and of a stepper-motor
        valve with a stroke of four seconds (some 500 steps at 125 a second).
    """

    low: tuple[float, float] = (0.0, 0.0)
    high: tuple[float, float] = (6000.0, 100.0)
    rate: tuple[float, float] = (1000.0, 25.0)


@dataclass(frozen=True)
class ControllerWeights:
    """Weights of the synthesis, in design units (see `ac_design.model`).

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
        What the order reduction may change K0 by, in design units.
    limits : CommandLimits
        Of the commands; no part of the synthesis, but of what the controller does.
    lead : tuple of float
        How far a reference of p_e [kPa] and SH [K] may run ahead of the loop
        (`gimc_controller_node.reference_governor`): more than the paper's experiments ask for at once, less than what
        shuts the valve at the low point.
    lag_s : tuple of float
        How fast the loop is taken to follow, s: slower than it does.
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
    limits: CommandLimits = CommandLimits()
    lead: tuple[float, float] = (8.0, 3.0)
    lag_s: tuple[float, float] = (2.5, 10.0)


PAPER_CONTROLLER = ControllerWeights(
    bandwidth_rad_s=(0.3, 0.02),
    peak=(2.0, 10.0),
    integrator_rad_s=(1e-4, 0.2),
    command=(0.365, 0.1),
    output=(0.1, 0.05),
)
"""K0 as the paper's passive case has it: it holds p_e, leaves SH alone, and moves the valve as well as the compressor.

An actuator fault of 40 rpm is then taken back by 20 rpm, the rest by the valve. The default of `ControllerWeights`
holds both references instead and takes back all of it.
"""

CONTROLLERS = {"tracking": ControllerWeights(), "paper": PAPER_CONTROLLER}
"""The K0 that a scenario, or a node's parameter, may choose by name."""

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
    doubt : tuple of float
        How far the plant's answer to N and alpha may be off the model's, as noise on the commands that f_e alone sees.
    reduction : float
        How far the order reduction may be off, by its bound of twice the Hankel singular values left out, as a part of
        the H-infinity norm of Q.
    """

    disturbance: float = 0.1
    fault: float = 1.0
    corner_rad_s: float = 0.2
    integrator_rad_s: float = 1e-3
    penalty: tuple[float, float] = (0.5, 0.5)
    noise: MeasurementNoise = COMPENSATOR_NOISE
    doubt: tuple[float, float] = (0.0, 0.0)
    reduction: float = 1e-3


@dataclass(frozen=True)
class CompensatorWeights:
    """Weights of the three compensators.

    Attributes
    ----------
    guard : MatchingWeights
        Of Q for both faults at once, which stands guard. It spares the valve: under noise a valve in motion moves the
        plant's mean, which looks like a fault.
    actuator, sensor : MatchingWeights
        Of Q_act and Q_sen.
    handover_time_s : float
        Time constants (two lags) with which Q_act or Q_sen takes over from the guard once its fault is isolated.
    fade_time_s : float
        Time constant with which it goes out again.
    washout_time_s : float
        Time constants (two lags) with which the compensators forget what they give at rest while no fault is isolated.
    """

    guard: MatchingWeights = MatchingWeights(
        corner_rad_s=0.3,
        penalty=(0.2, 1.0),
        noise=MeasurementNoise((0.032, 0.032, 0.016)),
        doubt=(0.01, 0.07),
        reduction=2e-5,
    )
    actuator: MatchingWeights = MatchingWeights(penalty=(0.2, 0.2), reduction=4e-6)
    sensor: MatchingWeights = MatchingWeights()
    handover_time_s: float = 20.0
    fade_time_s: float = 5.0
    washout_time_s: float = 50.0


QUICK_GUARD = MatchingWeights(penalty=(0.1, 1.0), noise=MeasurementNoise((0.01, 0.01, 0.005)), reduction=2e-5)
"""A guard for sensors that are quieter than those assumed: it keeps a fault's peak near its bound.

Under the assumed noise it moves the commands twice as much as the guard in use, and with them the plant's mean, which
looks like a fault.
"""
