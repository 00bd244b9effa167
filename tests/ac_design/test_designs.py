"""The designs, each claim checked by another route than the one that made it."""

import control
import numpy as np
import pytest
from CoolProp.CoolProp import PropsSI
from scipy.linalg import expm

from ac_common.cache import Arrays
from ac_common.units import KPA, RPM
from ac_design import ControllerWeights, FdiWeights, design_compensator
from ac_design import design_fdi as design
from ac_design.model import FAULT_UNIT, OUTPUT_UNIT, design_model
from ac_design.store import all_blocks, cached_design
from ac_plant_node import linearize, operating_point
from gimc.structure import closed_loop, disturbance_factor, fault_factor

SAMPLE_TIME_S = 0.1
POINT = "med"


def k0() -> Arrays:
    return cached_design("controller", "ac_design.controller", POINT, SAMPLE_TIME_S, ControllerWeights())


def response(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray, z: complex) -> np.ndarray:
    return np.asarray(c @ np.linalg.solve(z * np.eye(len(a)) - a, b) + d)


@pytest.mark.parametrize("point", ["low", "med", "high"])
def test_every_norm_is_what_was_claimed(point: str) -> None:
    reports = all_blocks(point, SAMPLE_TIME_S)
    assert [report.block for report in reports] == [
        "K0",
        "K0_paper",
        "K0_envelope",
        "K0_belt",
        "H_N",
        "H_p",
        "Q_both",
        "Q_act",
        "Q_sen",
    ]
    for report in reports:
        assert report.achieved <= report.claimed * 1.001, report
        assert report.achieved >= report.lower_bound * 0.999, report
        assert report.achieved_reduced <= report.achieved * 1.02, report
        assert report.order_reduced < report.order, report
        assert report.slowest_pole_rad_s < 0.0, report


def test_the_superheat_s_sensor_decides_where_the_pressure_fault_enters_and_which_design_is_met() -> None:
    direct, derived = (design_model(POINT, sensor).system for sensor in ("direct", "derived"))
    slope = PropsSI("d(T)/d(P)|sigma", "P", float(operating_point(POINT).outputs[0]), "Q", 1, "R134a")
    assert direct.F2[:, 1] * OUTPUT_UNIT == pytest.approx([5.0 * KPA, 0.0, 0.0])
    assert derived.F2[:, 1] * OUTPUT_UNIT == pytest.approx([5.0 * KPA, -slope * 5.0 * KPA, 0.0], rel=1e-4)
    assert not np.array_equal(design(POINT, SAMPLE_TIME_S).h_d, design(POINT, SAMPLE_TIME_S, superheat="derived").h_d)
    own, other = (
        design_compensator(POINT, SAMPLE_TIME_S, fdi=FdiWeights(superheat=sensor)) for sensor in ("direct", "derived")
    )
    assert not np.array_equal(own.d, other.d)
    with pytest.raises(ValueError, match="direct or derived"):
        design_model(POINT, "guessed")  # type: ignore[arg-type]


@pytest.mark.parametrize("omega", [1e-6, 1e-3, 0.05, 1.0, 30.0])
def test_the_factors_are_those_of_k0(omega: float) -> None:
    a = k0()
    A, B, C, D, L = (a[name] for name in ("K_a", "K_b", "K_c", "K_d", "Lk"))
    s = 1j * omega
    V = response(A + L @ C, L, C, np.eye(2), s)
    U = response(A + L @ C, B + L @ D, C, D, s)
    assert np.linalg.solve(V, U) == pytest.approx(response(A, B, C, D, s), rel=1e-6)
    assert np.linalg.eigvals(A + L @ C).real.max() < -1e-3


def test_the_near_integrators_are_zeros_of_v() -> None:
    a = k0()
    V_at_rest = response(a["K_a"] + a["Lk"] @ a["K_c"], a["Lk"], a["K_c"], np.eye(2), 0.0)
    assert np.linalg.svd(V_at_rest, compute_uv=False).max() < 0.02


def test_the_innovation_of_the_linear_plant_is_zero_without_faults() -> None:
    plant, fdi = linearize(POINT), design(POINT, SAMPLE_TIME_S)
    n = plant.nstates
    block = np.zeros((n + 4, n + 4))
    block[:n, :n], block[:n, n:] = plant.A * SAMPLE_TIME_S, plant.B * SAMPLE_TIME_S
    step = expm(block)
    random = np.random.default_rng(0)
    x, xi, largest = np.zeros(n), np.zeros(len(fdi.a)), 0.0
    for _ in range(400):
        y = plant.C @ x
        largest = max(largest, float(np.max(np.abs((fdi.c @ xi - y) / OUTPUT_UNIT))))
        u = random.normal(size=4) * [100.0 * RPM, 0.05, 0.0, 2.0]  # the air flow, which is not known, stays
        xi = fdi.a @ xi + fdi.b @ np.concatenate([u[[0, 1, 3]], y])
        x = step[:n, :n] @ x + step[:n, n:] @ u
    assert np.max(np.abs(plant.C @ x / OUTPUT_UNIT)) > 0.1  # the plant did move
    assert largest < 1e-8


