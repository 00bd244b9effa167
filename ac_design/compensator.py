"""Q_act, Q_sen and a Q for both faults by H-infinity model matching.

With `f_e = -(N~d d + N~f f)` and the closed loop of plant and K0, both problems have the form `min || T1 - T2 Q T3 ||`
over stable Q. Q_act keeps the outputs unmoved by a fault of the compressor's speed (the paper's first problem):

    min || W So M~^-1 (I - N~ V~^-1 Q_act) [alpha_d N~d, alpha_f N~f_act] ||

Q_sen keeps the command, and with it the actual outputs, unmoved by a fault of the pressure reading (the second one):

    min || [alpha_d So Pdy, 0; 0, -alpha_f W Si K Pfy_sen]
           + [-alpha_d So Puy V~^-1; -alpha_f W Si V~^-1] Q [N~d N~f_sen] ||

The second problem is solved with two changes. The actual outputs replace the readings, so K0's response to f_p appears
in the first row, where the paper has a zero. And alpha_d scales the disturbance as well as the first row: the upper
left entry is alpha_d^2 So Pdy.

For both faults at once the actual outputs have to stay where they are. Since the reading of the pressure is the actual
pressure plus f_p, that is the first problem for y minus the fault in the reading.
"""

import time
from dataclasses import replace

import control
import numpy as np
from numpy.typing import NDArray

from ac_common.cache import Arrays
from ac_design.fdi import RANK_NOISE, innovation_factors
from ac_design.model import COMMAND_UNIT, OUTPUT_UNIT, design_model, to_si
from ac_design.reach import OFFSETS, reach_excess
from ac_design.report import BlockReport
from ac_design.store import cached_design
from ac_design.weights import CompensatorWeights, ControllerWeights, FdiWeights, MatchingWeights
from ac_plant_node import operating_point
from fdi_node.detector import FdiDesign
from gimc.interconnect import (
    Abcd,
    add,
    append,
    block_diagonal,
    lft,
    scale,
    series,
    stack_inputs,
    stack_outputs,
    state_space,
)
from gimc.model_matching import Matching, model_matching, regularise
from gimc.norms import hinf_norm, poles
from gimc.reduction import reduce_order
from gimc.sampled import discretise
from gimc.structure import FaultySystem, closed_loop, disturbance_factor, fault_factor
from gimc_controller_node.authority import DESIGN_RANGE
from gimc_controller_node.compensator import CompensatorDesign
from gimc_controller_node.controller import ControllerDesign

Matrix = NDArray[np.float64]

FAULTS_OF = {"Q_both": [0, 1], "Q_act": [0], "Q_sen": [1]}
"""The faults, as columns of the design model, that each compensator is for."""

SLOPE_ERROR = 0.1
"""Relative error of the slope in the fault of a derived superheat, `-dT_sat/dp f_p`."""


PEAK_STEP_S, PEAK_LENGTH_S = 0.1, 100.0
"""Step and length of the simulation in which the peaks of q are found; the plant settles within 60 s."""


def low_frequency_weight(weights: MatchingWeights, size: int) -> Abcd:
    """Return `W = (s + corner) / (s + integrator)` on each of `size` signals."""
    eye = np.eye(size)
    return Abcd(-weights.integrator_rad_s * eye, eye, (weights.corner_rad_s - weights.integrator_rad_s) * eye, eye)


def output_objective(loop: control.StateSpace, readings: Matrix, weights: MatchingWeights) -> Abcd:
    """Return the system from [d, n, f, q] to the actual `W [p_e, SH]`.

    Parameters
    ----------
    loop : StateSpace
        As `gimc.structure.closed_loop` returns it.
    readings : ndarray, shape (2, nf)
        What the faults add to the readings of p_e and SH; subtracted to give the actual values.
    """
    return series(low_frequency_weight(weights, 2), _with_noise(actual_outputs(loop, readings), weights))


