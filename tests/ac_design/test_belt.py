"""K0 for a compressor on the belt: its norm by another route, its factors, and the sampled loop it closes."""

import control
import numpy as np
import pytest

from ac_common.units import RPM
from ac_design.belt import generalised_plant, synthesise
from ac_design.model import design_model
from ac_design.report import BlockReport
from ac_design.store import design_belt_controller
from ac_design.weights import BeltWeights
from ac_plant_node import linearize
from gimc.hinfsyn import hinf_synthesis
from gimc.sampled import discretise
from gimc_controller_node.limited_controller import limited_k0

T = 0.1
POINTS = ("low", "med", "high")


def at(system: control.StateSpace, s: complex) -> np.ndarray:
    return np.asarray(system.C @ np.linalg.solve(s * np.eye(len(system.A)) - system.A, system.B) + system.D)


def test_the_norm_is_that_of_the_closed_loop_frequency_by_frequency() -> None:
    """Each response solved for by itself from plant and controller, not by way of the closed loop's matrices."""
    problem = generalised_plant(design_model("med"), BeltWeights())
    result = hinf_synthesis(problem, 2, 1)
    worst = 0.0
    for omega in np.geomspace(1e-6, 1e3, 3000):
        P, K = at(problem, 1j * omega), at(result.controller, 1j * omega)
        loop = P[:3, :5] + P[:3, 5:] @ K @ np.linalg.solve(np.eye(2) - P[3:, 5:] @ K, P[3:, :5])
        worst = max(worst, float(np.linalg.svd(loop, compute_uv=False)[0]))
    report = BlockReport.from_array(synthesise("med", T, BeltWeights())["report"])
    assert worst == pytest.approx(report.achieved, rel=1e-3)
    assert worst <= report.claimed
    assert worst >= report.lower_bound * 0.999


@pytest.mark.parametrize("designed_at", POINTS)
@pytest.mark.parametrize("point", POINTS)
def test_the_sampled_loop_is_stable_at_every_point_with_every_design(point: str, designed_at: str) -> None:
    design, plant = design_belt_controller(designed_at, T), linearize(point)
    sampled = discretise(control.ss(plant.A, plant.B[:, [1]], plant.C[[1]], np.zeros((1, 1))), T, "zoh")
    n, m = len(sampled.A), len(design.phi)
    x, k = np.eye(n + m)[:n], np.eye(n + m)[n:]
    y = sampled.C @ x
    u = design.c[[1]] @ k - design.d[1, 1] * y
    loop = np.vstack(
        [sampled.A @ x + sampled.B @ u, design.phi @ k - design.gamma[:, [1]] @ y + design.gamma[:, [3]] @ u]
    )
    assert np.abs(np.linalg.eigvals(loop)).max() < 0.9985  # a time constant of 70 s


def test_only_the_valve_is_moved_and_only_superheat_and_speed_move_it() -> None:
    design = design_belt_controller("med", T)
    assert not design.c[0].any()
    assert not design.d[0].any()
    assert not design.gamma[:, 0].any()
    assert design.gamma[:, 2].any()
    assert design.curvature[0] > 0.0 == design.curvature[1]


def test_the_engines_speed_is_stated_and_read_back() -> None:
    design = design_belt_controller("med", T)
    controller, reference = limited_k0(design), np.array([250e3, 20.0])
    for rpm, measured in ((900.0, 20.0), (5900.0, 19.0), (900.0, 21.0)):
        controller.drive(rpm * RPM)
        for p_e in (100e3, 900e3):
            command = controller.step(reference, np.array([p_e, measured]), None)
            assert command[0] == rpm * RPM
            assert 0.0 <= command[1] <= 1.0


def test_more_speed_opens_the_valve_before_the_superheat_tells() -> None:
    design = design_belt_controller("med", T)
    controller, at_rest = limited_k0(design), np.array([251.2e3, 20.0])
    controller.drive(1500.0 * RPM)
    for _ in range(20):
        command = controller.step(at_rest, at_rest, None)
    assert command[1] > design.command_rest[1] + 0.01
