"""Which messages are acted upon, and when: bookkeeping under any order, loss, delay and repetition of messages."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from ac_common.topics import BY_NAME
from ac_ros_common.tick_sync import (
    FORGETS,
    MOST_LOST,
    REBASE_NS,
    WRITER_GONE_NS,
    TickSet,
    Timeline,
    WallClockSet,
    Writer,
)

PERIOD = 100_000_000
START = 1_700_000_000 * 10**9  # stamps are the wall clock's
BOOT = 5 * 10**9  # arrivals are the monotonic clock's
PAIR = (BY_NAME["measured/evaporator_pressure"], BY_NAME["measured/superheat"])
NAMES = [topic.name for topic in PAIR]

#: For each of 30 ticks and both topics: delay in ms, or None for a lost message; and how often it comes.
journeys = st.lists(
    st.tuples(*[st.tuples(st.one_of(st.none(), st.integers(0, 180)), st.integers(1, 2)) for _ in PAIR]),
    min_size=30,
    max_size=30,
)


class Run:
    """A `WallClockSet` fed on a simulated clock."""

    def __init__(self, **options):
        self.timeline = Timeline(PERIOD)
        self.acted, self.missed = [], []
        options |= {"on_missed_inputs": self.missed.append}
        self.set = WallClockSet(PAIR, self._act, self.timeline, PERIOD // 2, **options)

    def _act(self, stamp, *values):
        self.acted.append((self.now, stamp, values))

    def feed(self, messages, until):
        """Messages as (arrival, topic, stamp, value), in any order."""
        for arrival, topic, stamp, value in sorted(messages):
            self.wake(arrival)
            if not self.timeline.refuse(stamp, arrival):
                done = self.set.add(topic, stamp, (value,))
                if done:
                    self._act(*done)
        self.wake(until)

    def wake(self, until):
        while (due := self.set.due_ns()) is not None and due <= until:
            self.now = due
            done = self.set.overdue(due)
            if done:
                self._act(*done)
        self.now = until


def sent(ticks):
    for k, tick in enumerate(ticks):
        for name, (delay_ms, copies) in zip(NAMES, tick, strict=True):
            if delay_ms is not None:
                for copy in range(copies):
                    yield BOOT + k * PERIOD + (delay_ms + copy) * 10**6, name, START + k * PERIOD, float(k)


@given(journeys)
def test_every_tick_is_answered_once_in_order_and_in_time(ticks):
    first = [(BOOT, name, START - PERIOD, -1.0) for name in NAMES]
    run = Run(holds=dict.fromkeys(NAMES, 3))
    run.feed([*first, *sent(ticks)], BOOT + 31 * PERIOD)
    stamps = sorted([stamp for _, stamp, _ in run.acted] + run.missed)
    assert stamps == list(range(START - PERIOD, stamps[-1] + 1, PERIOD))  # none left out, none twice
    assert stamps[-1] >= START + 28 * PERIOD
    for now, stamp, values in run.acted:
        forgotten = FORGETS * (now - BOOT)
        assert now - BOOT <= stamp - START + PERIOD + PERIOD // 2 + forgotten  # due in time, whatever stays away
        for value in values:  # the tick's own value, or one of at most three ticks before
            assert 0 <= (stamp - START) // PERIOD - value <= 3


@given(journeys)
def test_without_holds_only_whole_ticks_are_acted_upon(ticks):
    run = Run()
    run.feed(sent(ticks), BOOT + 31 * PERIOD)
    for _, stamp, values in run.acted:
        assert values == ((stamp - START) // PERIOD,) * 2


def test_of_a_pile_only_the_newest_tick_is_acted_upon():
    run = Run(holds=dict.fromkeys(NAMES, 3))
    ticks = [((0, 1), (0, 1))] * 80
    messages = list(sent(ticks))
    run.feed([m for m in messages if m[0] < BOOT + 10 * PERIOD], BOOT + 10 * PERIOD - 1)
    before = len(run.acted)
    # Stopped for 5 s: everything that was sent meanwhile is taken at once.
    wake = BOOT + 60 * PERIOD + 1
    refused = 0
    for _, name, stamp, value in [m for m in messages if BOOT + 10 * PERIOD <= m[0] <= wake]:
        if run.timeline.refuse(stamp, wake):
            refused += 1
        else:
            run.set.add(name, stamp, (value,))
    assert refused >= 2 * 47
    assert run.set.last_ns == START + 60 * PERIOD
    run.now = wake
    assert run.set.overdue(wake) is None
    assert len(run.acted) == before


def test_values_stand_in_for_as_long_as_they_may_and_then_the_node_is_told():
    run = Run(holds={NAMES[0]: 2}, optional=(NAMES[1],))
    run.feed([(BOOT, NAMES[0], START, 7.0), (BOOT, NAMES[1], START, 8.0)], BOOT + 6 * PERIOD)
    assert [values for _, _, values in run.acted] == [(7.0, 8.0), (7.0, None), (7.0, None)]
    assert run.missed == [START + k * PERIOD for k in (3, 4, 5)]
    assert run.set.held == {NAMES[0]: 5, NAMES[1]: 5}


def test_one_stamp_that_was_early_is_forgotten():
    timeline = Timeline(PERIOD)
    for k in range(3):
        assert not timeline.refuse(START + k * PERIOD, BOOT + k * PERIOD)
    early = PERIOD // 2
    assert not timeline.refuse(START + 3 * PERIOD, BOOT + 3 * PERIOD - early)
    expected = [timeline.arrival_ns(START + 4 * PERIOD) - (BOOT + 4 * PERIOD)]
    for k in range(4, 80):
        assert not timeline.refuse(START + k * PERIOD, BOOT + k * PERIOD)
        expected.append(timeline.arrival_ns(START + (k + 1) * PERIOD) - (BOOT + (k + 1) * PERIOD))
    assert expected[0] == -early
    assert expected[-1] == 0
    assert all(0 <= later - before <= FORGETS * 1.5 * PERIOD for before, later in pairwise(expected))


def test_stamps_of_another_clock_are_refused_until_there_is_no_other():
    timeline = Timeline(PERIOD)
    assert not timeline.refuse(START, BOOT)
    assert timeline.refuse(START + 10**12, BOOT + PERIOD) == "stamp from the future"
    assert not timeline.refuse(START + PERIOD, BOOT + PERIOD)
    assert timeline.refuse(START, BOOT + 5 * PERIOD) == "stale"
    assert not timeline.refuse(START + 5 * PERIOD, BOOT + 5 * PERIOD)
    # A plant that was started anew: nothing but its stamps comes any more.
    later, stamps = BOOT + 6 * PERIOD, START + 10**12 + 7
    refusals = [bool(timeline.refuse(stamps + k * PERIOD, later + k * PERIOD)) for k in range(20)]
    assert refusals.index(False) == REBASE_NS // PERIOD
    assert not any(refusals[REBASE_NS // PERIOD :])


@given(st.lists(st.integers(-40, 40), min_size=5, max_size=30))
def test_age_does_not_depend_on_the_wall_clock_or_on_jitter(jitters_ms):
    timeline = Timeline(PERIOD)
    for k, jitter_ms in enumerate(jitters_ms):
        assert not timeline.refuse(START + k * PERIOD, BOOT + k * PERIOD + jitter_ms * 10**6)


@given(
    own=st.lists(st.integers(1, 5), min_size=5, max_size=40),
    first=st.integers(0, 10**6),
    stranger=st.lists(st.tuples(st.integers(0, 39), st.integers(1, 10**6)), max_size=20),
)
def test_messages_of_a_second_publisher_are_told_apart(own, first, stranger):
    """The own publisher's numbers grow, with losses; a stranger's come in between and lie outside its window."""
    writer, number, now = Writer(), first, BOOT
    for k, step in enumerate(own):
        number += step
        now += PERIOD
        assert writer.owns(number, now)
        for _, other in [s for s in stranger if s[0] == k]:
            if not number < other <= number + MOST_LOST:
                assert not writer.owns(other, now + 1)
    assert writer.owns(1, now + WRITER_GONE_NS)  # started anew


@given(st.lists(st.tuples(st.integers(-20, 20), st.booleans()), min_size=5, max_size=30))
def test_plant_that_stamps_by_a_jittering_clock_gets_one_answer_a_tick(ticks):
    run = Run(holds={NAMES[0]: 3}, optional=(NAMES[1],))
    messages = []
    for k, (jitter_ms, has_both) in enumerate([(0, True), *ticks]):
        stamp = START + k * PERIOD + jitter_ms * 10**6
        messages += [(BOOT + stamp - START, name, stamp, float(k)) for name in NAMES[: 1 + has_both]]
    run.feed(messages, BOOT + (len(ticks) + 1) * PERIOD - 1)
    assert [values[0] for _, _, values in run.acted] == [float(k) for k in range(len(ticks) + 1)]
    assert run.missed == []


TRIO = tuple(BY_NAME[f"plant/{name}"] for name in ("evaporator_pressure", "superheat", "wall_temperature"))


def woken_for(places):
    """Ticks acted upon, and how often the node woke, when messages come in this order of topics."""
    tick_set, sent, queue, acted, wakes = TickSet(TRIO, act=lambda *_: None), [0, 0, 0], [], [], 0
    for place in places:
        queue.append((place, sent[place]))
        sent[place] += 1
        if place in tick_set.lacking():
            wakes += 1
            taken, queue = sorted(queue), []  # as subscriptions are: one after the other
            acted += [done for at, tick in taken if (done := tick_set.add(TRIO[at].name, tick, (at,)))]
    assert not queue
    return [stamp for stamp, *_ in acted], wakes


@given(st.permutations([0, 1, 2] * 5))
def test_who_wakes_for_what_a_tick_lacks_misses_none(places):
    acted, wakes = woken_for(places)
    assert acted == list(range(5))
    assert wakes <= len(places)


@given(st.lists(st.permutations([0, 1, 2]), min_size=1))
def test_who_gets_tick_after_tick_wakes_for_the_first_message_and_for_what_is_lacking(ticks):
    acted, wakes = woken_for([place for tick in ticks for place in tick])
    assert acted == list(range(len(ticks)))
    # The last topic of a tick is the one to wait for, after the first message: the others come along.
    assert wakes == sum(2 if tick[2] == 2 or tick[:2] == [2, 0] else 3 for tick in ticks)