def sensor_objective(loop: control.StateSpace, readings: Matrix, weights: MatchingWeights) -> Abcd:
    """Return the system from [d, n, f_p, q] to the actual `alpha_d [p_e, SH]` and to `W u`.

    A disturbance has to move u: only what the fault and q do to u counts, which takes a second copy of the loop.
    """
    actual = _with_noise(actual_outputs(loop, readings), weights)
    without_d = scale(loop[:2, 2:], right=[0.0, *(1.0 for _ in range(readings.shape[1])), 1.0, 1.0])
    commands = series(low_frequency_weight(weights, 2), _with_noise(without_d, weights))
    return stack_outputs(scale(actual, left=weights.disturbance * np.eye(2)), commands)


def actual_outputs(loop: control.StateSpace, readings: Matrix) -> Abcd:
    """Return the system from [d, f, q] to the actual p_e and SH, without the faults in their readings."""
    return add(loop[2:4, 2:], -np.hstack([np.zeros((2, 1)), readings, np.zeros((2, 2))]))


def _with_noise(system: Abcd, weights: MatchingWeights) -> Abcd:
    """Replace the inputs [d, f, q] by [d, n, f, q], d and f scaled; n, noise and model uncertainty, has no effect."""
    nf, p = system.D.shape[1] - 3, len(weights.noise.level) + len(weights.model_uncertainty)
    route = np.zeros((3 + nf, 3 + nf + p))
    route[0, 0] = weights.disturbance
    route[1 : 1 + nf, 1 + p : 1 + p + nf] = weights.fault * np.eye(nf)
    route[1 + nf :, 1 + p + nf :] = np.eye(2)
    return scale(system, right=route)


def innovations(system: FaultySystem, L: Matrix, weights: MatchingWeights) -> Abcd:
    """Return the system from [d, n, f] to f_e, d and f scaled by alpha_d and alpha_f.

    n holds the noise of the readings and the model uncertainty: white noise on the commands that enters f_e only, like
    the response of a plant to the commands that the model does not have. It keeps the gain of the loop small that q
    closes through f_e on such a plant.
    """
    disturbances, faults = innovation_factors(system, L, weights.noise)
    commands = np.zeros((disturbances.nstates, 2))
    commands[: len(system.A)] = system.B
    uncertain = state_space((disturbances.A, commands, disturbances.C, np.zeros((len(system.C), 2))))
    noise = (*(1.0 for _ in weights.noise.level), *weights.model_uncertainty)
    sizes = [weights.disturbance, *noise, *(weights.fault for _ in range(faults.ninputs))]
    return scale(stack_inputs(stack_inputs(disturbances, uncertain), faults), left=-np.eye(len(system.C)), right=sizes)


def matching_problem(objective: Abcd, innovation: Abcd) -> Abcd:
    """Return the generalised plant of one compensator, from [d, n, f, q] to [objective, f_e]."""
    columns, nw = objective.D.shape[1], innovation.D.shape[1]
    shared = np.zeros((columns + nw, columns))
    shared[:columns], shared[columns:, :nw] = np.eye(columns), np.eye(nw)
    return scale(append(objective, innovation), right=shared)


def with_slope_error(system: FaultySystem) -> FaultySystem:
    """Add a second fault to the system of f_p: what f_p adds to a derived superheat beyond the slope at the point.

    `T_sat(p)` is curved, so away from the operating point f_p enters the superheat by a little less or more than the
    design says. At the high point 4 % of it, 0.02 K, would move the command by 1 rpm at rest. A superheat that is
    measured directly does not depend on f_p, and the system is returned unchanged.
    """
    if not system.F2[1].any():
        return system
    curved = np.zeros_like(system.F2)
    curved[1] = SLOPE_ERROR * system.F2[1]
    return replace(system, F1=np.hstack([system.F1, np.zeros_like(system.F1)]), F2=np.hstack([system.F2, curved]))


def solve(
    system: FaultySystem, L: Matrix, K: control.StateSpace, Lk: Matrix, block: str, weights: MatchingWeights
) -> tuple[Matching, Abcd]:
    """Solve the problem of "Q_both", "Q_act" or "Q_sen" in design units.

    Returns
    -------
    matching : Matching
        The filter, and what its synthesis found.
    problem : Abcd
        The generalised plant, regularised.
    """
    faulty = system.with_faults(FAULTS_OF[block])
    if block == "Q_sen":
        faulty = with_slope_error(faulty)
    loop, readings = closed_loop(faulty, K, Lk), faulty.F2[:2]
    objective = (sensor_objective if block == "Q_sen" else output_objective)(loop, readings, weights)
    problem = matching_problem(objective, innovations(faulty, L, weights))
    matching = model_matching(problem, len(system.C), 2, rho=weights.penalty, eps=RANK_NOISE)
    return matching, regularise(problem, len(system.C), 2, rho=weights.penalty, eps=RANK_NOISE)


