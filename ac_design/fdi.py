"""Design of the observer (M~, N~) and of the isolation filter H at one operating point.

H minimises `|| [0 T] - H [N~d N~f] ||` (the paper's isolation problem) with `T = I / (10 s + 1)`: the residual is
then a low-passed estimate of each fault in the unit of that fault, and the air flow, which is not measured, has no
effect.

The rows of H, one for each residual, are solved separately: the norm of both together is that of the worse row, which
leaves the other one undetermined. In each row the other fault may have a larger weight than the row's fault.
"""

import time
from dataclasses import dataclass, replace

import control
import numpy as np
from numpy.typing import NDArray

from ac_common.cache import Arrays
from ac_design.model import (
    AIR_TEMPERATURE_UNIT,
    COMMAND_UNIT,
    FAULT_UNIT,
    OUTPUT_UNIT,
    DesignModel,
    design_model,
    sensor_noise,
    to_si,
)
from ac_design.report import BlockReport
from ac_design.thresholds import noise_thresholds, residual_covariances, step_peaks
from ac_design.weights import FdiWeights, MeasurementNoise
from ac_plant_node import operating_point
from gimc.coprime import filter_gain
from gimc.interconnect import (
    Abcd,
    add,
    block_diagonal,
    inverse,
    scale,
    series,
    stack_inputs,
    stack_outputs,
    state_space,
)
from gimc.model_matching import Matching, isolation_synthesis
from gimc.norms import hinf_norm, poles
from gimc.reduction import reduce_order
from gimc.sampled import discretise, sampled_observer
from gimc.structure import FaultySystem, disturbance_factor, fault_factor

Matrix = NDArray[np.float64]

STEP_LENGTH_S = 100.0
"""Length of the simulation that finds the peak of the residuals after a step of air flow; the plant settles in 60 s."""

RANK_NOISE = 1e-5
"""White noise on every measurement, in design units, so small that it only keeps the problem regular."""


def observer_gain(system: FaultySystem, weights: FdiWeights) -> Matrix:
    """Return the gain L of M~ and N~: that of the stationary Kalman filter for noise on commands and air flow."""
    inputs = weights.process_noise * np.hstack([system.B, system.E1])
    plant = control.ss(system.A, system.B, system.C, system.D)
    return filter_gain(plant, process=inputs @ inputs.T, measurement=np.ones(len(system.C)))


def innovation_factors(
    system: FaultySystem, L: Matrix, noise: MeasurementNoise
) -> tuple[control.StateSpace, control.StateSpace]:
    """Return `[N~d, M~ W]` and `N~f` on one common state: `f_e = -([N~d, M~ W] [d; n] + N~f f)`.

    Noise on the measurements enters f_e through M~, and so does the regularisation; hence the problem of a filter does
    not depend on the choice of L.
    """
    p, nf = len(system.C), system.F1.shape[1]
    Nd, Nf = disturbance_factor(system, L), fault_factor(system, L)
    level = np.diag(noise.level)
    A = block_diagonal(Nd.A, -noise.corner_rad_s * np.eye(p))
    A[: len(system.A), len(system.A) :] = L @ level
    C = np.hstack([Nd.C, level])
    B_noise = np.vstack([L @ level, (noise.at_rest - 1.0) * noise.corner_rad_s * np.eye(p)])
    B_d = np.vstack([Nd.B, np.zeros((p, Nd.ninputs))])
    B_f = np.vstack([Nf.B, np.zeros((p, nf))])
    disturbances = state_space((A, np.hstack([B_d, B_noise]), C, np.hstack([Nd.D, level])))
    return disturbances, state_space((A, B_f, C, Nf.D))


def target(weights: FdiWeights, size: int) -> control.StateSpace:
    """Return `T = I / (target_time s + 1)`."""
    speed, eye = np.eye(size) / weights.target_time_s, np.eye(size)
    return state_space((-speed, speed, eye, np.zeros((size, size))))


def synthesise(point: str, sample_time_s: float, weights: FdiWeights) -> Arrays:
    """Design observer, isolation filter and thresholds at one operating point.

    Returns
    -------
    dict of str to ndarray
        The fields of `fdi_node.detector.FdiDesign`; `L`, the continuous observer gain in design units; `report`.
    """
    started = time.perf_counter()
    model = design_model(point, weights.superheat)
    system = model.system
    L = observer_gain(system, weights)
    seen = replace(system, E1=weights.air_flow * system.E1)
    rows = isolation_rows(*innovation_factors(seen, L, weights.noise), weights, RANK_NOISE)
    reduced = reduce_order(stacked(rows), rtol=weights.reduction, keep_dc_gain=True)
    # f_e = -(N~d d + N~f f): the residual r = H f_e takes the minimiser with its sign changed.
    H = discretise(to_si(-reduced.system, OUTPUT_UNIT, FAULT_UNIT), sample_time_s)
    a, b, c = sampled_innovation(model, weights, sample_time_s)
    observer, filter_ = (a, b[:, 3:], c), (H.A, H.B, H.C, H.D)
    covariance, shifted = residual_covariances(observer, filter_, sensor_noise(point, weights))
    noise = noise_thresholds(covariance, shifted, sample_time_s, weights.false_alarms_per_hour)
    air = discretise(control.ss(system.A, system.E1, system.C, system.E2), sample_time_s, "zoh")
    plant = (air.A, weights.air_flow_step * air.B[:, 0], air.C * OUTPUT_UNIT[:, None])
    air_peaks = step_peaks(plant, observer, filter_, round(STEP_LENGTH_S / sample_time_s))
    rest = operating_point(point)
    seconds = (time.perf_counter() - started) / len(rows)
    reports = {
        f"report_{row.block}": row.report(reduced.system[i, :], reduced.order, weights, seconds).to_array()
        for i, row in enumerate(rows)
    }
    return {
        "a": a,
        "b": b,
        "c": c,
        "h_a": H.A,
        "h_b": H.B,
        "h_c": H.C,
        "h_d": H.D,
        "input_rest": np.array([*rest.inputs[:2], rest.inputs[3]]),
        "output_rest": np.array(rest.outputs[:3]),
        "thresholds": noise + air_peaks,
        "sample_time_s": np.array(sample_time_s),
        "L": L,
        **reports,
    }


