"""E2 on the nonlinear plant: each residual answers its own fault, with the paper's two sensors and with three."""

import numpy as np
import pytest

from ac_common.errors import UserError
from ac_common.units import KPA, RPM
from ac_design import design_fdi as design
from ac_experiments.metrics import summarise
from ac_experiments.scenario import load
from ac_experiments.simulate import simulate
from fdi_node import FaultDetector


@pytest.mark.parametrize("sensors", [2, 3])
def test_a_detector_that_joins_begins_without_an_innovation(sensors: int) -> None:
    fdi = design("med", 0.1, sensors=sensors)
    subject, off = FaultDetector(fdi), np.array([2e3, 1.0, 0.5])
    subject.warm_restart(fdi.output_rest + off, fdi.input_rest[2], 1.01 * fdi.input_rest[:2])
    found = subject.observe(0.0, fdi.output_rest + off, fdi.input_rest[2])
    assert np.all(np.abs(found.innovation) < 1e-6 * off)


def test_the_compensator_does_not_act_with_two_sensors() -> None:
    with pytest.raises(UserError, match="sensors: 2 needs passive: true"):
        load("isolation", ["passive=false"])
    with pytest.raises(ValueError, match="sensors: 2 needs passive: true"):
        simulate(load("isolation"), passive=False)


@pytest.mark.parametrize("sensors", [2, 3])
def test_each_residual_answers_its_own_fault(sensors: int) -> None:
    run = simulate(load("isolation", [f"sensors={sensors}"]))
    r_n = run.series["fdi/residual/compressor_speed:compressor"] / RPM
    r_p = run.series["fdi/residual/evaporator_pressure"] / KPA
    after_n, after_p = (run.time_s >= 400.0) & (run.time_s < 700.0), run.time_s >= 700.0
    assert np.abs(r_p[after_n]).max() < 0.02 * 5.0
    assert np.abs(r_n[after_p] - 40.0).max() < 0.1 * 40.0
    assert np.abs(r_n[after_n & (run.time_s >= 460.0)] - 40.0).max() < 3.0
    assert np.abs(r_p[run.time_s >= 760.0] - 5.0).max() < 0.2
    summary = summarise(run)
    assert summary["false_alarms"] == 0
    assert [fault["isolated_as"] for fault in summary["faults"]] == ["compressor_speed", "evaporator_pressure"]
