"""The detector that the paper starts from (E2, E3): isolation with p_e and superheat, without the wall thermocouple.

Two measurements suffice for two faults without a disturbance, so the filter is designed without one; an unknown air
flow then enters the residuals. `lower_bound` shows that no other filter is better. The design has the shape of that for
three sensors with zeros for the wall temperature, so the same detector runs it.
"""

from dataclasses import replace

import control
import numpy as np
from numpy.typing import NDArray

from ac_common.cache import Arrays
from ac_design.fdi import RANK_NOISE, innovation_factors, isolation_rows, stacked, target
from ac_design.model import (
    AIR_TEMPERATURE_UNIT,
    COMMAND_UNIT,
    FAULT_UNIT,
    OUTPUT_UNIT,
    design_model,
    sensor_noise,
    to_si,
)
from ac_design.thresholds import noise_thresholds, residual_covariances
from ac_design.weights import FdiWeights
from ac_plant_node import operating_point
from gimc.coprime import filter_gain
from gimc.model_matching import isolation_synthesis
from gimc.reduction import reduce_order
from gimc.sampled import discretise, sampled_observer
from gimc.structure import FaultySystem, disturbance_factor, fault_factor

SENSORS = 2
#: White noise that regularises the lower bound's problem, in design units.
EPS = 0.02
#: Weight of the other fault in a residual, as in `FdiWeights`; without a disturbance larger ones are possible.
CROSS_TALK = (4.0, 16.0)
#: Noise on commands and air flow in the observer's Riccati equation, over a measurement noise of one.
PROCESS_NOISE = 0.3


def synthesise(point: str, sample_time_s: float, weights: FdiWeights) -> Arrays:
    """Design observer, isolation filter and thresholds for two measurements at one operating point.

    Parameters
    ----------
    point : str
        "low", "med" or "high".
    sample_time_s : float
        0.01 to 0.1 s.
    weights : FdiWeights
        Used: T's time constant, weights of the error, regularisation, noise of the sensors, rate of false alarms.

    Returns
    -------
    dict of str to ndarray
        The fields of `fdi_node.detector.FdiDesign`; `gamma`, the norms reached without a disturbance; `lower_bound`,
        below which no filter gets once the air flow is unknown (a filter that gives nothing reaches 1).
    """
    model = design_model(point, weights.superheat)
    system = model.system.with_outputs(list(range(SENSORS)))
    noisy = PROCESS_NOISE * np.hstack([system.B, system.E1])
    noise = {"process": noisy @ noisy.T, "measurement": np.ones(SENSORS)}
    known = np.hstack([system.B, model.B_air])
    plant = control.ss(system.A, known, system.C, np.zeros((SENSORS, known.shape[1])))
    L = filter_gain(plant, **noise)
    borne = replace(weights.noise, level=weights.noise.level[:SENSORS])
    calm = replace(system, E1=0.0 * system.E1, E2=0.0 * system.E2)
    separating = replace(weights, cross_talk=CROSS_TALK)
    rows = isolation_rows(*innovation_factors(calm, L, borne), separating, RANK_NOISE)
    reduced = reduce_order(stacked(rows), rtol=weights.reduction, keep_dc_gain=True).system
    # f_e = -(N~d d + N~f f), as for three sensors.
    H = discretise(to_si(-reduced, OUTPUT_UNIT[:SENSORS], FAULT_UNIT), sample_time_s)

    observer = sampled_observer(plant, sample_time_s, **noise)
    A, C = observer.plant.A, observer.plant.C
    a = A + observer.L @ C
    b = np.hstack(
        [
            observer.plant.B / np.concatenate([COMMAND_UNIT, [AIR_TEMPERATURE_UNIT]]),
            -observer.L / OUTPUT_UNIT[:SENSORS],
            np.zeros((len(A), 1)),
        ]
    )
    c = np.vstack([C * OUTPUT_UNIT[:SENSORS, None], np.zeros((1, len(A)))])
    h = (H.A, np.hstack([H.B, np.zeros((len(H.A), 1))]), H.C, np.hstack([H.D, np.zeros((len(H.C), 1))]))
    covariance, shifted = residual_covariances((a, b[:, 3:], c), h, sensor_noise(point, weights))
    rest = operating_point(point)
    return {
        "a": a,
        "b": b,
        "c": c,
        **dict(zip(("h_a", "h_b", "h_c", "h_d"), h, strict=True)),
        "input_rest": np.array([*rest.inputs[:2], rest.inputs[3]]),
        "output_rest": np.array(rest.outputs[:3]),
        "thresholds": noise_thresholds(covariance, shifted, sample_time_s, weights.false_alarms_per_hour),
        "sample_time_s": np.array(sample_time_s),
        "gamma": np.array([row.matching.gamma for row in rows]),
        "lower_bound": np.array(_bound(system, L, weights)),
    }


def _bound(system: FaultySystem, L: NDArray[np.float64], weights: FdiWeights) -> float:
    """Return the lower bound of `|| [0 T] - H [N~d N~f] ||` over all H, the air flow unknown."""
    Nd, Nf = disturbance_factor(system, L), fault_factor(system, L)
    return isolation_synthesis(Nd, Nf, target(weights, Nf.ninputs), EPS).plain_lower_bound
