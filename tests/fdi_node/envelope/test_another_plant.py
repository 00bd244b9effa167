"""Plants that are others than the designs are for, and faults that come slowly."""

import json

import numpy as np
import pytest

from ac_common.errors import UserError
from ac_common.units import KPA, RPM
from ac_design.envelope import IF_NEEDED, KNOWN, design_envelope_fdi
from ac_experiments.study.plants import plant_off_by
from ac_plant_node import Plant
from ac_plant_node.dynamics.balances import N_STATES
from ac_plant_node.parameters.file import another_plant
from fdi_node.envelope import EnvelopeDetector, Limits
from fdi_node.envelope.decision import Conclusion
from fdi_node.envelope.isolation import Isolated
from fdi_node.envelope.memory import LARGEST, NIS, TICKS
from fdi_node.envelope.model import ENERGY
from fdi_node.envelope.unknowns import PARAMETERS, UNKNOWNS
from tests.fdi_node.envelope.loops import H, Loop, design

#: In standard deviations.
OFF = {"displacement_m3_rev": 1.0, "valve_discharge_coefficient": -1.0, "charge_kg": 1.0}


def on_another_plant(parameters: str = IF_NEEDED) -> Loop:
    loop = Loop("med", parameters=parameters)
    with another_plant(plant_off_by(OFF)):
        loop.plant = Plant.at("med")
    return loop


def test_another_plant_is_no_fault_and_a_fault_of_it_is_found() -> None:
    loop = on_another_plant()
    assert not any(said.detected for said in loop.run(200.0))
    assert loop.detector._decision.isolation.is_open
    *_, said = loop.run(20.0, speed_fault=40.0 * RPM)
    assert said.isolated == "compressor_speed"
    assert said.size == pytest.approx(40.0 * RPM, rel=0.2)


@pytest.mark.parametrize("point", ["low", "med"])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_parameters_are_estimated_about_as_well_as_the_filter_says_it_knows_them(point: str, sign: float) -> None:
    off, scales = sign * np.array([-1.0, 1.0, -1.0]), np.array([one.scale for one in PARAMETERS])
    loop = Loop(point, parameters=IF_NEEDED)
    with another_plant(plant_off_by(dict(zip([one.name for one in PARAMETERS], off.tolist(), strict=True)))):
        loop.plant = Plant.at(point)
    assert not any(said.detected for said in loop.run(150.0))
    found, P = loop.detector.memory.x[len(UNKNOWNS) :] / scales, loop.detector.memory.P
    assert loop.detector._decision.isolation.is_open
    # a linearised filter is a little too sure of itself
    assert (np.abs(found - off) < 4.0 * np.sqrt(np.diag(P)[-len(PARAMETERS) :])).all()


def test_an_observer_that_begins_anew_between_readings_knows_no_more_than_it_is_told() -> None:
    loop = on_another_plant()
    next(said for said in loop.run(60.0) if loop.detector._decision.isolation.is_open)
    deviations = np.delete(np.sqrt(np.diag(loop.detector.memory.P))[:N_STATES], ENERGY)
    assert deviations.min() > 0.02


def test_it_is_a_fault_when_the_parameters_are_taken_for_known() -> None:
    assert any(said.isolated for said in on_another_plant(parameters=KNOWN).run(60.0))


def test_the_plant_of_the_design_stays_known() -> None:
    loop = Loop("low", parameters=IF_NEEDED)
    assert not any(said.detected for said in loop.run(60.0))
    assert not loop.detector._decision.isolation.is_open
    assert (loop.detector.memory.x[len(UNKNOWNS) :] == 0.0).all()


