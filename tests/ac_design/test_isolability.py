"""Which faults can be told apart: the rank condition by another route, and what physics says must come out."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ac_design.analysis.isolability import (
    _INPUTS,
    AIR_FAULTS,
    LITTLE_LEFT,
    NOTHING_LEFT,
    PLANT_FAULTS,
    READINGS,
    SENSOR_FAULTS,
    SENSOR_SETS,
    Isolability,
    isolability,
    responses,
    summary,
    table,
    unexplained,
)
from ac_plant_node import linearize
from ac_plant_node.inputs import FAULT_KINDS


@cache
def results() -> dict[str, Isolability]:
    """What can be told apart with each set of sensors."""
    return {sensors.name: isolability(sensors, ("med",)) for sensors in SENSOR_SETS}


_PARTS = st.floats(-1.0, 1.0).map(lambda value: round(value, 3))


def test_every_fault_of_the_plant_is_looked_at() -> None:
    assert set(FAULT_KINDS) < set(PLANT_FAULTS)


@given(effect=arrays(float, (4, 2), elements=_PARTS), causes=arrays(float, (4, 2, 2), elements=_PARTS))
def test_what_is_left_is_the_residual_of_least_squares(effect: np.ndarray, causes: np.ndarray) -> None:
    f, d = effect @ [1.0, 1.0j], causes @ [1.0, 1.0j]
    norms = np.linalg.norm(d, axis=0)
    if not np.linalg.norm(f) > 0.1 or not (norms > 0.1).all() or np.linalg.cond(d / norms) > 100.0:
        return
    rest = f - d @ np.linalg.lstsq(d, f, rcond=None)[0]
    assert unexplained(f, d) == pytest.approx(np.linalg.norm(rest) / np.linalg.norm(f), abs=1e-9)


@pytest.mark.parametrize("sensors", SENSOR_SETS, ids=lambda sensors: sensors.name)
def test_rank_by_the_system_matrix(sensors) -> None:
    """Rank of [A - sI, B; C, D] minus the number of states, at a point off every axis, gives the same answers."""
    plant = linearize("med", inputs=_INPUTS, outputs=tuple(READINGS))
    rows = [tuple(READINGS).index(name) for name in sensors.readings]
    scale = np.array([READINGS[name] for name in sensors.readings])
    s = 0.013 + 0.021j
    inverse = np.linalg.solve(s * np.eye(plant.nstates) - plant.A, plant.B)
    input_size = np.linalg.norm((plant.C @ inverse + plant.D)[rows] / scale[:, None], axis=0)

    def rank(*columns: tuple[str, str]) -> int:
        b = np.zeros((plant.nstates, len(columns)))
        d = np.zeros((len(rows), len(columns)))
        for k, (kind, name) in enumerate(columns):
            if kind == "input":
                size = input_size[_INPUTS.index(name)]
                b[:, k] = plant.B[:, _INPUTS.index(name)] / size
                d[:, k] = plant.D[rows, _INPUTS.index(name)] / scale / size
            else:
                d[sensors.readings.index(name), k] = 1.0
        system = np.block([[plant.A - s * np.eye(plant.nstates), b], [plant.C[rows] / scale[:, None], d]])
        # Eliminating the states leaves the Schur complement, whose rank is the one of the system matrix minus theirs.
        states, rest = system[: plant.nstates], system[plant.nstates :]
        n = plant.nstates
        schur = rest[:, n:] - rest[:, :n] @ np.linalg.solve(states[:, :n], states[:, n:])
        return int(np.linalg.matrix_rank(schur, NOTHING_LEFT))

    def column(kind: str) -> tuple[str, str]:
        if kind in PLANT_FAULTS:
            return "input", PLANT_FAULTS[kind]
        return ("input", AIR_FAULTS[kind]) if kind in AIR_FAULTS else ("reading", SENSOR_FAULTS[kind])

    unknown = [("input", name) for name in sensors.unknown]
    result, kinds = results()[sensors.name], sensors.faults
    for i, kind in enumerate(kinds):
        for j, other in enumerate(kinds):
            blamed = [] if i == j else [column(other)]
            share = result.left[i, j]
            more = rank(*unknown, *blamed, column(kind)) > rank(*unknown, *blamed)
            assert more == (share > NOTHING_LEFT), (kind, other, share)


def test_what_acts_in_the_same_place_cannot_be_told_apart() -> None:
    """Speed and displacement are one product; fan and fouling one conductance; fouling and flow at the evaporator."""
    for result in results().values():
        kinds = result.sensors.faults
        for one, other in [
            ("compressor_speed", "compressor_displacement"),
            ("condenser_fouling", "condenser_fan"),
            ("valve_offset", "valve_stuck"),
        ]:
            assert result.left[kinds.index(one), kinds.index(other)] <= NOTHING_LEFT
        assert "evaporator_fouling" in result.unseen


def test_each_further_sensor_tells_at_least_as_much() -> None:
    for fewer, more in zip(SENSOR_SETS[:3], SENSOR_SETS[3:], strict=True):
        few, many = results()[fewer.name], results()[more.name]
        place = [more.faults.index(kind) for kind in fewer.faults]
        told = few.left > NOTHING_LEFT
        assert (many.left[np.ix_(place, place)][told] > NOTHING_LEFT).all()
    for unmeasured, measured in ((0, 1), (1, 2), (3, 4), (4, 5)):
        few, many = results()[SENSOR_SETS[unmeasured].name], results()[SENSOR_SETS[measured].name]
        count = min(len(few.left), len(many.left))
        told = few.left[:count, :count] > NOTHING_LEFT
        assert (many.left[:count, :count][told] > NOTHING_LEFT).all()


def test_three_readings_and_three_unknown_causes_show_nothing() -> None:
    result = results()["3 readings"]
    assert result.unseen == result.sensors.faults
    assert result.groups(LITTLE_LEFT) == []


def test_a_sensor_without_dynamics_is_a_unit_column() -> None:
    sensors = SENSOR_SETS[-1]
    _, faults = responses("med", sensors, np.array([0.01]))
    column = faults[0][:, sensors.faults.index("condenser_pressure_sensor")]
    assert column.tolist() == [0.0, 0.0, 0.0, 1.0 / READINGS["condenser_pressure"]]


def test_tables_are_whole() -> None:
    for result in results().values():
        lines = table(result).splitlines()
        assert {line.count("|") for line in lines} == {len(result.sensors.faults) + 2}
        assert summary(result).count("|") == 7
