"""Ordinary ticks in compiled code leave behind what `Loop` does, to the last bit."""

import numpy as np
import pytest

from ac_common.topics import SERIES
from ac_experiments import compiled_loop
from ac_experiments.compiled_loop import CompiledLoop
from ac_experiments.designs import designs_of
from ac_experiments.loop import Loop
from ac_experiments.ordinary_ticks import GIVE_UP
from ac_experiments.scenario import check, load
from ac_experiments.simulate import simulate
from fdi_node.envelope.quiet import SETTLE_S
from gimc_controller_node.protection import DRY
from gimc_controller_node.reference_limits import TOO_DRY

SPEED = {"kind": "compressor_speed", "size_rpm": 40.0, "onset_s": 60.0, "end_s": 120.0}
PRESSURE = {"kind": "evaporator_pressure", "size_kpa": 5.0, "onset_s": 90.0}
SUPERHEAT = {"kind": "superheat_sensor", "size_k": 3.0, "onset_s": 60.0}
SMALL = {"kind": "evaporator_pressure", "size_kpa": 0.35, "onset_s": 60.0}
COMPONENT = {"kind": "condenser_fouling", "size_percent": 50.0, "onset_s": 30.0, "end_s": 60.0}
INLET = {"kind": "air_inlet_sensor", "size_k": 4.0, "onset_s": 60.0, "end_s": 70.0}
SLOW = {"kind": "valve_slow", "size_s": 5.0, "onset_s": 20.0, "end_s": 40.0}
STUCK = {"kind": "valve_stuck", "size_percent": 100.0, "onset_s": 60.0, "end_s": 90.0}
STANDING = [
    {"kind": "superheat_sensor", "profile": "stuck", "onset_s": 0.0, "end_s": 10.0},
    {"kind": "superheat_sensor", "profile": "stuck", "onset_s": 50.0, "end_s": 50.1},
    {"kind": "superheat_sensor", "profile": "stuck", "onset_s": 100.0, "end_s": 130.0},
    {"kind": "air_inlet_sensor", "profile": "stuck", "onset_s": 40.0, "end_s": 90.0},
]
DRY_AIR = {"air": {"inlet_temperature_k": [{"at_s": 0.0, "to": -5.0, "ramp_s": 30.0}]}}
HIGHER = {"references": {"superheat_k": [{"at_s": 30.0, "to": 8.0}]}}
CASES = {
    "healthy": {},
    "faults": {"faults": [SPEED, PRESSURE, COMPONENT]},
    "unsure": {"operating_point": "high", "faults": [SMALL]},
    "inlet": {"faults": [INLET]},
    "no name": {"faults": [SUPERHEAT, PRESSURE]},
    "too dry": {"operating_point": "low", **DRY_AIR, **HIGHER},
    "protected": {"air": {"mass_flow_percent": [{"at_s": 30.0, "to": -85.0}, {"at_s": 60.0, "to": 0.0}]}},
    "valve": {"faults": [SLOW, STUCK]},
    "passive": {"passive": True, "faults": [PRESSURE]},
    "derived": {"superheat_sensor": "derived", "faults": [PRESSURE]},
    "blower": {"air_flow_sensor": "blower", "air": {"mass_flow_percent": [{"at_s": 30.0, "to": -40.0}]}},
    "stuck": {"faults": [SPEED, *STANDING]},
    "stuck and derived": {"superheat_sensor": "derived", "faults": STANDING},
}
ORDINARY = {"healthy", "too dry", "protected", "blower"}
"""Cases in which there is next to nothing to conclude."""
DIAGNOSED = {key for key in SERIES if key.startswith(("fdi/", "compensator/"))}


def scenario(**more):
    noise = load("drive:0").noise.model_dump(exclude_none=True)
    return check({"name": "short", "design": "envelope", "duration_s": 150.0, "noise": noise, **more})


class Counting(CompiledLoop):
    concluded = 0

    def _conclude(self, k):
        self.concluded += 1
        super()._conclude(k)


def both(asked, diagnose=True):
    options = {"limits": None, "accommodate": diagnose and not asked.is_passive(None), "diagnose": diagnose}
    loops = [kind(asked, designs_of(asked), **options) for kind in (Loop, Counting)]
    loops[0].run(lambda *_: None)
    return *loops, loops[1].run_compiled(lambda *_: None)


@pytest.mark.parametrize("name", CASES)
def test_both_loops_are_the_same_to_the_last_bit(name):
    loop, compiled, is_done = both(scenario(**CASES[name]))
    assert is_done
    np.testing.assert_array_equal(compiled.made, loop.made)
    assert compiled.events == loop.events
    assert repr(compiled.status) == repr(loop.status)
    for block in ("_detector", "_compensator"):
        assert repr(getattr(compiled, block).state()) == repr(getattr(loop, block).state())
    if name in ORDINARY:
        assert compiled.concluded < 0.03 * len(loop.made)
    said = {event["what"] for event in loop.events}
    assert {"too dry": TOO_DRY in said, "protected": DRY in said}.get(name, True)
    waits = [row.isolated is not None and row.acted_on[0] is None for row in loop.status]
    assert {"unsure": any(waits) and not waits[-1]}.get(name, True)


@pytest.mark.parametrize("name", CASES)
def test_without_detector_k0_alone_does_what_it_does_with_one(name):
    asked = scenario(**CASES[name])
    watched = simulate(asked, passive=True)
    for loop in both(asked, diagnose=False)[:2]:
        assert loop.status == []
        assert loop.events == watched.metadata["events"]
        assert watched.series.keys() - loop.series.keys() == DIAGNOSED
        for key, values in loop.series.items():
            np.testing.assert_array_equal(values, watched.series[key], key)


def test_a_single_run_may_do_without_compiling_the_loop(monkeypatch):
    asked = scenario()
    compiled = simulate(asked)
    assert compiled_loop.is_compiled()
    monkeypatch.setattr(compiled_loop, "is_compiled", lambda: False)
    monkeypatch.setattr(compiled_loop, "CompiledLoop", None)  # whoever asks for one fails
    stepped = simulate(asked, compile_loop=False)
    assert stepped.series.keys() == compiled.series.keys()
    for key, values in stepped.series.items():
        np.testing.assert_array_equal(values, compiled.series[key], key)


def test_what_no_ordinary_tick_does_is_left_to_the_other_loop():
    asked = load("city", ["duration_s=1.0"])
    assert not CompiledLoop(asked, designs_of(asked), None, accommodate=True).run_compiled(lambda *_: None)


def test_numbers_that_overflow_are_left_to_the_other_loop():
    asked = scenario()
    loop = CompiledLoop(asked, designs_of(asked), None, accommodate=True)
    loop.tick(0)
    loop._detector._decision.asked[SETTLE_S] = -1.0
    loop._controller.limited.k0.memory[:] = np.nan
    assert loop._go_on(1, 10) == (1, GIVE_UP)
