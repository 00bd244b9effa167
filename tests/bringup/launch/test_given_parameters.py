"""What a parameter file changes in a run, and which designs are refused before anything runs."""

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ac_common.design_file import to_bytes
from ac_common.errors import UserError
from ac_design import write_designs
from ac_experiments.designs import designs_at, designs_of
from ac_experiments.scenario import load
from ac_plant_node.parameters.file import PLANT_VARIABLE
from bringup.launch.given_parameters import check_designs, in_one_process

SHORT = ("duration_s=5",)


def file_of(folder: Path, node: str, parameters: str) -> Path:
    file = folder / "given.yaml"
    file.write_text(f"/ac/{node}:\n  ros__parameters: {{{parameters}}}\n")
    return file


def refusal(file: Path, *settings: str) -> str:
    """Why a design is refused, with nodes and without: for the same reason."""
    scenario = load("nominal", (*SHORT, *settings))
    with pytest.raises(UserError) as with_nodes:
        check_designs(file, scenario)
    with pytest.raises(UserError) as without:
        in_one_process(file, scenario)
    assert str(with_nodes.value) == str(without.value)
    assert with_nodes.value.exit_code == 2
    assert "\n" not in str(without.value)
    return str(without.value)


def test_what_the_loop_takes_from_a_file(tmp_path: Path) -> None:
    scenario = load("nominal", SHORT)
    noise = file_of(tmp_path, "fault_injector", "seed: 7, noise_std: [200.0, 0.1, 0.0, 0.0]")
    made = in_one_process(noise, scenario)
    assert made.scenario.noise.seed == 7
    np.testing.assert_allclose(made.scenario.noise.std, [200.0, 0.1, 0.0, 0.0])
    assert in_one_process(file_of(tmp_path, "compensator", "accommodate: false"), scenario).scenario.passive
    capped = in_one_process(file_of(tmp_path, "gimc_controller", "protection: {lowest_superheat_k: 6.0}"), scenario)
    assert capped.limits is not None
    assert capped.limits.lowest_superheat_k == 6.0
    assert in_one_process(file_of(tmp_path, "fdi", "priority: 20, realtime_care: true"), scenario).designs is not None
    untouched = in_one_process(None, scenario)
    assert (untouched.scenario, untouched.limits) == (scenario, None)
    np.testing.assert_array_equal(untouched.designs.fdi.a, designs_of(scenario).fdi.a)


@pytest.mark.parametrize(
    ("node", "parameters", "words"),
    [
        ("fault_injector", "command_hold_s: 2.0", "command_hold_s: is for nodes"),
        ("scenario", "ramp_s: 2.0", "ramp_s: is for nodes"),
        ("gimc_controller", "protection: {release_s: soon}", "must be a number"),
        ("fault_injector", "seed: -3", "noise.seed"),
    ],
)
def test_what_it_does_not_take_is_told(tmp_path: Path, node: str, parameters: str, words: str) -> None:
    with pytest.raises(UserError, match=words):
        in_one_process(file_of(tmp_path, node, parameters), load("nominal", SHORT))


def test_a_design_of_the_users_is_run(tmp_path: Path) -> None:
    own = replace(designs_at("med", 0.1).fdi, thresholds=np.array([9.0, 9.0e3]))
    (tmp_path / "own.npz").write_bytes(to_bytes(own))
    file = file_of(tmp_path, "fdi", f"design_file: {tmp_path / 'own.npz'}")
    check_designs(file, load("nominal", SHORT))
    made = in_one_process(file, load("nominal", SHORT))
    np.testing.assert_array_equal(made.designs.fdi.thresholds, own.thresholds)


def test_a_design_for_another_point_or_plant_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = write_designs(tmp_path, "med", 0.1)
    for node, made in files.items():
        file = file_of(tmp_path, node, f"design_file: {made}")
        check_designs(file, load("nominal", SHORT))
        assert "made for the operating point med, not high" in refusal(file, "operating_point=high")
    # One that does not say what it is for is known by its numbers.
    (tmp_path / "silent.npz").write_bytes(to_bytes(designs_at("med", 0.1).fdi))
    file = file_of(tmp_path, "fdi", f"design_file: {tmp_path / 'silent.npz'}")
    assert "made for another point than high" in refusal(file, "operating_point=high")
    file = file_of(tmp_path, "fdi", f"design_file: {files['fdi']}")
    other = tmp_path / "heavy.yaml"
    other.write_text("charge_kg: 0.52\n")
    monkeypatch.setenv(PLANT_VARIABLE, str(other))
    assert "made for another plant" in refusal(file)


def test_what_is_no_design_is_refused_without_bad_advice(tmp_path: Path) -> None:
    contents = {
        "pickled.npz": pickle.dumps({"a": 1}),
        "text.npz": b"no design",
        "empty.npz": b"",
    }
    for name, content in contents.items():
        (tmp_path / name).write_bytes(content)
    np.savez(tmp_path / "objects.npz", a=np.array([{"b": 1}], dtype=object))
    for name in (*contents, "objects.npz", "missing.npz"):
        why = refusal(file_of(tmp_path, "fdi", f"design_file: {tmp_path / name}"))
        assert "holds no FdiDesign" in why
        assert "pickle" not in why.replace("pickled.npz", "")
        assert "trust" not in why