class Story:
    """A decision of an observer that began `seconds` ago, and is told that f_N has jumped since then, with a ratio."""

    def __init__(self, seconds: float, ratio: float = 500.0) -> None:
        detector = EnvelopeDetector(design(parameters=IF_NEEDED))
        detector.observe(0.0, detector.design.start_outputs[1], 30.0, 30.0)
        self.decision, self._m, self._seconds, self._ratio = detector._decision, detector.memory, seconds, ratio

    def isolated(self) -> str | None:
        m, name = self._m, None
        for tick in range(10):
            m.scalars[TICKS] = round(self._seconds / H) + tick
            m.age[:] = tick
            m.ratios[:] = 0.0
            m.ratios[0] = m.scalars[LARGEST] = self._ratio
            name = self.decision.step(100.0 + H * tick).isolated
            if self.decision.doubts or name == "compressor_speed":
                break
        return name


def test_what_would_be_isolated_early_is_another_plant() -> None:
    early, later = Story(Limits().trust_s - 1.0), Story(Limits().trust_s + 1.0)
    assert early.isolated() is None
    assert early.decision.doubts
    assert later.isolated() == "compressor_speed"
    assert not later.decision.doubts


@pytest.mark.parametrize("early", [True, False])
def test_what_has_been_inconsistent_since_early_is_another_plant(early: bool) -> None:
    after_s = 5.0  # that the fault seems to begin after `trust_s`
    story = Story(Limits().trust_s + after_s)
    story._m.scalars[NIS] = 2.0 * Limits().inconsistent
    story.decision.since.inconsistent = 100.0 - after_s + (-1.0 if early else 1.0)
    assert story.isolated() == (None if early else "compressor_speed")
    assert story.decision.doubts == early


def told(story: Story, seconds: float, lasts_s: float, **ratios: float) -> list[Conclusion]:
    """Return what is said from `seconds` after the start on, while unknowns explain so much since a second before."""
    m, said = story._m, []
    names = [UNKNOWNS[int(at)].name for at in story.decision._rules.jumping]
    for tick in range(round(lasts_s / H)):
        m.scalars[TICKS], m.age[:], m.ratios[:] = round(seconds / H) + tick, 1.0 / H + tick, 0.0
        for name, ratio in ratios.items():
            m.ratios[names.index(name)] = ratio
        m.scalars[LARGEST] = m.ratios.max()
        said.append(story.decision.step(100.0 + H * tick))
    return said


@pytest.mark.parametrize(
    ("seconds", "age_s", "ratio", "doubts"),
    [(35.0, 12.0, 26.0, True), (35.0, 1.0, 26.0, False), (35.0, 12.0, 20.0, False), (600.0, 580.0, 26.0, False)],
)
def test_an_estimate_that_wanders_early_while_something_explains_more_since_the_start_is_another_plant(
    seconds: float, age_s: float, ratio: float, doubts: bool
) -> None:
    story = Story(seconds)
    m, decision = story._m, story.decision
    m.x[1] = 3.0 * KPA
    for tick in range(round((Limits().wander_s + 0.2) / H)):
        m.scalars[TICKS] = round(seconds / H) + tick
        m.ratios[:], m.age[:], m.best[:], m.best[4] = 0.0, 0.0, 0, 3
        m.ratios[4], m.age[3] = ratio, age_s / H + tick
        m.scalars[LARGEST] = ratio
        decision.step(100.0 + H * tick)
    assert decision.doubts == doubts
    assert [one.name for one in decision.isolated] == ([] if doubts else ["evaporator_pressure"])


@pytest.mark.parametrize(("ahead", "after_s"), [(0.5, Limits().hold_unsure_s), (2.0, Limits().hold_s)])
def test_on_another_plant_a_fault_of_the_compressor_that_is_little_ahead_waits(ahead: float, after_s: float) -> None:
    story, ratio = Story(1000.0), 500.0
    story.decision.isolation.is_open = True
    other = ratio * (1.0 - ahead * Limits().at_once_share) + Limits().rarer
    said = told(story, 1000.0, 5.0, compressor_speed=ratio, superheat_sensor=other)
    first = next(i for i, one in enumerate(said) if one.isolated == "compressor_speed")
    assert first * H == pytest.approx(after_s)


