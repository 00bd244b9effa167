"""Study files: what they may hold, what is wrong in one line, and what run i is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ac_common.errors import UserError
from ac_experiments.scenario import check
from ac_experiments.study.cases import Cases
from ac_experiments.study.distributions import WIDEST, distribution
from ac_experiments.study.plants import SIGMAS
from ac_experiments.study.sampling import Sampler
from ac_experiments.study.schema import built_in_studies, check_study, load_study, study_yaml
from ac_plant_node import load_parameters

BASE = {"name": "tried", "scenario": {"duration_s": 100}, "runs": 16, "seed": 3}


def study(**content):
    return check_study({**BASE, **content})


# ------------------------------------------------------------------------------------------------------- one line


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"rns": 3}, ["unknown key 'rns'", "did you mean 'runs'"]),
        ({"runs": 0}, ["runs: given 0", "greater than or equal to 1"]),
        ({"sampling": "sobl"}, ["sampling", "did you mean 'sobol'"]),
        ({"scenario": 3}, ["scenario: given 3", "a built-in scenario"]),
        ({"vary": [1]}, ["vary: given [1]; must be keys with distributions"]),
        ({"vary": {"noise.superheat_k": 3}}, ["vary: noise.superheat_k: given 3; must be a distribution"]),
        ({"vary": {"a": {"unifrm": [0, 1]}}}, ["a: unknown distribution 'unifrm', did you mean 'uniform'"]),
        ({"vary": {"a": {"uniform": [1, 0]}}}, ["given 1 to 0; the first must be below the second"]),
        ({"vary": {"a": {"log_uniform": [0, 1]}}}, ["below the second and above 0"]),
        ({"vary": {"a": {"normal": [0, 0]}}}, ["given the standard deviation 0; must be above 0"]),
        ({"vary": {"a": {"normal": [0, "x"]}}}, ["must be two numbers, mean and standard deviation"]),
        ({"vary": {"a": {"choice": []}}}, ["choice: given []; must be a list"]),
        ({"vary": {"a": {"grid": [1, 1]}}}, ["names a value twice"]),
        ({"vary": {"fault.sise": {"uniform": [0, 1]}}}, ["unknown key of the fault 'sise', did you mean 'size'"]),
        (
            {"vary": {"plant.charge": {"normal": [0, 1]}}},
            ["unknown plant parameter 'charge', did you mean 'charge_kg'"],
        ),
        ({"vary": {"fault.kind": {"choice": ["compresor_speed"]}}}, ["fault.kind", "did you mean 'compressor_speed'"]),
        ({"set": {"a": 1}, "vary": {"a": {"uniform": [0, 1]}}}, ["a is both set and varied"]),
        ({"sampling": "saltelli", "vary": {"a": {"uniform": [0, 1]}}, "runs": 100}, ["power of two times 3", "96"]),
    ],
)
def test_what_is_wrong_with_a_file_is_one_line(content, words):
    with pytest.raises(UserError) as caught:
        study(**content)
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"vary": {"noise.superheat": {"uniform": [0, 1]}}}, ["study tried, run 0", "did you mean 'superheat_k'"]),
        ({"vary": {"noise.superheat_k": {"uniform": [0, 90]}}}, ["noise.superheat_k: given 90", "20"]),
        ({"vary": {"faults.0.size_rpm": {"uniform": [0, 90]}}}, ["faults.0 is not an item of the list"]),
        ({"set": {"fault.kind": "compressor_speed", "fault.typical": 1, "fault.size": 2}}, ["give one of them"]),
        ({"set": {"fault": 3}}, ["fault: must be a kind, none, or keys"]),
    ],
)
def test_a_scenario_that_cannot_be_is_told_before_anything_runs(content, words):
    """At the bounds of what varies, too: 90 K of noise would be drawn by some run or other."""
    with pytest.raises(UserError) as caught:
        Cases(study(**content)).look()
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)


def test_a_name_that_is_none_is_told_the_nearest():
    with pytest.raises(UserError, match="did you mean 'small_faults'"):
        load_study("smal_faults")
    with pytest.raises(UserError, match=r"missing.yaml: cannot be read"):
        load_study("missing.yaml")


@pytest.mark.parametrize("name", list(built_in_studies()))
def test_built_in_studies_are_good_ones_and_survive_their_own_file(name, tmp_path):
    known = load_study(name)
    Cases(known).look()
    file = tmp_path / "again.yaml"
    file.write_text(study_yaml(known))
    assert load_study(file).identity == known.identity
    assert known.description


def test_what_is_the_same_in_all_runs_may_be_said_on_the_command_line(tmp_path):
    chosen = load_study("envelope_healthy", {"runs": 3}, ["design=paper", "sensors=3"])
    assert chosen.set == {"design": "paper", "sensors": 3}
    assert all(Cases(chosen)[run].scenario.sensors == 3 for run in range(3))
    with pytest.raises(UserError, match="must be KEY=VALUE"):
        load_study("envelope_healthy", {}, ["design"])
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text("set: [1]\n")
    with pytest.raises(UserError, match=r"wrong.yaml with --set: set: "):
        load_study(wrong, {}, ["design=paper"])
    with pytest.raises(UserError, match="operating_point is both set and varied"):
        load_study("small_faults", {}, ["operating_point=low"])


def test_the_built_in_studies_are_those_promised():
    promised = {"envelope_healthy", "envelope_faults", "small_faults", "paper_points", "driver_cost"}
    promised |= {"envelope_unmodelled", "envelope_other_plants"}
    assert set(built_in_studies()) == promised


# -------------------------------------------------------------------------------------------------------- drawing


@given(st.floats(-50, 50), st.floats(0.01, 50), st.floats(0.0, 1.0))
def test_draws_are_within_their_bounds(first, width, share):
    for one in (
        distribution({"uniform": [first, first + width]}),
        distribution({"normal": [first, width]}),
        distribution({"log_uniform": [width, width + abs(first) + 0.01]}),
        distribution({"choice": [1, 2, 3]}),
    ):
        value = one.at(share)
        assert min(one.bounds) - 1e-9 <= value <= max(one.bounds) + 1e-9


def test_quantiles_are_those_of_the_distributions():
    assert distribution({"normal": [3.0, 2.0]}).at(0.5) == pytest.approx(3.0)
    assert distribution({"normal": [0.0, 1.0]}).at(0.975) == pytest.approx(1.96, abs=2e-3)
    assert distribution({"normal": [0.0, 2.0]}).bounds == pytest.approx((-2.0 * WIDEST, 2.0 * WIDEST))
    assert distribution({"log_uniform": [1.0, 100.0]}).at(0.5) == pytest.approx(10.0)
    assert [distribution({"choice": ["a", "b"]}).at(share) for share in (0.0, 0.49, 0.5, 1.0)] == ["a", "a", "b", "b"]


@settings(max_examples=25)
@given(st.integers(0, 2**30 - 2), st.integers(0, 15), st.sampled_from(["random", "sobol"]))
def test_a_run_depends_on_seed_and_number_alone(seed, run, sampling):
    """Not on how many runs there are, nor on which were drawn before."""
    vary = {"noise.superheat_k": {"uniform": [0, 1]}, "fault.size": {"log_uniform": [1, 9]}}
    few = Sampler(study(vary=vary, seed=seed, sampling=sampling, runs=16))
    many = Sampler(study(vary=vary, seed=seed, sampling=sampling, runs=1000))
    assert few.values(run) == many.values(run)
    assert Sampler(study(vary=vary, seed=seed + 1, sampling=sampling)).values(run) != few.values(run)


@pytest.mark.parametrize("sampling", ["latin_hypercube", "sobol"])
def test_fillings_fill(sampling):
    vary = {key: {"uniform": [0, 1]} for key in ("noise.superheat_k", "noise.wall_temperature_k")}
    sampler = Sampler(study(vary=vary, sampling=sampling, runs=64))
    points = np.array([sampler.point(run) for run in range(64)])
    for column in points.T:
        assert sorted((64 * column).astype(int)) == list(range(64))  # one in each of 64 strata


def test_random_draws_of_two_runs_are_independent_and_uniform():
    sampler = Sampler(study(vary={"noise.superheat_k": {"uniform": [0, 1]}}, runs=4000))
    drawn = np.array([sampler.point(run)[0] for run in range(4000)])
    assert drawn.mean() == pytest.approx(0.5, abs=0.02)
    assert abs(np.corrcoef(drawn[:-1], drawn[1:])[0, 1]) < 0.05


def test_grids_are_gone_through_and_share_the_rest():
    vary = {"fault.kind": {"grid": ["none", "compressor_speed"]}, "operating_point": {"grid": ["low", "med", "high"]}}
    tried = study(scenario="drive", vary=vary, set={"fault.size": 5, "fault.onset_s": 900}, runs=12)
    cases = Cases(tried)
    seen = [(cases[run].drawn["fault.kind"], cases[run].scenario.operating_point) for run in range(12)]
    assert len(set(seen[:6])) == 6
    assert seen[:6] == seen[6:]
    assert [cases[run].drive for run in range(12)] == [3] * 6 + [4] * 6
    assert cases[0].scenario.faults == []
    assert cases[1].scenario.faults[0].size_rpm == 5.0
    assert cases[0].scenario.noise == cases[1].scenario.noise


# ---------------------------------------------------------------------------------------------------------- cases


def test_a_fault_is_of_its_kind_in_its_unit():
    kinds = {"fault.kind": {"grid": ["evaporator_pressure", "condenser_fan"]}}
    cases = Cases(study(vary=kinds, set={"fault.typical": 0.5, "fault.sign": -1, "fault.onset_s": 10}))
    assert cases[0].scenario.faults[0].size_kpa == -2.5
    assert cases[1].scenario.faults[0].size_percent == 25.0  # a loss has no sign


def test_a_plant_is_off_by_its_standard_deviations_and_the_designs_do_not_know():
    from ac_experiments.study.runs import designs_for, play

    cases = Cases(study(vary={"plant": {"normal": [0, 1]}}, scenario={"duration_s": 2}))
    case = cases[0]
    assert case.parameters is not None
    assert len(set(case.drawn.values())) == len(SIGMAS)  # each by itself
    usual = load_parameters()
    for name, sigma in SIGMAS.items():
        assert case.parameters[name] == pytest.approx(usual[name] * np.exp(sigma * case.drawn[f"plant.{name}"]))
    played = play(case)
    assert load_parameters().identity == usual.identity
    assert designs_for(case.scenario) is designs_for(cases[1].scenario)
    healthy = play(Cases(study(scenario={"duration_s": 2}))[0])
    assert played.series["plant/superheat"][0] != healthy.series["plant/superheat"][0]


def test_what_is_set_is_not_shared_between_runs():
    """A value drawn into a list that the file sets stays that run's."""
    content = {
        "set": {"faults": [{"kind": "compressor_speed", "size_rpm": 1, "onset_s": 5}]},
        "vary": {"faults.0.size_rpm": {"uniform": [2, 9]}},
    }
    tried = study(**content)
    Cases(tried)[0]
    assert tried.set["faults"][0]["size_rpm"] == 1


def test_the_noise_of_a_run_has_a_seed_of_its_own_unless_one_is_set():
    cases = Cases(study())
    seeds = {cases[run].scenario.noise.seed for run in range(16)}
    assert len(seeds) == 16
    assert Cases(study(set={"noise.seed": 5}))[3].scenario.noise.seed == 5


def test_a_case_is_a_scenario_file():
    case = Cases(study(scenario="drive", set={"duration_s": 300}))[2]
    assert check(case.scenario.model_dump(mode="json")) == case.scenario
    assert case.scenario.name == "tried-2"
    assert all(change.at_s < 300 for change in case.scenario.references.superheat_k)