def test_residuals_are_the_faults_at_rest_and_blind_to_the_air_flow() -> None:
    fdi, model = design(POINT, SAMPLE_TIME_S), design_model(POINT)
    L = cached_design("fdi", "ac_design.fdi", POINT, SAMPLE_TIME_S, FdiWeights())["L"]
    H = response(fdi.h_a, fdi.h_b, fdi.h_c, fdi.h_d, 1.0)
    faults = -OUTPUT_UNIT[:, None] * fault_factor(model.system, L)(0.0).real  # f_e = -N~f f, in SI
    assert H @ faults / FAULT_UNIT[:, None] == pytest.approx(np.eye(2), abs=0.01)
    air = -OUTPUT_UNIT * disturbance_factor(model.system, L)(0.0).real.ravel()  # of 10 % air flow
    assert np.abs(H @ air / FAULT_UNIT).max() < 0.02


@pytest.mark.parametrize(("fault", "unit"), [(0, 40.0 * RPM), (1, 5.0 * KPA)])
def test_the_residual_follows_its_fault_through_the_target_and_leaves_the_other_alone(fault: int, unit: float) -> None:
    """Peak of the difference from `1 / (10 s + 1)` over a step, on the sampled chain of observer and filter."""
    fdi, plant = design(POINT, SAMPLE_TIME_S), linearize(POINT)
    n = plant.nstates
    block = np.zeros((n + 1, n + 1))
    block[:n, :n], block[:n, n] = plant.A * SAMPLE_TIME_S, plant.B[:, 0] * SAMPLE_TIME_S
    step = expm(block)
    x, xi, eta, worst = np.zeros(n), np.zeros(len(fdi.a)), np.zeros(len(fdi.h_a)), 0.0
    for k in range(1500):
        y = plant.C @ x + np.array([unit if fault == 1 else 0.0, 0.0, 0.0])
        innovation = fdi.c @ xi - y
        residual = (fdi.h_c @ eta + fdi.h_d @ innovation) / FAULT_UNIT
        wanted = np.zeros(2)
        wanted[fault] = 1.0 - np.exp(-k * SAMPLE_TIME_S / 10.0)
        worst = max(worst, float(np.max(np.abs(residual - wanted))))
        eta = fdi.h_a @ eta + fdi.h_b @ innovation
        xi = fdi.a @ xi + fdi.b @ np.concatenate([np.zeros(3), y])
        x = step[:n, :n] @ x + step[:n, n] * (unit if fault == 0 else 0.0)
    assert worst < (0.06, 0.09)[fault]


def test_the_compensators_do_their_work_on_the_linear_loop() -> None:
    """Steps of both faults through plant, K0 and the sampled Q: outputs unmoved by f_N, commands by f_p."""
    a, model = k0(), design_model(POINT)
    K = control.ss(*(a[name] for name in ("K_a", "K_b", "K_c", "K_d")))
    L = cached_design("fdi", "ac_design.fdi", POINT, SAMPLE_TIME_S, FdiWeights())["L"]
    q = design_compensator(POINT, SAMPLE_TIME_S)
    unit_q = np.array([100.0 * RPM, 0.05])
    for fault in (0, 1):  # fault 0 by Q_act, fault 1 by Q_sen: rows 2-3 and 4-5 of the compensator
        system = model.system.with_faults([fault])
        loop = closed_loop(system, K, a["Lk"])
        observer = control.ss(system.A + L @ system.C, system.F1 + L @ system.F2, -system.C, -system.F2)
        plain, helped = step_responses(loop, observer, q, unit_q, fault)
        rows = slice(2, 4) if fault == 0 else slice(0, 2)
        assert np.abs(helped[:, rows]).max() < (0.35, 0.25)[fault] * np.abs(plain[:, rows]).max()


def step_responses(
    loop: control.StateSpace, observer: control.StateSpace, q: object, unit_q: np.ndarray, fault: int
) -> tuple[np.ndarray, np.ndarray]:
    """[u, y] over 600 s after a step of the fault, without and with the compensator, in design units."""
    n, no = loop.nstates, observer.nstates
    sampled_loop, sampled_observer = (control.c2d(s, SAMPLE_TIME_S) for s in (loop, observer))
    histories = []
    for share in (0.0, 1.0):
        x, xi, eta = np.zeros(n), np.zeros(no), np.zeros(len(q.a))
        history = np.empty((6000, 5))
        for k in range(6000):
            innovation = (sampled_observer.C @ xi + sampled_observer.D[:, 0]) * OUTPUT_UNIT
            both = q.c @ eta + q.d @ innovation
            signal = share * both[2 * fault + 2 : 2 * fault + 4] / unit_q
            inputs = np.concatenate([[0.0, 0.0, 0.0, 1.0], signal])
            history[k] = sampled_loop.C @ x + sampled_loop.D @ inputs
            eta = q.a @ eta + q.b @ innovation
            xi = sampled_observer.A @ xi + sampled_observer.B[:, 0]
            x = sampled_loop.A @ x + sampled_loop.B @ inputs
        histories.append(history)
    return histories[0], histories[1]
