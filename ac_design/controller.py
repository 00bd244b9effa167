"""K0 by H-infinity synthesis, and its left coprime factors.

The paper's problem (its section on the coprime factorisation of the controller): outputs
`z = [e_pe, e_SH, N, alpha, p_e, SH]`, all weighted, against `w = [m_ea, p_e,r, SH_r, n_1, n_2]`. The errors' weights
are near-integrators, so that K0 holds both references at rest.
"""

import time

import control
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from ac_common.cache import Arrays
from ac_common.units import KPA, RPM
from ac_design.model import COMMAND_UNIT, OUTPUT_UNIT, DesignModel, design_model, to_si
from ac_design.report import BlockReport
from ac_design.weights import ControllerWeights
from ac_plant_node import operating_point
from gimc.coprime import filter_gain
from gimc.hinfsyn import hinf_synthesis
from gimc.interconnect import lft, state_space
from gimc.norms import hinf_norm, poles
from gimc.reduction import reduce_order
from gimc.sampled import discretise

Matrix = NDArray[np.float64]

LIMIT_UNIT = np.array([RPM, 0.01])
"""Units of `CommandLimits`: rpm and %."""

LEAD_UNIT = np.array([KPA, 1.0])
"""Units of `ControllerWeights.lead`: kPa and K."""

ENVELOPE_POINT = "med"
"""Where K0 is designed for the whole envelope."""

PRIORITY_S = 5.0
"""How far ahead the effect of the commands counts when one of them is at a limit; not critical."""


def generalised_plant(model: DesignModel, weights: ControllerWeights) -> control.StateSpace:
    """Return the generalised plant from [w, u] to [z, e], weights included.

    Error weight: `(s/peak + bandwidth) / (s + integrator)`.

    Returns
    -------
    StateSpace
        Inputs [m_ea, p_e,r, SH_r, n_1, n_2, N, alpha]; outputs [z (6), e + n (2)].
    """
    system = model.system
    n, C = len(system.A), system.C[:2]
    pole = np.diag(weights.integrator_rad_s)
    direct = np.diag(1.0 / np.array(weights.peak))
    into = np.diag(weights.bandwidth_rad_s) - pole @ direct
    A = np.block([[system.A, np.zeros((n, 2))], [-into @ C, -pole]])
    B1 = np.block(
        [
            [weights.disturbance * system.E1, np.zeros((n, 4))],
            [np.zeros((2, 1)), into, np.zeros((2, 2))],
        ]
    )
    B2 = np.vstack([system.B, np.zeros((2, 2))])
    C1 = np.block(
        [
            [-direct @ C, np.eye(2)],
            [np.zeros((2, n + 2))],
            [np.diag(weights.output) @ C, np.zeros((2, 2))],
        ]
    )
    D11 = block_diag(np.zeros((0, 1)), np.vstack([direct, np.zeros((4, 2))]), np.zeros((0, 2)))
    D12 = np.vstack([np.zeros((2, 2)), np.diag(weights.command), np.zeros((2, 2))])
    C2 = np.hstack([-C, np.zeros((2, 2))])
    D21 = np.hstack([np.zeros((2, 1)), np.eye(2), weights.noise * np.eye(2)])
    return control.ss(A, np.hstack([B1, B2]), np.vstack([C1, C2]), np.block([[D11, D12], [D21, np.zeros((2, 2))]]))


def coprime_gain(K: control.StateSpace, speed: float) -> Matrix:
    """Return the gain Lk of K0's left coprime factors, which keeps the near-integrators of K0 as zeros of V~.

    The zeros of `V~ = (Ak+Lk Ck, Lk, Ck, I)` are the poles of K0. With `Lk = 0` they would be cancelled by V~'s own
    poles; a filter Riccati equation moves those poles, the slow ones most, and leaves the zeros at the integrators.

    Parameters
    ----------
    K : StateSpace
    speed : float
        Process noise over measurement noise of the filter problem; larger is faster.
    """
    return filter_gain(K, process=speed * K.B @ K.B.T, measurement=np.ones(K.noutputs))


