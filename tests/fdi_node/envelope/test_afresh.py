"""Faults that are over do not stay isolated, and faults that are there do: an observer that begins anew tells."""

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from ac_common.units import KPA, RPM
from fdi_node.detector import Detection
from fdi_node.envelope import EnvelopeDetector
from tests.fdi_node.envelope.loops import Loop, design

READINGS = ("p_e", "superheat", "T_w", "p_c")


def told(loop: Loop, *faults: tuple[str, float, float, float], until_s: float) -> Iterator[Detection]:
    """Go on until a time with faults: what is off, by how much, from when, to when."""
    while loop.tick * 0.1 < until_s:
        now = {what: size for what, size, first_s, last_s in faults if first_s <= loop.tick * 0.1 < last_s}
        off = tuple(now.get(what, 0.0) for what in READINGS)
        yield loop.step(speed_fault=now.get("N", 0.0), reading_fault=off)


def with_a_successor(loop: Loop, missed: int | None, **off: Any) -> None:
    """Let another detector take over from this one's state after ticks that both have missed."""
    successor = EnvelopeDetector(design())
    successor.restore(json.loads(json.dumps(loop.detector.state())))
    for _ in range(missed or 20):
        loop.plant.step(loop.inputs, 0.1)
        loop.tick += 1
    o = loop.plant.outputs
    reading = np.array([o.evaporator_pressure_pa, o.superheat_k, o.wall_temperature_c, o.condenser_pressure_pa])
    reading[0] += off.get("p_e", 0.0)
    successor.warm_restart(reading, float(loop.inputs[3]), float(loop.inputs[5]), loop.command, missed)
    loop.detector = successor


@pytest.mark.parametrize(
    "faults",
    [
        [("T_w", 2.8, 30.0, 46.0), ("superheat", 4.6, 33.0, 37.0)],
        [("N", 63.0 * RPM, 29.0, 39.0), ("T_w", 2.3, 35.0, 50.0), ("p_e", -7.9 * KPA, 39.5, 50.0)],
        [("p_e", -7.9 * KPA, 31.0, 45.0), ("superheat", 3.5, 34.0, 38.0), ("N", -38.0 * RPM, 45.0, 50.0)],
    ],
)
def test_what_is_unknown_while_faults_come_and_go_is_over_within_a_minute(
    faults: list[tuple[str, float, float, float]],
) -> None:
    loop = Loop("med")
    list(told(loop, until_s=29.0))
    assert "unknown" in {said.isolated for said in told(loop, *faults, until_s=50.0)}
    list(told(loop, until_s=110.0))
    assert {said.isolated for said in told(loop, until_s=140.0)} == {None}


@pytest.mark.parametrize("missed", [None, 10])
def test_what_has_been_kept_over_a_gap_in_which_it_ended_is_over_soon(missed: int | None) -> None:
    loop, off = Loop("high"), {"p_e": 3.3 * KPA, "N": 37.6 * RPM}
    list(told(loop, until_s=25.0))
    list(told(loop, *((what, size, 0.0, 99.0) for what, size in off.items()), until_s=40.0))
    assert len(loop.detector._decision.isolated) == 2
    with_a_successor(loop, missed)
    list(told(loop, until_s=loop.tick * 0.1 + 40.0))
    assert not loop.step().detected


@pytest.mark.parametrize("missed", [None, 10])
def test_what_is_still_there_after_a_gap_keeps_its_name(missed: int | None) -> None:
    loop, size = Loop("med"), 1.0 * KPA
    list(told(loop, until_s=25.0))
    list(told(loop, ("p_e", size, 0.0, 999.0), until_s=40.0))
    with_a_successor(loop, missed, p_e=size)
    said = list(told(loop, ("p_e", size, 0.0, 999.0), until_s=120.0))
    assert {one.isolated for one in said} == {"evaporator_pressure"}
    assert said[-1].size == pytest.approx(size, abs=0.2 * KPA)


def test_another_sensor_that_stays_wrong_stays_unknown() -> None:
    loop = Loop("med")
    list(told(loop, until_s=25.0))
    list(told(loop, ("superheat", 3.0, 0.0, 999.0), until_s=30.0))
    assert {said.isolated for said in told(loop, ("superheat", 3.0, 0.0, 999.0), until_s=150.0)} == {"unknown"}
