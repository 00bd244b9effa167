"""A plant of your own: a table of operating points and a few parameters become a calibrated parameter file."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from ac_common.units import RPM
from ac_common.yaml_file import parsed, yaml_text
from ac_plant_node import TABLE_I, calibrate, load_parameters, load_points
from ac_plant_node.calibration import row_inputs
from ac_plant_node.equilibrium import equilibrium
from ac_plant_node.parameters.file import PLANT_VARIABLE, parameter_text
from ac_plant_node.parameters.values import NAMES

# The two files that docs/plant.md shows.
DOCS = (Path(__file__).parents[2] / "docs" / "plant.md").read_text(encoding="utf-8")
TABLE, CAR = (parsed(block, "docs") for block in re.findall(r"^```yaml\n(.*?)^```", DOCS, re.MULTILINE | re.DOTALL))
POINTS = TABLE["points"]


def write(path, content):
    path.write_text(yaml_text(content))
    return path


def test_own_refrigerant_and_points_become_exact_equilibria(tmp_path):
    given = load_parameters(write(tmp_path / "car.yaml", CAR))
    assert (given.refrigerant, given["charge_kg"], given["displacement_m3_rev"]) == ("R1234yf", 0.52, 155e-6)
    rows = load_points(write(tmp_path / "points.yaml", {"points": POINTS}))
    solved, _ = calibrate(given, rows=rows)
    for row in rows:
        rest = equilibrium(row_inputs(row, solved), solved)
        assert rest.outputs[0] / 1e3 == pytest.approx(row.evaporator_pressure_kpa, abs=0.01)
        assert rest.outputs[1] == pytest.approx(row.superheat_k, abs=0.01)
    file = tmp_path / "mine.yaml"
    file.write_text(parameter_text(solved))
    back = load_parameters(file)
    assert back.identity == solved.identity
    assert (back.array == solved.array).all()
    assert back.points == rows
    assert back.refrigerant == "R1234yf"


def test_more_than_three_points_are_fitted(tmp_path):
    """A fourth row from the shipped plant's own equilibria changes nothing; one that contradicts is a compromise."""
    shipped = load_parameters()
    between = {"name": "mid", "air_inlet_temperature_c": 33, "compressor_speed_rpm": 1500, "valve_opening_percent": 45,
               "evaporator_pressure_kpa": 0, "superheat_k": 0}  # fmt: skip
    rows = [{k: v for k, v in vars(row).items() if v is not None} for row in TABLE_I]
    inputs = [1500 * 3.141592653589793 / 30, 0.45, shipped["evaporator_air_nominal_kg_s"], 33.0]
    rest = equilibrium(inputs)
    between |= {"evaporator_pressure_kpa": float(rest.outputs[0]) / 1e3, "superheat_k": float(rest.outputs[1])}
    solved, _ = calibrate(rows=load_points(write(tmp_path / "p.yaml", {"points": [*rows, between]})))
    for name in NAMES:
        assert solved[name] == pytest.approx(shipped[name], rel=1e-5)
    between["evaporator_pressure_kpa"] += 3.0
    other, _ = calibrate(rows=load_points(write(tmp_path / "p.yaml", {"points": [*rows, between]})))
    pressure = equilibrium(inputs, other).outputs[0] / 1e3
    assert between["evaporator_pressure_kpa"] - 3.0 < pressure < between["evaporator_pressure_kpa"]


