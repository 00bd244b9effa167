"""What a replay counts as the same, as rounding, and as a difference."""

import math

import pytest

from ac_common.topics import BY_NAME, DIAGNOSTICS, FDI
from ac_common.wire import packer
from ac_experiments.bags.comparison import MOST_SHOWN, RELATIVE_TOLERANCE, ReplayResult, by_tick
from ac_experiments.bags.reader import RawBag

TOPIC = "plant/superheat"


def message(value: float, tick: int = 0) -> bytes:
    return packer(BY_NAME[TOPIC])(tick * 100_000_000, [value])


@pytest.mark.parametrize(
    ("then", "now", "identical", "different"),
    [
        (20.0, 20.0, 1, 0),
        (20.0, math.nextafter(20.0, 21.0), 0, 0),  # rounding of another processor
        (20.0, 20.0 * (1.0 + 2.0 * RELATIVE_TOLERANCE), 0, 1),
        (math.nan, math.nan, 1, 0),
        (20.0, math.nan, 0, 1),
        (0.0, -0.0, 0, 0),
    ],
)
def test_a_message_is_identical_rounded_or_different(then: float, now: float, identical: int, different: int) -> None:
    result = ReplayResult(FDI)
    result.compare(0, TOPIC, message(then), message(now))
    assert (result.compared, result.identical, result.different) == (1, identical, different)
    assert (result.same, result.bit_for_bit) == (different == 0, identical == 1)


def test_differences_are_described_up_to_a_number_and_counted_beyond() -> None:
    result = ReplayResult(FDI)
    for tick in range(MOST_SHOWN + 5):
        result.compare(tick, TOPIC, message(20.0, tick), message(21.0, tick))
    assert result.different == MOST_SHOWN + 5
    assert len(result.differences) == MOST_SHOWN
    assert result.differences[3].startswith(f"tick 3 {TOPIC}: ")
    assert result.largest_relative_difference == pytest.approx(1.0 / 21.0)


def test_nothing_compared_is_not_the_same() -> None:
    assert not ReplayResult(FDI).same


def test_a_tick_of_which_a_part_is_missing_ends_the_recording() -> None:
    read = [topic for topic in BY_NAME.values() if FDI in topic.subscribers and topic.type != DIAGNOSTICS]
    messages = {
        f"/ac/{topic.name}": [
            (tick, packer(topic)(tick * 100_000_000, [1.0] * len(topic.series)))
            for tick in range(3 if topic is read[0] else 5)
        ]
        for topic in read
    }
    assert len(by_tick(RawBag(messages=messages), FDI)) == 3
