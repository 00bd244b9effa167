"""The registry of faults, and what is made from it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ac_common.faults import (
    BY_KIND,
    COMPONENT_KINDS,
    COMPONENTS,
    FAULTS,
    ISOLABLE,
    KINDS,
    UNKNOWN,
    Place,
    called,
    faults_at,
    in_unit,
    kinds_in,
)
from ac_common.signals import Command, Inlets, Measurement
from ac_common.topics import BY_NAME, FDI, INJECTOR, SCENARIO, SERIES, residual_of, schedule_of, truth_of
from ac_plant_node.inputs import FAULT_KINDS
from ac_plant_node.inputs import FAULTS as PLANT_FAULTS
from fault_injector_node.injector import FaultInjector, components

ACTUAL = (2.5e5, 20.0, 12.0, 1.3e6)
INLETS = (30.0, 35.0)
COMMAND = (150.0, 0.4)


def test_names_and_symbols_are_unique_and_those_with_a_filter_come_first() -> None:
    assert len(set(KINDS)) == len({fault.symbol for fault in FAULTS}) == len(FAULTS)
    assert FAULTS[: len(ISOLABLE)] == ISOLABLE
    assert UNKNOWN not in KINDS


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.kind)
def test_each_fault_has_its_topics(fault) -> None:
    assert BY_NAME[fault.truth_topic].publisher == INJECTOR
    assert (BY_NAME["scenario/faults"].publisher, BY_NAME["scenario/faults"].subscribers) == (SCENARIO, (INJECTOR,))
    assert {truth_of(fault.kind), schedule_of(fault.kind)} <= set(SERIES)
    assert (fault.residual_topic in BY_NAME) == fault.has_filter
    if fault.has_filter:
        assert BY_NAME[fault.residual_topic].publisher == FDI
        assert residual_of(fault.kind) in SERIES
    # What may be injected must pass for a signal of the loop.
    ((truth_low, truth_high),) = BY_NAME[fault.truth_topic].spans
    for low, high in ((truth_low, truth_high), BY_NAME["scenario/faults"].spans[KINDS.index(fault.kind)]):
        assert low <= fault.lowest_live_si < fault.largest_live_si <= high
    assert fault.largest_si <= fault.largest_live_si <= 1.1 * fault.largest_si
    assert 0.0 < fault.typical <= fault.largest


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.kind)
@given(share=st.floats(-1.0, 1.0))
def test_each_fault_is_added_to_its_own_signal_and_to_nothing_else(fault, share: float) -> None:
    size = max(share * fault.largest_si, fault.lowest_si)
    faults = [size if other is fault else 0.0 for other in FAULTS]
    injector = FaultInjector()
    measured, actuator = injector.measure(ACTUAL, faults), injector.actuate(COMMAND, faults)
    off = {
        **dict(zip(Measurement._fields, np.subtract(measured, ACTUAL), strict=True)),
        **dict(zip(Inlets._fields, np.subtract(injector.measure_inlets(INLETS, faults), INLETS), strict=True)),
        **dict(zip(Command._fields, np.subtract(actuator, COMMAND), strict=True)),
    }
    off |= dict(zip(COMPONENT_KINDS, components(faults), strict=True))
    expected = max(size, -COMMAND[0]) if fault.place is Place.ACTUATOR else size
    # The sum is rounded, so the difference is no more exact than that.
    assert off.pop(fault.signal) == pytest.approx(expected, abs=np.spacing(2.0 * max(ACTUAL)))
    assert not any(off.values())


def test_components_faults_are_those_of_the_plant_in_its_order_and_within_its_limits() -> None:
    assert tuple(fault.kind for fault in COMPONENTS) == FAULT_KINDS
    for fault, row in zip(COMPONENTS, PLANT_FAULTS, strict=True):
        assert (fault.lowest_si, fault.largest_si) == pytest.approx((row.low, row.high), rel=1e-15)
        assert {"%": "percent", "kg/h": "kg_h", "s": "s"}[fault.unit] == row.unit or row.unit == "flag"
    for way, limit in ((1.0, "largest_si"), (-1.0, "lowest_si")):
        much = [2.0 * way * fault.largest_si for fault in FAULTS]
        assert components(much) == tuple(getattr(fault, limit) for fault in COMPONENTS)


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