def q_peaks(system: FaultySystem, L: Matrix, guard: control.StateSpace) -> Matrix:
    """Compute the peaks of the guard's q after unit steps of disturbance and faults, the largest for each command.

    Returns
    -------
    ndarray, shape (2,)
        In design units.
    """
    factors = stack_inputs(disturbance_factor(system, L), fault_factor(system, L))
    route = discretise(state_space(series(guard, factors)), PEAK_STEP_S, "zoh")
    state, peaks = np.zeros(route.B.shape), np.abs(route.D)
    for _ in range(round(PEAK_LENGTH_S / PEAK_STEP_S)):
        state = route.A @ state + route.B
        np.maximum(peaks, np.abs(route.C @ state + route.D), out=peaks)
    return np.asarray(peaks.max(axis=1))


def synthesise(
    point: str, sample_time_s: float, weights: CompensatorWeights, controller: ControllerWeights, fdi: FdiWeights
) -> Arrays:
    """Design the three compensators at one operating point.

    Returns
    -------
    dict of str to ndarray
        The fields of `gimc_controller_node.compensator.CompensatorDesign`; `report_Q_both`, `report_Q_act`,
        `report_Q_sen`.
    """
    model = design_model(point, fdi.superheat)
    L = cached_design("fdi", "ac_design.fdi", point, sample_time_s, fdi)["L"]
    k0 = cached_design("controller", "ac_design.controller", point, sample_time_s, controller)
    K, Lk = state_space([k0[name] for name in ("K_a", "K_b", "K_c", "K_d")]), k0["Lk"]
    filters, reports = [], []
    for block, chosen in (("Q_both", weights.guard), ("Q_act", weights.actuator), ("Q_sen", weights.sensor)):
        started = time.perf_counter()
        matching, problem = solve(model.system, L, K, Lk, block, chosen)
        reduced = reduce_order(matching.filter, rtol=chosen.reduction)
        if block == "Q_both":
            guard = reduced.system
        filters.append(discretise(to_si(reduced.system, OUTPUT_UNIT, COMMAND_UNIT), sample_time_s))
        reports.append(
            BlockReport(
                block=block,
                claimed=matching.synthesis.claimed_gamma,
                achieved=matching.synthesis.swept_gamma,
                achieved_reduced=hinf_norm(lft(problem, reduced.system, len(L.T), 2))[0],
                plain=matching.plain_gamma,
                lower_bound=matching.lower_bound,
                order=matching.filter.nstates,
                order_reduced=reduced.order,
                regularisation=f"rho {', '.join(f'{rho:g}' for rho in chosen.penalty)}, {chosen.noise}",
                slowest_pole_rad_s=float(poles(reduced.system).real.max()),
                seconds=time.perf_counter() - started,
            )
        )
    arrays = {
        "a": block_diagonal(*(q.A for q in filters)),
        "b": np.vstack([q.B for q in filters]),
        "c": block_diagonal(*(q.C for q in filters)),
        "d": np.vstack([q.D for q in filters]),
        "handover_time_s": np.array(weights.handover_time_s),
        "fade_time_s": np.array(weights.fade_time_s),
        "washout_time_s": np.array(weights.washout_time_s),
        "sample_time_s": np.array(sample_time_s),
        "q_range": DESIGN_RANGE * q_peaks(model.system, L, guard) * COMMAND_UNIT,
    }
    detector = FdiDesign.from_arrays(cached_design("fdi", "ac_design.fdi", point, sample_time_s, fdi))
    compensator = CompensatorDesign.from_arrays(arrays)
    return {
        **arrays,
        "reference_rest": np.array(operating_point(point).outputs[:2]),
        "reach_offsets": OFFSETS,
        "reach_excess": reach_excess(point, detector, ControllerDesign.from_arrays(k0), compensator),
        **{f"report_{report.block}": report.to_array() for report in reports},
    }