def test_a_point_that_was_measured_in_other_air_is_fitted_in_that_air(tmp_path):
    """A fourth row from the shipped plant in hot, humid air changes nothing; told without its humidity it does."""
    shipped = load_parameters()
    rows = [{k: v for k, v in vars(row).items() if v is not None} for row in TABLE_I]
    hot = {"name": "hot", "air_inlet_temperature_c": 33, "compressor_speed_rpm": 1500, "valve_opening_percent": 45,
           "condenser_air_mass_flow_kg_s": 0.4, "condenser_air_inlet_temperature_c": 38,
           "air_humidity_percent": 40}  # fmt: skip
    inputs = [1500 * RPM, 0.45, shipped["evaporator_air_nominal_kg_s"], 33.0, 0.4, 38.0, 0.4]
    pressure_pa, superheat_k = equilibrium(inputs).outputs[:2].tolist()
    hot |= {"evaporator_pressure_kpa": pressure_pa / 1e3, "superheat_k": superheat_k}
    solved, _ = calibrate(rows=load_points(write(tmp_path / "p.yaml", {"points": [*rows, hot]})))
    for name in NAMES:
        assert solved[name] == pytest.approx(shipped[name], rel=1e-5)
    del hot["air_humidity_percent"]
    other, _ = calibrate(rows=load_points(write(tmp_path / "p.yaml", {"points": [*rows, hot]})))
    assert max(abs(other[name] / shipped[name] - 1.0) for name in NAMES if shipped[name]) > 1e-3


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda p: p.pop(), "expected a list of 3 to 100"),
        (lambda p: p[1].pop("superheat_k"), r"points\.1: superheat_k is missing"),
        (lambda p: p[1].update(superheat_k="warm"), r"points\.1: superheat_k is not a number"),
        (
            lambda p: p[2].update(evaporator_pressure_kpa=2500),
            r"points\.2: evaporator_pressure_kpa = 2500 is outside 50",
        ),
        (lambda p: p[0].update(superheat=3), "unknown key 'superheat', did you mean 'superheat_k'"),
        (lambda p: p[0].update(name="med"), "'med' is there twice"),
        (lambda p: p[0].update(name="../x"), "name: must be a word"),
        (lambda p: p.__setitem__(1, 4), r"points\.1: expected a mapping"),
    ],
)
def test_a_bad_table_gets_one_line(tmp_path, change, says):
    points = [dict(row) for row in POINTS]
    change(points)
    with pytest.raises(ValueError, match=says) as info:
        load_points(write(tmp_path / "points.yaml", {"points": points}))
    assert "\n" not in str(info.value)


def test_points_that_no_plant_has_are_refused(tmp_path):
    points = [{**row, "valve_opening_percent": 40} for row in POINTS]
    rows = load_points(write(tmp_path / "points.yaml", {"points": points}))
    with pytest.raises(ValueError, match="must differ in compressor speed and in valve opening"):
        calibrate(rows=rows)
    weak = load_parameters().replace(displacement_m3_rev=2.0e-5)
    with pytest.raises(ValueError, match="calibration: "):
        calibrate(weak)


def test_commands_calibrate_and_use_it(tmp_path):
    """From a table and a car to its equilibria, by the command line; the environment carries the plant to processes."""
    write(tmp_path / "car.yaml", CAR)
    write(tmp_path / "points.yaml", {"points": POINTS})

    def acftc(*words, **more):
        command = [sys.executable, "-m", "bringup.cli", *words]
        return subprocess.run(
            command, capture_output=True, text=True, cwd=tmp_path, env={**os.environ, **more}, check=False, timeout=120
        )

    made = acftc("calibrate", "--points", "points.yaml", "--parameters", "car.yaml", "--out", "mine.yaml", "--json")
    assert made.returncode == 0, made.stderr
    assert json.loads(made.stdout)["points"]["med"]["reached_superheat_k"] == pytest.approx(15.0, abs=0.01)
    shown = json.loads(acftc("--plant", "mine.yaml", "equilibria", "--json").stdout)
    assert shown["high"]["evaporator_pressure_kpa"] == pytest.approx(235.0, abs=0.01)
    assert shown["high"]["given_superheat_k"] == 18.0
    refused = acftc("equilibria", **{PLANT_VARIABLE: "none.yaml"})
    assert (refused.returncode, refused.stderr) == (2, "acftc: none.yaml: cannot be read: No such file or directory\n")
