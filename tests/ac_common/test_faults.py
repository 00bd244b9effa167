"""The registry of faults, and what is made from it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ac_common.faults import BY_KIND, FAULTS, ISOLABLE, KINDS, UNKNOWN, Place, called, faults_at, in_unit, kinds_in
from ac_common.signals import Command, Measurement
from ac_common.topics import BY_NAME, FDI, INJECTOR, SCENARIO, SERIES, residual_of, schedule_of, truth_of
from fault_injector_node.injector import FaultInjector

ACTUAL = (2.5e5, 20.0, 12.0, 1.3e6)
COMMAND = (150.0, 0.4)


def test_names_and_symbols_are_unique_and_those_with_a_filter_come_first() -> None:
    assert len(set(KINDS)) == len({fault.symbol for fault in FAULTS}) == len(FAULTS)
    assert FAULTS[: len(ISOLABLE)] == ISOLABLE
    assert UNKNOWN not in KINDS


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.kind)
def test_each_fault_has_its_topics(fault) -> None:
    assert BY_NAME[fault.truth_topic].publisher == INJECTOR
    assert (BY_NAME[fault.schedule_topic].publisher, BY_NAME[fault.schedule_topic].subscribers) == (
        SCENARIO,
        (INJECTOR,),
    )
    assert {truth_of(fault.kind), schedule_of(fault.kind)} <= set(SERIES)
    assert (fault.residual_topic in BY_NAME) == fault.has_filter
    if fault.has_filter:
        assert BY_NAME[fault.residual_topic].publisher == FDI
        assert residual_of(fault.kind) in SERIES
    # What may be injected must pass for a signal of the loop.
    for topic in (fault.truth_topic, fault.schedule_topic):
        ((low, high),) = BY_NAME[topic].spans
        assert low <= -fault.largest_live_si < fault.largest_live_si <= high
    assert fault.largest_si <= fault.largest_live_si <= 1.1 * fault.largest_si
    assert 0.0 < fault.typical <= fault.largest


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.kind)
@given(share=st.floats(-1.0, 1.0))
def test_each_fault_is_added_to_its_own_signal_and_to_nothing_else(fault, share: float) -> None:
    size = share * fault.largest_si
    faults = [size if other is fault else 0.0 for other in FAULTS]
    injector = FaultInjector()
    measured, actuator = injector.measure(ACTUAL, faults), injector.actuate(COMMAND, faults)
    off = {
        **dict(zip(Measurement._fields, np.subtract(measured, ACTUAL), strict=True)),
        **dict(zip(Command._fields, np.subtract(actuator, COMMAND), strict=True)),
    }
    expected = max(size, -COMMAND[0]) if fault.place is Place.ACTUATOR else size
    assert off.pop(fault.signal) == pytest.approx(expected, abs=1e-9)  # Pa: rounding of 250 kPa
    assert not any(off.values())


def test_a_derived_superheat_shows_the_faults_of_both_sensors() -> None:
    faults = [{"evaporator_pressure": 5000.0, "superheat_sensor": 2.0}.get(kind, 0.0) for kind in KINDS]
    direct, derived = (FaultInjector(superheat=how).measure(ACTUAL, faults) for how in ("direct", "derived"))
    assert direct.superheat == 22.0
    assert derived.superheat < 22.0 - 0.4  # the saturation temperature grows by some 0.1 K for each kPa
    assert derived.evaporator_pressure == direct.evaporator_pressure == ACTUAL[0] + 5000.0


def test_words_and_units() -> None:
    assert called("evaporator_pressure") == "a fault of the pressure sensor"
    assert called(UNKNOWN) == "an unknown fault"
    assert in_unit("evaporator_pressure", 5000.0) == 5.0
    assert np.isnan(in_unit(UNKNOWN, 1.0))
    assert kinds_in(", ".join(KINDS)) == frozenset(KINDS)
    assert kinds_in("evaporator_pressure_of_another_kind, gremlin") == frozenset()
    assert [number for number, _ in faults_at(Place.ACTUATOR)] == [KINDS.index("compressor_speed")]
    assert all(BY_KIND[kind].kind == kind for kind in KINDS)
