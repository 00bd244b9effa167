"""Q_act and Q_sen by H-infinity model matching.

With `f_e = -(N~d d + N~f f)` and the closed loop of plant and K0, both problems have the form `min || T1 - T2 Q T3 ||`
over stable Q. Q_act keeps the outputs unmoved by a fault of the compressor's speed (the paper's first problem):

    min || W So M~^-1 (I - N~ V~^-1 Q_act) [alpha_d N~d, alpha_f N~f_act] ||

Q_sen keeps the command, and with it the actual outputs, unmoved by a fault of the pressure reading (the second one):

    min || [alpha_d So Pdy, 0; 0, -alpha_f W Si K Pfy_sen]
           + [-alpha_d So Puy V~^-1; -alpha_f W Si V~^-1] Q [N~d N~f_sen] ||
"""

import time

import control
import numpy as np
from numpy.typing import NDArray

from fdi_node.cache import Arrays
from fdi_node.design_cache import cached_design
from fdi_node.design_model import COMMAND_UNIT, OUTPUT_UNIT, design_model, to_si
from fdi_node.design_report import BlockReport
from fdi_node.weights import FdiWeights
from gimc.interconnect import Abcd, add, append, block_diagonal, lft, scale, series, stack_outputs, state_space
from gimc.model_matching import Matching, model_matching, regularise
from gimc.norms import hinf_norm, poles
from gimc.reduction import reduce_order
from gimc.sampled import discretise
from gimc.structure import FaultySystem, closed_loop
from gimc_controller_node.weights import CompensatorWeights, ControllerWeights, MatchingWeights

Matrix = NDArray[np.float64]


def low_frequency_weight(weights: MatchingWeights, size: int) -> Abcd:
    """`W = (s + corner) / (s + integrator)` on each of `size` signals."""
    eye = np.eye(size)
    return Abcd(-weights.integrator_rad_s * eye, eye, (weights.corner_rad_s - weights.integrator_rad_s) * eye, eye)


def washout(weights: MatchingWeights, size: int) -> Abcd:
    """`s / (s + washout)` on each of `size` signals; the identity when there is none."""
    eye = np.eye(size)
    if weights.washout_rad_s == 0.0:
        return Abcd(np.zeros((0, 0)), np.zeros((0, size)), np.zeros((size, 0)), eye)
    return Abcd(-weights.washout_rad_s * eye, eye, -weights.washout_rad_s * eye, eye)


def innovation(system: FaultySystem, L: Matrix) -> Abcd:
    """`-[N~d N~f]`: from [d, f] to f_e."""
    into = np.hstack([system.E1 + L @ system.E2, system.F1 + L @ system.F2])
    return Abcd(system.A + L @ system.C, into, -system.C, -np.hstack([system.E2, system.F2]))


def actuator_objective(loop: control.StateSpace, weights: MatchingWeights) -> Abcd:
    """From [d, f_N, q] to the weighted outputs `W [p_e, SH]`; `loop` as `gimc.structure.closed_loop` returns it."""
    outputs = scale(loop[2:4, 2:], right=[weights.disturbance, weights.fault, 1.0, 1.0])
    return series(low_frequency_weight(weights, 2), outputs)


def sensor_objective(loop: control.StateSpace, sensor: Matrix, weights: MatchingWeights) -> Abcd:
    """From [d, f_p, q] to `alpha_d [p_e, SH]` (the actual values) and `alpha_f W u`.

    A disturbance has to move u: only what the fault and q do to u counts, which takes a second copy of the loop.

    Parameters
    ----------
    loop : StateSpace
        As `gimc.structure.closed_loop` returns it.
    sensor : ndarray, shape (2, 1)
        What the fault adds to the readings of p_e and SH: taken off again to have the actual values.
    """
    fault_reading = np.hstack([np.zeros((2, 1)), sensor, np.zeros((2, 2))])
    actual = add(loop[2:4, 2:], -fault_reading)
    commands = series(low_frequency_weight(weights, 2), scale(loop[:2, 2:], right=[0.0, 1.0, 1.0, 1.0]))
    return stack_outputs(
        scale(actual, left=weights.disturbance * np.eye(2)), scale(commands, left=weights.fault * np.eye(2))
    )


def matching_problem(objective: Abcd, innovations: Abcd, weights: MatchingWeights) -> Abcd:
    """Generalised plant of one compensator: from [d, f, q^] to [objective, f_e], with `q = s / (s + washout) q^`."""
    columns, nw = objective.D.shape[1], innovations.D.shape[1]
    shared = np.zeros((columns + nw, columns))
    shared[:columns], shared[columns:, :nw] = np.eye(columns), np.eye(nw)
    problem = scale(append(objective, innovations), right=shared)
    return series(problem, append(np.eye(nw), washout(weights, columns - nw)))


def solve(
    system: FaultySystem, L: Matrix, K: control.StateSpace, Lk: Matrix, fault: int, weights: MatchingWeights
) -> tuple[Matching, Abcd]:
    """Solve the problem of Q_act (fault 0) or Q_sen (fault 1) in design units.

    Returns
    -------
    matching : Matching
        The free filter, before the washout, and what its synthesis found.
    problem : Abcd
        The generalised plant of the free filter, regularised.
    """
    faulty = system.with_faults([fault])
    loop = closed_loop(faulty, K, Lk)
    objective = sensor_objective(loop, faulty.F2[:2], weights) if fault else actuator_objective(loop, weights)
    problem = matching_problem(objective, innovation(faulty, L), weights)
    matching = model_matching(problem, len(system.C), 2, rho=weights.penalty, eps=weights.noise)
    return matching, regularise(problem, len(system.C), 2, rho=weights.penalty, eps=weights.noise)


def synthesise(
    point: str, sample_time_s: float, weights: CompensatorWeights, controller: ControllerWeights, fdi: FdiWeights
) -> Arrays:
    """Everything the compensator needs at one operating point, and the reports of both designs.

    Returns
    -------
    dict of str to ndarray
        The fields of `gimc_controller_node.compensator.CompensatorDesign`; `report_act`, `report_sen`.
    """
    model = design_model(point)
    L = cached_design("fdi", "fdi_node.synthesis", point, sample_time_s, fdi)["L"]
    k0 = cached_design("controller", "gimc_controller_node.controller_design", point, sample_time_s, controller)
    K, Lk = state_space([k0[name] for name in ("K_a", "K_b", "K_c", "K_d")]), k0["Lk"]
    filters, reports = [], []
    for fault, (block, chosen) in enumerate((("Q_act", weights.actuator), ("Q_sen", weights.sensor))):
        started = time.perf_counter()
        matching, problem = solve(model.system, L, K, Lk, fault, chosen)
        reduced = reduce_order(matching.filter, rtol=chosen.reduction)
        Q = state_space(series(washout(chosen, 2), reduced.system))
        filters.append(discretise(to_si(Q, OUTPUT_UNIT, COMMAND_UNIT), sample_time_s))
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
                regularisation=f"rho {chosen.penalty:g}, eps {chosen.noise:g}",
                slowest_pole_rad_s=float(poles(Q).real.max()),
                seconds=time.perf_counter() - started,
            )
        )
    act, sen = filters
    return {
        "a": block_diagonal(act.A, sen.A),
        "b": np.vstack([act.B, sen.B]),
        "c": block_diagonal(act.C, sen.C),
        "d": np.vstack([act.D, sen.D]),
        "fade_time_s": np.array(weights.fade_time_s),
        "sample_time_s": np.array(sample_time_s),
        "report_act": reports[0].to_array(),
        "report_sen": reports[1].to_array(),
    }