def test_on_another_plant_what_is_not_isolated_is_not_detected() -> None:
    much = 2.0 * Limits().certain
    for is_open in (False, True):
        story = Story(1000.0)
        story.decision.isolation.is_open = is_open
        *_, said = told(story, 1000.0, 5.0, compressor_speed=much, superheat_sensor=much + Limits().rarer)
        assert (said.detected, said.isolated) == (not is_open, None)


def test_a_plant_that_has_been_trusted_is_not_doubted_when_the_observer_begins_anew() -> None:
    story = Story(Limits().trust_s - 1.0)
    story.decision.isolated.append(Isolated(1, "evaporator_pressure", 60.0, 60.0))
    assert story.isolated() == "compressor_speed"
    assert not story.decision.doubts


def test_one_that_takes_its_place_knows_of_the_other_plant() -> None:
    loop = on_another_plant()
    list(loop.run(60.0))
    other = EnvelopeDetector(design(parameters=IF_NEEDED))
    other.restore(json.loads(json.dumps(loop.detector.state())))
    assert other._decision.isolation.is_open
    assert (other.rules.Q == loop.detector.rules.Q).all()


@pytest.mark.parametrize("point", ["low", "med", "high"])
def test_a_sensor_that_drifts_is_named(point: str) -> None:
    loop = Loop(point)
    list(loop.run(60.0))
    names = []
    for tick in range(900):
        said = loop.step(reading_fault=(min(5.0 * KPA * tick * H / 60.0, 5.0 * KPA), 0.0, 0.0, 0.0))
        names += [said.isolated] if said.isolated and said.isolated not in names else []
    assert names == ["evaporator_pressure"]
    assert said.size == pytest.approx(5.0 * KPA, rel=0.05)


def test_the_pressures_sensor_has_a_name_at_once_or_none_where_parameters_are_estimated() -> None:
    names = []
    for jump, ramp_s in ((5.0 * KPA, 0.1), (5.0 * KPA, 10.0)):
        loop = on_another_plant()
        list(loop.run(200.0))
        said = [
            loop.step(reading_fault=(jump * min((tick + 1) * H / ramp_s, 1.0), 0.0, 0.0, 0.0)).isolated
            for tick in range(300)
        ]
        names.append((said[0], "evaporator_pressure" in said))
    assert names == [("evaporator_pressure", True), (None, False)]


def test_what_stays_without_a_name_is_forgotten_where_parameters_are_estimated() -> None:
    story = Story(Limits().settle_open_s + 10.0)
    story.decision.open_up()
    story.decision.since.likely = 100.0 - Limits().forget_open_s - 1.0
    story.decision.since.ahead = np.inf
    m = story._m
    m.scalars[TICKS], m.S[:5] = round((Limits().settle_open_s + 10.0) / H), 7.0
    m.ratios[0] = m.scalars[LARGEST] = 500.0
    assert story.decision.step(100.0).isolated is None
    assert story.decision.since.likely == np.inf
    assert not m.S.any()


def test_choices_of_parameters() -> None:
    assert len(design(parameters=IF_NEEDED).first) == len(UNKNOWNS) + len(PARAMETERS)
    assert len(design(parameters=KNOWN).first) == len(UNKNOWNS)
    with pytest.raises(UserError, match="parameters 'guessed': allowed are known, if_needed, estimated"):
        design_envelope_fdi(H, parameters="guessed")


def test_what_is_small_has_no_name_where_parameters_are_estimated() -> None:
    for ratio, name in ((Limits().likely_open - 1.0, None), (Limits().likely_open + 1.0, "compressor_speed")):
        story = Story(Limits().settle_open_s + 10.0, ratio)
        story.decision.open_up()
        assert story.isolated() == name
        assert Story(Limits().settle_open_s + 10.0, ratio).isolated() == "compressor_speed"
