"""Steps with K0 alone: no windup on the linear plant; on the nonlinear one the governor helps."""

import numpy as np
import pytest

from ac_design import design_controller
from ac_design.analysis.step_response import STEPS_KPA, overshoot, run, there_and_back
from ac_plant_node import operating_point
from gimc_controller_node import limited_k0

SAMPLE_TIME_S = 0.1
STEPS = [(point, step_kpa) for point, steps in STEPS_KPA.items() for step_kpa in steps]


@pytest.mark.parametrize(
    ("point", "step_kpa"),
    [("med", 70.0), ("low", 60.0), ("low", -40.0), ("med", -60.0), ("high", 60.0), ("high", -40.0)],
)
def test_on_the_linear_plant_a_step_into_the_limits_and_back_does_not_overshoot(point: str, step_kpa: float) -> None:
    steps = [(10.0, step_kpa, 0.0), (130.0, 0.0, 0.0)]
    seen = run(point, steps, 250.0, linear=True, governed=False)
    pressure = seen.pressure_kpa
    assert seen.held.sum() > 10, "it never met a limit"
    assert overshoot(pressure[:1300], 0.0, step_kpa) < 0.02
    assert overshoot(pressure[1300:], pressure[1299], 0.0) < 0.02


@pytest.mark.parametrize(("point", "step_kpa"), STEPS)
def test_a_step_and_back_overshoots_by_less_than_a_twentieth(point: str, step_kpa: float) -> None:
    pressure = run(point, [(10.0, step_kpa, 0.0), (210.0, 0.0, 0.0)], 410.0).pressure_kpa
    assert overshoot(pressure[:2100], 0.0, step_kpa) < 0.05
    assert overshoot(pressure[2100:], pressure[2099], 0.0) < 0.05
    assert np.abs(pressure[[2099, -1]] - [step_kpa, 0.0]).max() < 0.1


@pytest.mark.parametrize(("point", "step_kpa"), [("med", 40.0), ("med", 70.0), ("high", 60.0), ("low", -20.0)])
@pytest.mark.parametrize("limits", [True, False])
def test_without_the_governor_it_overshoots_by_more(point: str, step_kpa: float, limits: bool) -> None:
    """With the commands' limits and without: so it is not windup, but the plant that is another one there."""
    assert max(there_and_back(point, step_kpa, limits=limits, governed=False)) > 0.15


def test_at_a_limit_the_other_command_does_what_is_missing() -> None:
    """Against all commands of a fine grid within the limits."""
    design = design_controller("med", SAMPLE_TIME_S)
    random = np.random.default_rng(0)
    stride = design.command_rate * SAMPLE_TIME_S
    for _ in range(20):
        controller, outputs = limited_k0(design), np.array(operating_point("med").outputs[:2])
        wanted = np.array([3.0, 2.0]) * stride * random.uniform(-1.0, 1.0, 2)
        sent = controller.step(outputs, outputs, wanted) - design.command_rest
        grid = [
            np.array([x, y])
            for x in np.linspace(-stride[0], stride[0], 41)
            for y in np.linspace(-stride[1], stride[1], 41)
        ]
        least = min((u - wanted) @ design.priority @ (u - wanted) for u in grid)
        assert (np.abs(sent) <= stride * (1.0 + 1e-12)).all()
        assert (sent - wanted) @ design.priority @ (sent - wanted) <= least * (1.0 + 1e-9)