def factored(K: control.StateSpace, Lk: Matrix) -> control.StateSpace:
    """Return `[U~, I - V~]` from [r - y, u] to u, the form in which the controller runs."""
    closed = K.A + Lk @ K.C
    return state_space((closed, np.hstack([K.B + Lk @ K.D, -Lk]), K.C, np.hstack([K.D, np.zeros((2, 2))])))


def limit_priority(model: DesignModel) -> Matrix:
    """Return `G' G`, G the response of p_e and SH [design units] after `PRIORITY_S` to steps of the commands (SI)."""
    system = model.system
    held = discretise(control.ss(system.A, system.B, system.C[:2], np.zeros((2, 2))), PRIORITY_S, "zoh")
    G = held.C @ held.B / COMMAND_UNIT
    return np.asarray(G.T @ G)


def synthesise(point: str, sample_time_s: float, weights: ControllerWeights) -> Arrays:
    """Design K0 and its coprime factors at one operating point.

    With logarithmic coordinates of the commands K0 is the medium point's at every point: `point` then is where the
    coordinates have their origin.

    Returns
    -------
    dict of str to ndarray
        The fields of `gimc_controller_node.controller.ControllerDesign`; `K_a` ... `K_d` and `Lk`, the continuous K0
        and the gain of its factors in design units; `report`.
    """
    started = time.perf_counter()
    curvature = _curvature(point, weights)
    design_point = ENVELOPE_POINT if curvature.any() else point
    model = design_model(design_point)
    problem = generalised_plant(model, weights)
    result = hinf_synthesis(problem, 2, 2)
    # Small against the gains that matter, not against the integrators' gain at rest.
    reduced = reduce_order(result.controller, rtol=weights.reduction / hinf_norm(result.controller)[0])
    K = reduced.system
    Lk = coprime_gain(K, weights.factor_speed)
    factors = discretise(
        to_si(factored(K, Lk), np.concatenate([OUTPUT_UNIT[:2], COMMAND_UNIT]), COMMAND_UNIT), sample_time_s, "zoh"
    )
    # Of the coordinates with their origin at the point of the design, in those with their origin at `point`.
    scale = curvature / _curvature(design_point, weights) if curvature.any() else np.ones(2)
    report = BlockReport(
        block="K0",
        claimed=result.claimed_gamma,
        achieved=result.swept_gamma,
        achieved_reduced=hinf_norm(lft(problem, K, 2, 2))[0],
        plain=float("nan"),
        lower_bound=result.lower_gamma,
        order=result.controller.nstates,
        order_reduced=reduced.order,
        regularisation=f"noise {weights.noise:g}",
        slowest_pole_rad_s=float(poles(K).real.max()),
        seconds=time.perf_counter() - started,
    )
    return {
        "phi": factors.A,
        "gamma": factors.B * np.concatenate([np.ones(2), scale]),
        "c": factors.C / scale[:, None],
        "d": factors.D[:, :2] / scale[:, None],
        "command_rest": np.array(operating_point(point).inputs[:2]),
        "command_min": np.array(weights.limits.low) * LIMIT_UNIT,
        "command_max": np.array(weights.limits.high) * LIMIT_UNIT,
        "command_rate": np.array(weights.limits.rate) * LIMIT_UNIT,
        "sample_time_s": np.array(sample_time_s),
        "priority": limit_priority(model) * np.outer(scale, scale),
        "lead": np.array(weights.lead) * LEAD_UNIT,
        "lag_s": np.array(weights.lag_s),
        "approach_k": np.array(weights.approach_k),
        "curvature": curvature,
        "K_a": K.A,
        "K_b": K.B,
        "K_c": K.C,
        "K_d": K.D,
        "Lk": Lk,
        "report": report.to_array(),
    }


def _curvature(point: str, weights: ControllerWeights) -> Matrix:
    """Return `ControllerDesign.curvature` with the origin at a point, shape (2,)."""
    return np.asarray(1.0 / (operating_point(point).inputs[:2] + np.array(weights.log_offset) * LIMIT_UNIT))