@dataclass(frozen=True)
class IsolationRow:
    """One row of H: the problem `min || W ([0 t] - h [N~d, N~f S]) ||`, t the row of T, and its solution.

    S weights the column of the other fault (`FdiWeights.cross_talk`); it is part of the weights, not of the filter.
    """

    block: str
    innovation: control.StateSpace
    target: control.StateSpace
    weight: Abcd
    cross_talk_weight: Matrix
    matching: Matching

    @property
    def filter(self) -> Abcd:
        """Return the row h."""
        return series(inverse(self.weight), self.matching.filter)

    def norm(self, h: control.StateSpace, *, plain: bool = False) -> float:
        """Return the norm of this problem with the row h, or without W and S."""
        error = add(self.target, scale(series(h, self.innovation), left=-np.eye(1)))
        if plain:
            return float(hinf_norm(scale(error, right=1.0 / self.cross_talk_weight))[0])
        return float(hinf_norm(series(self.weight, error))[0])

    def report(self, h: control.StateSpace, order: int, weights: FdiWeights, seconds: float) -> BlockReport:
        """Return the report of this row, h the row after reduction to a state of `order` that both rows share."""
        return BlockReport(
            block=self.block,
            claimed=self.matching.synthesis.claimed_gamma,
            achieved=self.matching.synthesis.swept_gamma,
            achieved_reduced=self.norm(h),
            plain=self.norm(h, plain=True),
            lower_bound=self.matching.lower_bound,
            order=self.filter.A.shape[0],
            order_reduced=order,
            regularisation=str(weights.noise),
            slowest_pole_rad_s=float(poles(h).real.max()),
            seconds=seconds,
        )


def isolation_rows(
    disturbances: control.StateSpace, faults: control.StateSpace, weights: FdiWeights, eps: float
) -> list[IsolationRow]:
    """Solve the isolation problem row by row.

    Parameters
    ----------
    disturbances, faults : StateSpace
        N~d (with coloured noise, where there is one) and N~f on one common state.
    weights : FdiWeights
    eps : float
        White noise on the measurements that keeps the problem regular.

    Returns
    -------
    list of IsolationRow
        Of r_N and r_p.
    """
    # W ([0 t] - h N) = [0 W t] - (W h) N: W is stable with a stable inverse, so the filter that is free is W h.
    W, T = error_weight(weights, 1), target(weights, 2)
    rows = []
    for i, block in enumerate(("H_N", "H_p")):
        cross_talk_weight = np.ones(2)
        cross_talk_weight[1 - i] = weights.cross_talk[i]
        scaled = state_space(scale(faults, right=cross_talk_weight))
        wanted = state_space(scale(T[i, :], right=cross_talk_weight))
        matching = isolation_synthesis(disturbances, scaled, state_space(series(W, wanted)), eps)
        quiet = np.zeros((1, disturbances.ninputs))
        everything = np.concatenate([np.ones(disturbances.ninputs), cross_talk_weight])
        innovation = state_space(stack_inputs(disturbances, scaled))
        rows.append(IsolationRow(block, innovation, state_space(stack_inputs(quiet, wanted)), W, everything, matching))
    return rows


def stacked(rows: list[IsolationRow]) -> Abcd:
    """Return H in full order, its rows stacked."""
    return stack_outputs(*(row.filter for row in rows))


def error_weight(weights: FdiWeights, size: int) -> Abcd:
    """Return the weight on the isolation error (see `FdiWeights`), made proper and invertible."""
    corner, rolloff, eye = weights.error_corner_rad_s, weights.error_rolloff_rad_s, np.eye(size)
    rest = weights.error_at_rest * corner
    low = Abcd(-rest * eye, eye, (corner - rest) * eye, eye)
    ratio = 100.0
    high = Abcd(-ratio * rolloff * eye, eye, ratio * (1.0 - ratio) * rolloff * eye, ratio * eye)
    return series(high, low)


def sampled_innovation(model: DesignModel, weights: FdiWeights, sample_time_s: float) -> tuple[Matrix, Matrix, Matrix]:
    """Return (a, b, c) of the sampled N~ and M~ in SI units: `xi+ = a xi + b [u, T_ea, y]`, `f_e = c xi - y`.

    They are the factors of the plant sampled with its inputs held: without faults and disturbances, f_e of the linear
    plant is zero at every tick, however the commands move.
    """
    system = model.system
    inputs = weights.process_noise * np.hstack([system.B, system.E1])
    known = np.hstack([system.B, model.B_air])
    p = len(system.C)
    plant = control.ss(system.A, known, system.C, np.zeros((p, known.shape[1])))
    observer = sampled_observer(plant, sample_time_s, process=inputs @ inputs.T, measurement=np.ones(p))
    A, C = observer.plant.A, observer.plant.C
    unit_in = np.concatenate([COMMAND_UNIT, [AIR_TEMPERATURE_UNIT]])
    b = np.hstack([observer.plant.B / unit_in, -observer.L / OUTPUT_UNIT])
    return A + observer.L @ C, b, C * OUTPUT_UNIT[:, None]
