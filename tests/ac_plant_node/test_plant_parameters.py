"""Parameter file and caches: what is wrong is said in one line, what is damaged is made again."""

import re
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from ac_plant_node import Parameters, load_parameters, parameters_fingerprint
from ac_plant_node.parameters import values
from ac_plant_node.parameters.file import parameter_text
from ac_plant_node.parameters.values import NAMES
from ac_plant_node.properties import tables


def shipped():
    return resources.files("ac_plant_node.parameters").joinpath("parameters.yaml").read_text()


@pytest.mark.parametrize(
    ("pattern", "replacement", "says"),
    [
        (r"value: 0\.50, unit: kg", "value: 50, unit: kg", r"charge_kg = 50 kg is outside 0\.1 to 2"),
        (r"charge_kg:.*\n", "charge_kg: 50\n", r"charge_kg = 50 kg is outside 0\.1 to 2"),
        (r"charge_kg:.*\n", "charge_kg: yes\n", "charge_kg is not a number"),
        (r"charge_kg: \{value", "charge_kg: {worth", "charge_kg: unknown key 'worth'; allowed are value, unit"),
        (r"charge_kg: \{value: 0\.50", "charge_kg: {value: much", "charge_kg is not a number"),
        (r"refrigerant: R134a", "refrigerant: R12", "'R12', allowed are R134a, R1234yf"),
        (r"\Z", "colour: {value: 1}\n", "unknown key 'colour'"),
        (r"\A", "chrage_kg: 0.5\n", "unknown key 'chrage_kg', did you mean 'charge_kg'"),
        (r"\Z", "points: 3\n", "points: expected a list of 3 to 100"),
        (r"\A", "][", "not valid YAML"),
        (r"\A", "charge_kg: 0.6\n", "key 'charge_kg' is given twice"),
        (r"unit: kg,", "unit: g,", "charge_kg: unit 'g'; the value must be in kg"),
        (r"value: 0\.50, unit: kg", "value: .nan, unit: kg", "charge_kg = nan kg is outside"),
        (r"value: 0\.50, unit: kg", "value: 1" + 400 * "0" + ", unit: kg", "charge_kg"),
        (r"charge_kg:.*\n", "charge_kg: [1]\n", "charge_kg is not a number"),
        (r"\A", "3: 4\n", "unknown key '3'"),
    ],
)
def test_a_bad_parameter_file_gets_one_line(tmp_path, pattern, replacement, says):
    path = tmp_path / "plant.yaml"
    path.write_text(re.sub(pattern, replacement, shipped(), count=1))
    with pytest.raises(ValueError, match=says) as info:
        load_parameters(path)
    assert "\n" not in str(info.value)
    assert "plant.yaml" in str(info.value)


def test_the_shipped_file_is_within_its_own_ranges():
    shipped = Path(values.__file__).with_name("parameters.yaml")
    assert load_parameters(shipped).identity == load_parameters().identity


def test_missing_file(tmp_path):
    with pytest.raises(ValueError, match=r"none\.yaml: cannot be read"):
        load_parameters(tmp_path / "none.yaml")


def test_every_parameter_changes_the_fingerprint():
    base = load_parameters()
    prints = {parameters_fingerprint(base.replace(**{name: 1.001 * base[name] + 1e-9})) for name in NAMES}
    assert len(prints | {parameters_fingerprint(base)}) == len(NAMES) + 1
    assert parameters_fingerprint(base.replace(refrigerant="R1234yf")) != parameters_fingerprint(base)
    assert isinstance(base, Parameters)


def test_tables_of_an_unknown_refrigerant():
    with pytest.raises(ValueError, match="unknown refrigerant 'R12': allowed are R134a, R1234yf"):
        tables.load_tables("R12")


def test_arrays_are_read_only():
    with pytest.raises(ValueError, match="read-only"):
        load_parameters().array[0] = 1.0
    assert np.isfinite(load_parameters().array).all()


@pytest.mark.parametrize("name", [name for name, value in vars(values.TableRow).items() if value is None])
def test_air_that_a_row_gives_makes_another_plant_and_survives_its_file(tmp_path, name):
    usual = load_parameters()
    known = {usual.identity}
    for k, row in enumerate(usual.points):
        points = (*usual.points[:k], replace(row, **{name: 0.25}), *usual.points[k + 1 :])
        other = replace(usual, points=points)
        path = tmp_path / f"{k}.yaml"
        path.write_text(parameter_text(other))
        assert load_parameters(path).identity == other.identity
        known.add(other.identity)
    assert len(known) == 1 + len(usual.points)
