"""A scenario chooses K0: ours, which tracks both references, or one after the paper's passive case."""

import pytest

from ac_design import CONTROLLERS
from ac_experiments.metrics import summarise
from ac_experiments.scenario import load
from ac_experiments.scenario_schema import K0_WEIGHTS
from ac_experiments.simulate import simulate


def test_every_controller_that_a_scenario_may_name_has_weights() -> None:
    assert set(K0_WEIGHTS) == set(CONTROLLERS)


@pytest.mark.parametrize("passive", [True, False])
def test_the_paper_s_passive_loop_takes_back_half_of_the_fault_and_the_active_one_all(passive: bool) -> None:
    found = summarise(simulate(load("actuator_fault", ["controller=paper"]), passive=passive))
    assert found["metrics"]["command_change_rpm"] == pytest.approx(
        -20.0 if passive else -40.0, abs=2.0 if passive else 0.2
    )
    assert abs(found["metrics"]["steady_pressure_error_kpa"]) < 0.05
    assert found["false_alarms"] == 0


def test_its_own_compensator_keeps_a_sensor_fault_out_of_the_pressure() -> None:
    metrics = summarise(simulate(load("sensor_fault", ["controller=paper"])))["metrics"]
    assert abs(metrics["command_change_rpm"]) < 0.5
    assert metrics["peak_pressure_error_kpa"] < 0.5
