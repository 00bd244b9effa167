"""The decision on likelihoods that are made up."""

import math

import numpy as np
import pytest

from fdi_node.envelope import EnvelopeDetector, Limits
from fdi_node.envelope.memory import LARGEST, NIS, TICKS
from fdi_node.envelope.unknowns import UNKNOWNS
from tests.fdi_node.envelope.loops import design

NAMES = [one.name for one in UNKNOWNS]
PLAIN = Limits().plain


class Story:
    """A detector whose likelihoods are told."""

    def __init__(self) -> None:
        self.detector = EnvelopeDetector(design())
        at = self.detector.design.start_outputs[1]
        self.detector.observe(0.0, at, 30.0, 30.0)
        self.m, self.decision, self.time_s = self.detector.memory, self.detector._decision, 100.0
        self.m.scalars[TICKS] = 1000.0

    def tell(self, seconds: float, nis: float = 1.0, **ratios: float) -> tuple[bool, str | None]:
        """Conclude while these ratios last; a jump that has been accepted has nothing left to explain."""
        for _ in range(round(seconds / 0.1)):
            self.m.scalars[NIS] = nis
            accepted = len(self.decision.isolated)
            self.m.ratios[:] = 0.0
            for name, ratio in ratios.items():
                self.m.ratios[NAMES.index(name)] = ratio
            self.m.scalars[LARGEST] = self.m.ratios.max()
            said = self.decision.step(self.time_s)
            self.time_s += 0.1
            if len(self.decision.isolated) > accepted:
                ratios = {}
        return said.detected, said.isolated

    def begin_slowly(self) -> None:
        """Let a fault of the compressor be isolated, though one of the sensor explains nearly as much."""
        said = self.tell(1.0, compressor_speed=PLAIN + 40.0, evaporator_pressure=PLAIN)
        assert said == (True, "compressor_speed")
        self.m.x[0], self.m.P[12, 12] = 4.0, 1.0e-3


def test_nothing_to_explain_is_no_fault() -> None:
    assert Story().tell(10.0, compressor_speed=Limits().natural - 1.0) == (False, None)


@pytest.mark.parametrize("kind", ["compressor_speed", "evaporator_pressure"])
def test_a_plain_fault_is_isolated_soon_and_a_small_one_later(kind: str) -> None:
    assert Story().tell(Limits().hold_s + 0.2, **{kind: PLAIN + 100.0}) == (True, kind)
    assert Story().tell(Limits().hold_s + 0.2, **{kind: 50.0}) == (False, None)
    assert Story().tell(Limits().hold_unsure_s + 0.2, **{kind: 50.0}) == (True, kind)


@pytest.mark.parametrize(("more", "patience"), [(0.0, "patience_s"), (1000.0, "patience_certain_s")])
def test_less_of_a_lead_is_needed_the_longer_it_takes(more: float, patience: str) -> None:
    limits, ratio = Limits(), 200.0 + more
    lead = 0.5 * max(limits.ahead, limits.ahead_share * ratio)
    story, seen = Story(), {"evaporator_pressure": ratio, "compressor_speed": ratio - lead}
    patience_s = getattr(limits, patience)
    half_s = 0.5 * patience_s + limits.hold_unsure_s + 0.2
    assert story.tell(half_s, **seen) == (more > 0.0, None)
    assert story.tell(0.75 * patience_s + limits.hold_unsure_s - half_s, **seen) == (True, "evaporator_pressure")


@pytest.mark.parametrize(("name", "less"), [("evaporator_air_flow", 0.0), ("superheat_sensor", Limits().rarer)])
def test_what_is_certain_and_no_fault_with_a_name_needs_all_of_its_lead_or_is_unknown(name: str, less: float) -> None:
    story, seen = Story(), {name: 2000.0 + less, "compressor_speed": 1998.0}
    assert story.tell(Limits().undecided_s - 0.2, **seen) == (True, None)
    assert story.tell(0.5, **seen) == (True, "unknown")


@pytest.mark.parametrize("kind", ["compressor_speed", "evaporator_pressure"])
def test_after_a_while_any_lead_of_a_name_is_enough(kind: str) -> None:
    seen = {"compressor_speed": 200.0, "evaporator_pressure": 200.0} | {kind: 200.1}
    assert Story().tell(Limits().patience_s + Limits().hold_unsure_s, **seen) == (True, kind)


def test_a_jump_of_an_air_flow_is_no_fault() -> None:
    story = Story()
    assert story.tell(1.0, evaporator_air_flow=500.0, compressor_speed=400.0) == (False, None)


@pytest.mark.parametrize("name", NAMES[4:])
def test_what_has_no_name_is_unknown(name: str) -> None:
    assert Story().tell(Limits().hold_unsure_s + 0.2, **{name: 900.0, "compressor_speed": 500.0}) == (True, "unknown")


def test_what_has_no_name_holds_a_named_fault_back_for_less_and_a_stuck_valve_for_more() -> None:
    seen = {"compressor_speed": 1000.0}
    hold_s = Limits().hold_unsure_s + 0.2
    assert Story().tell(hold_s, condenser_pressure_sensor=995.0, **seen) == (True, "compressor_speed")
    assert Story().tell(hold_s, valve_stuck=995.0, **seen) == (True, "unknown")


