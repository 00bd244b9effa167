"""Where a compensator is stable: theory, the linear loop's poles, and the paper's K0 beside ours."""

from pathlib import Path

import numpy as np
import pytest

from ac_common.units import KPA, RPM
from ac_design import PAPER_CONTROLLER, design_compensator, design_controller, design_fdi
from ac_design.analysis.loop_stability import LARGEST_MARGIN, medium_at, own_away
from ac_design.analysis.performance_bounds import attainable_peak_pa, smallest_peak_pa
from ac_design.closed_loop import loop_matrix
from ac_experiments.designs import designs_at
from ac_experiments.metrics import summarise
from ac_experiments.scenario import load
from ac_experiments.simulate import simulate
from ac_plant_node import linearize

SAMPLE_TIME_S = 0.1


def test_with_the_observer_s_own_plant_q_closes_no_loop() -> None:
    """The poles are those of K0's loop, of the observer and of Q, whatever the gain on q (Lemma 1)."""
    fdi, k0 = design_fdi("med", SAMPLE_TIME_S), design_controller("med", SAMPLE_TIME_S)
    q = design_compensator("med", SAMPLE_TIME_S)
    radii = [
        np.abs(np.linalg.eigvals(loop_matrix(linearize("med"), fdi, k0, q, "Q_act", gain))).max()
        for gain in (0.0, 1.0, 10.0)
    ]
    assert radii == pytest.approx([radii[0]] * 3, abs=1e-6)
    assert radii[0] < 1.0


@pytest.mark.parametrize("point", ["low", "high"])
def test_the_medium_q_act_is_unstable_elsewhere_only_with_the_medium_observer(point: str) -> None:
    found = medium_at(point, "Q_act")
    assert found["own observer"].slowest_rad_s < 0.0
    assert found["own observer"].margin == LARGEST_MARGIN
    assert found["medium observer"].slowest_rad_s > 0.0
    assert found["medium observer"].margin < 1.0


@pytest.mark.parametrize("point", ["low", "med", "high"])
@pytest.mark.parametrize(("kpa", "kelvin"), [(-20.0, 0.0), (20.0, 0.0), (0.0, -5.0), (-40.0, 0.0)])
def test_a_point_s_own_guard_is_stable_with_twice_its_gain_far_from_it(point: str, kpa: float, kelvin: float) -> None:
    assert own_away(point, kpa, kelvin, "Q_both").margin > 2.0


def test_at_low_five_kelvin_more_are_too_much_for_the_guard() -> None:
    """Which is what the bounds of q are for; with half its gain it is stable there, too."""
    assert 0.5 < own_away("low", 0.0, 5.0, "Q_both").margin < 1.0


def test_a_pole_outside_the_circle_shows_on_the_nonlinear_plant() -> None:
    from dataclasses import replace

    own, medium = designs_at("low", SAMPLE_TIME_S), designs_at("med", SAMPLE_TIME_S)
    fdi = replace(medium.fdi, input_rest=own.fdi.input_rest, output_rest=own.fdi.output_rest)
    scenario = load("actuator_fault", ["operating_point=low", "references={}", "faults.0.onset_s=20", "duration_s=120"])
    unbounded = replace(medium.compensator, q_range=np.full(2, np.inf), reference_rest=np.empty(0))
    away = simulate(scenario, designs=replace(own, fdi=fdi, compensator=unbounded)).series
    near = simulate(scenario, designs=own).series
    moved = [np.abs(run["plant/evaporator_pressure"][-200:] - own.fdi.output_rest[0]).max() for run in (away, near)]
    assert moved[0] > 2.0 * KPA > moved[1]


def test_the_paper_s_k0_takes_back_half_of_the_fault_holds_p_e_and_lets_the_superheat_go() -> None:
    from dataclasses import replace

    designs = replace(
        designs_at("med", SAMPLE_TIME_S), controller=design_controller("med", SAMPLE_TIME_S, PAPER_CONTROLLER)
    )
    run = simulate(load("actuator_fault", ["references={}"]), passive=True, designs=designs)
    metrics = summarise(run)["metrics"]
    assert metrics["command_change_rpm"] == pytest.approx(-20.0, abs=2.0)
    assert abs(metrics["steady_pressure_error_kpa"]) < 0.05
    superheat = run.series["plant/superheat"]
    assert abs(superheat[-1] - superheat[0]) > 1.0


@pytest.mark.parametrize("point", ["low", "med", "high"])
def test_at_10_hz_the_bound_is_what_commands_that_know_the_fault_attain(point: str) -> None:
    bound, attained = (peak(point, 0.1, 40.0 * RPM) for peak in (smallest_peak_pa, attainable_peak_pa))
    assert attained == pytest.approx(bound, rel=1e-6)
    assert attained > 0.3 * KPA


def test_who_knows_later_has_a_higher_peak() -> None:
    """As the page has it; commands that are held until then cannot but let the fault have its way."""
    peaks = [attainable_peak_pa("low", 0.1, 40.0 * RPM, known_after=ticks) / KPA for ticks in range(1, 6)]
    assert peaks == sorted(peaks)
    page = Path(__file__).parents[2].joinpath("docs", "control.md").read_text(encoding="utf-8")
    for ticks, peak in enumerate(peaks, 1):
        assert f"| {0.1 * ticks:.1f} | {peak:.2f} kPa |" in page


def test_at_100_hz_the_actuators_rates_are_the_limit() -> None:
    assert attainable_peak_pa("med", 0.01, 40.0 * RPM) > 1.2 * smallest_peak_pa("med", 0.01, 40.0 * RPM)


def test_the_bound_on_the_peak_falls_with_the_sample_time() -> None:
    bounds = [smallest_peak_pa("med", h, 40.0 * RPM) / KPA for h in (0.1, 0.05, 0.02, 0.01)]
    assert bounds == sorted(bounds, reverse=True)
    assert bounds[0] > 0.3 > bounds[2]
