"""K0 for a compressor on the belt: the valve alone holds the superheat, the engine's speed is a measured disturbance.

Outputs `z = [e_SH, alpha, SH]`, all weighted, against `w = [m_ea, N, SH_r, n, n_N]`; measured `[e_SH + n, N + n_N]`,
command alpha. The evaporator pressure follows the speed. In the form in which the controller runs, which reads its
commands back after their limits, the engine's speed is the compressor's command, so its column of the read-back is that
of the measured disturbance and the controller's code is that of every other K0. The speed comes in its logarithmic
coordinate, in which the plant's gains change little while an engine goes through its range.
"""

import time

import control
import numpy as np
from numpy.typing import NDArray

from ac_common.cache import Arrays
from ac_common.units import KPA, RPM
from ac_design.controller import LIMIT_UNIT, coprime_gain
from ac_design.model import COMMAND_UNIT, OUTPUT_UNIT, DesignModel, design_model, to_si
from ac_design.report import BlockReport
from ac_design.weights import BeltWeights
from ac_plant_node import operating_point
from gimc.hinfsyn import hinf_synthesis
from gimc.interconnect import lft, state_space
from gimc.norms import hinf_norm, poles
from gimc.reduction import reduce_order
from gimc.sampled import discretise

Matrix = NDArray[np.float64]


def generalised_plant(model: DesignModel, weights: BeltWeights) -> control.StateSpace:
    """Return the generalised plant from [w, alpha] to [z, e + n, N + n_N], weights included.

    Returns
    -------
    StateSpace
        Inputs [m_ea, N, SH_r, n, n_N, alpha]; outputs [z (3), measured (2)].
    """
    system = model.system
    n, C = len(system.A), system.C[[1]]
    pole, direct = weights.integrator_rad_s, 1.0 / weights.peak
    into = weights.bandwidth_rad_s - pole * direct
    A = np.block([[system.A, np.zeros((n, 1))], [-into * C, np.array([[-pole]])]])
    speed = weights.speed * system.B[:, [0]]
    B1 = np.block(
        [
            [weights.disturbance * system.E1, speed, np.zeros((n, 3))],
            [np.zeros((1, 2)), np.array([[into, 0.0, 0.0]])],
        ]
    )
    B2 = np.vstack([system.B[:, [1]], np.zeros((1, 1))])
    no_state = np.zeros((1, n + 1))
    C1 = np.vstack([np.hstack([-direct * C, np.ones((1, 1))]), no_state, np.hstack([weights.output * C, [[0.0]]])])
    D11 = np.zeros((3, 5))
    D11[0, 2] = direct
    D12 = np.array([[0.0], [weights.command], [0.0]])
    C2 = np.vstack([np.hstack([-C, [[0.0]]]), no_state])
    D21 = np.array([[0.0, 0.0, 1.0, weights.noise, 0.0], [0.0, weights.speed, 0.0, 0.0, weights.speed_noise]])
    return control.ss(A, np.hstack([B1, B2]), np.vstack([C1, C2]), np.block([[D11, D12], [D21, np.zeros((2, 1))]]))


def factored(K: control.StateSpace, Lk: Matrix) -> control.StateSpace:
    """Return the controller from [p_e,r - p_e, SH_r - SH, N, alpha] to [N, alpha]: the read-back of alpha is V~'s.

    Raises
    ------
    ValueError
        When K answers the speed at once: its column of the read-back has no direct part.
    """
    if np.abs(K.D[:, 1]).max() > 1e-9:
        raise ValueError("K0 for the belt has a direct part from the engine's speed")
    into = np.hstack([np.zeros((K.nstates, 1)), K.B[:, [0]] + Lk @ K.D[:, [0]], K.B[:, [1]], -Lk])
    direct = np.array([[0.0] * 4, [0.0, K.D[0, 0], 0.0, 0.0]])
    return state_space((K.A + Lk @ K.C, into, np.vstack([np.zeros_like(K.C), K.C]), direct))


def synthesise(point: str, sample_time_s: float, weights: BeltWeights) -> Arrays:
    """Design K0 for the belt at one operating point; the result is as that of `ac_design.controller.synthesise`."""
    started = time.perf_counter()
    rest = np.array(operating_point(point).inputs[:2])
    problem = generalised_plant(design_model(point), weights)
    result = hinf_synthesis(problem, 2, 1)
    reduced = reduce_order(result.controller, rtol=weights.reduction / hinf_norm(result.controller)[0])
    K = reduced.system
    Lk = coprime_gain(K, weights.factor_speed)
    units = np.concatenate([OUTPUT_UNIT[:2], COMMAND_UNIT])
    factors = discretise(to_si(factored(K, Lk), units, COMMAND_UNIT), sample_time_s, "zoh")
    report = BlockReport(
        block="K0_belt",
        claimed=result.claimed_gamma,
        achieved=result.swept_gamma,
        achieved_reduced=hinf_norm(lft(problem, K, 2, 1))[0],
        plain=float("nan"),
        lower_bound=result.lower_gamma,
        order=result.controller.nstates,
        order_reduced=reduced.order,
        regularisation=f"noise {weights.noise:g}, {weights.speed_noise:g}",
        slowest_pole_rad_s=float(poles(K).real.max()),
        seconds=time.perf_counter() - started,
    )
    return {
        "phi": factors.A,
        "gamma": factors.B,
        "c": factors.C,
        "d": factors.D[:, :2],
        "command_rest": rest,
        "command_min": np.array(weights.limits.low) * LIMIT_UNIT,
        "command_max": np.array(weights.limits.high) * LIMIT_UNIT,
        "command_rate": np.array(weights.limits.rate) * LIMIT_UNIT,
        "sample_time_s": np.array(sample_time_s),
        "priority": np.eye(2),
        "lead": np.array([1e3 * KPA, weights.lead_k]),  # the pressure is nobody's to hold
        "lag_s": np.array([1.0, weights.lag_s]),
        "curvature": np.array([1.0 / (rest[0] + weights.speed_offset_rpm * RPM), 0.0]),
        "report": report.to_array(),
    }