def test_inconsistent_innovations_are_unknown_until_another_decision_says_that_nothing_is_off() -> None:
    story = Story()
    assert story.tell(Limits().undecided_s + 0.2, nis=9.0) == (True, "unknown")
    assert story.tell(Limits().clear_s + 1.0) == (True, "unknown")
    story.decision.withdraw(Story().decision)
    assert story.tell(2.0) == (False, None)


def test_an_estimate_beyond_its_threshold_is_a_fault_and_one_that_cannot_be_is_unknown() -> None:
    story = Story()
    story.m.x[1] = 3.0e3
    assert story.tell(Limits().wander_s + 0.2) == (True, "evaporator_pressure")
    story.m.x[1] = 1.1 * Limits().largest_pa
    assert story.tell(0.2) == (True, "unknown")


def test_a_second_fault_does_not_end_the_first_and_both_end_by_themselves() -> None:
    story = Story()
    story.tell(1.0, evaporator_pressure=PLAIN + 100.0)
    story.m.x[1], story.m.P[13, 13] = 5.0e3, 1.0e-3
    assert story.tell(1.0, compressor_speed=PLAIN + 100.0)[1] == "compressor_speed"
    story.m.x[0], story.m.P[12, 12] = 4.0, 1.0e-3
    said = story.decision.step(story.time_s)
    assert (said.isolated, said.also_isolated) == ("compressor_speed", "evaporator_pressure")
    assert said.size == pytest.approx(4.0)
    story.m.x[0] = 0.0
    assert story.tell(Limits().clear_s + 0.2)[1] == "evaporator_pressure"
    story.m.x[1] = 0.0
    assert story.tell(Limits().clear_s + 0.2) == (False, None)


def test_thresholds_follow_what_the_filter_knows() -> None:
    story = Story()
    before = story.decision.step(story.time_s).thresholds
    story.m.P[12, 12] *= 4.0
    after = story.decision.step(story.time_s).thresholds
    floor = Limits().floor_rad_s
    assert after[0] - floor == pytest.approx(2.0 * (before[0] - floor))
    assert after[1] == before[1]
    assert np.isfinite(before).all()
    assert math.isnan(story.decision.step(story.time_s).onset_s)


def test_a_fault_that_does_not_rest_is_unknown_and_one_that_moves_now_and_then_is_not() -> None:
    for pause_s, name in ((5.0, "unknown"), (Limits().restless_s, "compressor_speed")):
        story = Story()
        story.tell(1.0, compressor_speed=PLAIN + 100.0)
        story.m.x[0], story.m.P[12, 12] = 4.0, 1.0e-3
        for _ in range(4):
            story.tell(pause_s)
            isolated = story.tell(0.1, compressor_speed=PLAIN + 100.0)[1]
        assert isolated == name


def test_beside_a_slow_fault_another_slow_one_is_unknown_and_an_abrupt_one_has_its_name() -> None:
    slow, seen = Story(), {"compressor_speed": 100.0, "evaporator_pressure": 800.0}
    for story, age_s in ((slow, 10.0), (Story(), 0.1)):
        story.begin_slowly()
        story.m.age[:] = age_s / 0.1
        assert story.tell(0.1, **seen)[1] == ("compressor_speed" if story is slow else "evaporator_pressure")
    assert slow.tell(Limits().hold_unsure_s + 0.2, **seen)[1] == "unknown"


def test_what_a_move_of_a_slow_fault_explains_nearly_as_well_is_no_second_one() -> None:
    story = Story()
    story.begin_slowly()
    story.m.age[:] = 100.0
    seen = {"compressor_speed": 500.0, "evaporator_pressure": 0.9 * Limits().second * 500.0}
    assert story.tell(Limits().hold_s + 0.1, **seen)[1] == "compressor_speed"
    assert story.decision.isolated[0].moves > 0.0


def test_a_second_fault_that_jumps_has_its_name_at_once() -> None:
    story = Story()
    story.begin_slowly()
    seen = {"compressor_speed": 500.0, "evaporator_pressure": 0.9 * Limits().second * 500.0}
    assert story.tell(0.1, **seen)[1] == "evaporator_pressure"


def test_nothing_slow_has_a_name_soon_after_something_was_unknown() -> None:
    story = Story()
    story.tell(Limits().undecided_s + 0.2, nis=9.0)
    story.decision.withdraw(Story().decision)
    assert story.tell(Limits().clear_s + 1.0) == (False, None)
    story.m.age[:] = 100.0
    assert story.tell(Limits().hold_unsure_s + 0.2, evaporator_pressure=200.0)[1] == "unknown"


def test_what_has_fallen_far_below_its_largest_ratio_is_refuted() -> None:
    largest = 900.0
    fall = max(Limits().likely, Limits().refuted * largest)
    for left, isolated in ((largest - 0.9 * fall, "evaporator_pressure"), (largest - 1.1 * fall, None)):
        story = Story()
        story.tell(Limits().hold_unsure_s - 0.5, evaporator_pressure=largest, compressor_speed=largest - 50.0)
        assert story.tell(1.0, evaporator_pressure=left, compressor_speed=left - 50.0)[1] == isolated


def test_what_has_begun_with_a_jump_of_an_air_flow_is_no_detection_before_it_may_be_isolated() -> None:
    story, seen = Story(), {"wall_temperature_sensor": 1500.0}
    story.tell(0.1, evaporator_air_flow=100.0)
    assert story.decision.since.natural < story.time_s
    wait_s = Limits().after_natural_s
    assert story.tell(wait_s - 0.5, **seen) == (False, None)
    assert story.tell(1.0, **seen) == (True, "unknown")
