"""What a process beside makes is what this one would make; it never outlives who has started it."""

import os

import numpy as np
import pytest

from ac_experiments.scenario import load
from ac_experiments.simulate import simulate
from bringup.launch.beside import PASSIVE, Beside

SETTINGS = ("duration_s=20", "faults.0.onset_s=5")


def test_the_passive_run_is_the_one_that_is_simulated_here() -> None:
    scenario = load("sensor_fault", SETTINGS)
    with Beside(PASSIVE) as process:
        process.start(scenario)
        made = process.result()
    here = simulate(scenario, passive=True)
    assert made.metadata["passive"]
    assert made.metadata["scenario"] == here.metadata["scenario"]
    assert made.series.keys() == here.series.keys()
    for name, values in here.series.items():
        np.testing.assert_array_equal(made.series[name], values, err_msg=name)


def test_without_a_start_or_after_a_failure_there_is_nothing() -> None:
    with Beside(PASSIVE) as never, Beside("no such task") as failing:
        assert never.result() is None
        failing.start(load("nominal", ("duration_s=1",)))
        assert failing.result() is None


def test_it_ends_with_the_context() -> None:
    with Beside(PASSIVE) as process:
        process.start(load("nominal", ("duration_s=10000",)))
        assert process._process is not None
        number = process._process.pid
    with pytest.raises(ProcessLookupError):
        os.kill(number, 0)
