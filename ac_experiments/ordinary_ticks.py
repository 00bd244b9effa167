"""Ticks of the loop in which nothing is out of the ordinary, one after the other in compiled code.

In most ticks of a run no fault stands out and no component of the plant changes. Such ticks are done here with the
functions that the nodes step with; what is left over is that of `ac_experiments.loop`, in the middle of a tick. Both
give the same numbers, to the last bit.
"""

from collections.abc import Sequence

import numpy as np

from ac_common.compiled import Array, step_compiler
from ac_experiments.tick_columns import (
    ACTUATOR,
    COMMANDED,
    INLETS,
    INLETS_READ,
    INNOVATION,
    PERFORMANCE,
    Q_MADE,
    READINGS,
    RESIDUAL,
    STUCK,
)
from ac_plant_node.compiled_sources import COMPILED_SOURCES
from ac_plant_node.dynamics.drive import AIR_C, OPENING, SPEED
from ac_plant_node.dynamics.telling import N_OUTPUTS, run_and_tell
from ac_plant_node.dynamics.workspace import views
from ac_plant_node.inputs import INPUT
from ac_plant_node.properties.tables import Tables
from ac_plant_node.saturation import temperature_on
from fault_injector_node.injector import ACTUATOR_FAULTS, INLET_FAULTS, SENSOR_FAULTS, STICKING_FAULTS
from fdi_node.envelope.filter import go_on_to_next, take
from fdi_node.envelope.memory import Memory, Rules, memory_of, rules_in
from fdi_node.envelope.model import READING_SCALE
from fdi_node.envelope.outlet import take_outlet_temperature
from fdi_node.envelope.quiet import IS_THERE, leaves_nothing
from gimc_controller_node.envelope_compensator import COMMAND, LIMITED, WITHDRAWN, Q, accommodation
from gimc_controller_node.limited_controller import CAPS, LAST, with_k0
from gimc_controller_node.protection import move_caps
from gimc_controller_node.reference_limits import BOUNDS, bounds

DONE, CONCLUDE, LOST, GIVE_UP = range(4)
"""Why it ends: all ticks are done; there is something to conclude, once the readings have been taken; the
observer has to begin anew, once the command is known; something that is Python's from the first tick on."""
SENSE, MOVE = range(2)
"""Where in its first tick it begins: with the readings, or with the command to the actuators."""

_AIR, _CONDENSER_AIR_C = INPUT["air_mass_flow"], INPUT["condenser_air_inlet_temperature"]
SUPERHEAT_READING = 1
SOURCES = (
    *COMPILED_SOURCES,
    *("ac_plant_node.saturation", "ac_common.products", "ac_common.faults", "ac_common.signals", "ac_common.topics"),
    *("fault_injector_node", "fdi_node", "gimc_controller_node"),
    *("ac_experiments.ordinary_ticks", "ac_experiments.tick_columns"),
)
"""As `COMPILED_SOURCES` of the plant."""
_compile = step_compiler(*SOURCES)


@_compile
def _read(
    results: Array, inlets: Array, noise: Array, faults: Array, stuck: Array, curve: Array, before: Array, row: Array
) -> None:
    """Do as `FaultInjector.stick`, `measure` and `measure_inlets`."""
    saturation_c = temperature_on(curve, results[0]) if curve.size > 0 else 0.0
    for i in range(N_OUTPUTS):
        row[READINGS + i] = results[i] + noise[i]
    for fault, at in SENSOR_FAULTS:
        row[READINGS + at] += faults[fault]
    for i in range(2):
        row[INLETS_READ + i] = inlets[i] + faults[INLET_FAULTS[i]]
    for i in range(stuck.shape[0]):
        at = STICKING_FAULTS[i][1]
        more_c = saturation_c if at == SUPERHEAT_READING else 0.0
        if stuck[i] != 0.0:
            now = results[at] if at < N_OUTPUTS else inlets[at - N_OUTPUTS]
            row[STUCK + i], row[READINGS + at] = before[at] - (now + more_c), before[at] - more_c
        else:
            before[at] = row[READINGS + at] + more_c
    if curve.size > 0:
        row[READINGS + SUPERHEAT_READING] += saturation_c - temperature_on(curve, row[READINGS])


@_compile
def _tell(m: Memory, outlet: Array, row: Array, air: Array, reading: Array, told: Array) -> None:
    """Tell the observer what is read; `air`: the flow through the evaporator comes first."""
    for i in range(N_OUTPUTS):
        reading[i] = row[READINGS + i]
    if outlet.size > 0:
        take_outlet_temperature(m.out, m.scalars, outlet, reading, reading[0])
    told[AIR_C], told[_CONDENSER_AIR_C], told[_AIR] = row[INLETS_READ], row[INLETS_READ + 1], air[0]


@_compile
def _show(m: Memory, rules: Rules, thresholds: Array, row: Array, found: Array) -> None:
    """Note what the detector says, as a `Detection` has it."""
    for i in range(3):
        row[INNOVATION + i] = m.e[i] * (-READING_SCALE[i] if rules.R[i] < np.inf else -0.0)
    for i in range(2):
        row[RESIDUAL + i], found[i] = m.x[i], thresholds[i]


@_compile
def _protect(controller: Array, caps: Array, guards: Array, measured: Array) -> int:
    """Do as `FallbackController` does with its caps."""
    speed, opening = controller[LAST], controller[LAST + 1]
    capped: int = move_caps(caps, guards, measured[0], measured[1], measured[3], speed, opening)
    controller[CAPS], controller[CAPS + 1] = min(caps[0, 0], caps[2, 0]), caps[1, 0]
    return capped


@_compile
def _send(command: Array, compensator: Array, row: Array, told: Array) -> None:
    """Note q and command, and tell the command to compensator and observer."""
    for i in range(2):
        row[Q_MADE + i] = compensator[Q + i]
        row[COMMANDED + i] = compensator[COMMAND + i] = command[i]
    told[SPEED], told[OPENING] = command[0], command[1]


@_compile
def _drive(results: Array, inlets: Array, command: Array, faults: Array, air: Array, row: Array, driven: Array) -> None:
    """Do as `FaultInjector.actuate`, and note what the plant is driven by and what it makes before it is."""
    for i in range(2):
        row[ACTUATOR + i] = command[i]
    for fault, joint in ACTUATOR_FAULTS:
        row[ACTUATOR + joint] = max(row[ACTUATOR + joint] + faults[fault], 0.0)
    for i in range(N_OUTPUTS):
        row[i] = results[i]
    for i in range(2):
        row[INLETS + i], driven[i] = inlets[i], row[ACTUATOR + i]
    for i in range(READINGS - PERFORMANCE):
        row[PERFORMANCE + i] = results[N_OUTPUTS + i]
    for i in range(air.shape[0]):
        driven[2 + i] = air[i]


@_compile
def ordinary_ticks(
    first: int, last: int, stage: int, may_act: int, diagnoses: int,
    h: float, limits: Sequence[float], saturation: Array,
    flat: Array, packed: Array, reading: Array, told: Array, tables: Tables, asked: Array, thresholds: Array,
    outlet: Array, is_told_air: int,
    compensator: Array, curve: Array, n: int, accommodates: int,
    controller: Array, k0: Array, n_k0: int, air_curve: Array, caps: Array, guards: Array,
    work: Array, par: Array, sat: Array, vapour: Array, isentrope: Array, liquid: Array, grid: Array,
    driven: Array, results: Array, inlets: Array, before: Array,
    noise: Array, references: Array, faults: Array, stuck: Array, changes: Array, air: Array,
    made: Array, found: Array, said: Array,
) -> tuple[int, int]:  # fmt: skip
    """Do ticks until one is not ordinary, and return that one, or `last`, and why it ends.

    Parameters
    ----------
    first, last, stage : int
        The tick to begin with, that before which it ends, and `SENSE` or `MOVE`.
    may_act, diagnoses : int
        0: what follows from the readings is not ordinary in any case; neither observer nor compensator runs.
    h, limits, saturation : float, sequence of float, array
        Sample time; the first arguments of `bounds` after `air_curve`; `saturation_curve`, empty where the superheat is
        not derived.
    flat, packed, reading, told, tables, asked, thresholds, outlet, is_told_air
        As `EnvelopeDetector.compiled`; as its `curve`; 1: it is told the air flow through the evaporator.
    compensator, curve, n, accommodates, controller, k0, n_k0, caps, guards
        As `accommodation`, `with_k0` and `move_caps`.
    work, par, sat, vapour, isentrope, liquid, grid, driven, results
        As `ac_plant_node.plant.handed_over`.
    inlets, before : (2,) and (6,) array
        Air at both inlets as it is; as `FaultInjector.read_before`.
    noise, references, faults, stuck, changes, air : (K, .) arrays
        By tick; `changes` (K,): whether components of the plant do, or its valve is faulty.
    made, found, said : (K, .) arrays
        Results by tick: as `Loop.made`; thresholds; 1 for a limit of the compensator, 2 for withdrawn, and as
        `FallbackController.words`.
    """
    rules = rules_in(packed)
    m = memory_of(flat, rules.rows.shape[0], rules.jumping.shape[0])
    integration = views(m.work)
    for k in range(first, last):
        row, faulty, reference = made[k], faults[k], references[k]
        measured, command = row[READINGS:INLETS_READ], controller[LAST : LAST + 2]
        if k > first or stage == SENSE:
            _read(results, inlets, noise[k], faulty, stuck[k], saturation, before, row)
            if diagnoses != 0:
                _tell(m, outlet, row, air[k] if is_told_air != 0 else told[_AIR:], reading, told)
                take(m, integration, rules, reading, told, tables)
            if may_act == 0 or changes[k] != 0.0:
                return k, CONCLUDE
            if diagnoses != 0:
                if not leaves_nothing(m, rules, asked, thresholds):
                    return k, CONCLUDE
                _show(m, rules, thresholds, row, found[k])
                accommodation(
                    compensator, curve, n, m.x[0], m.x[1],
                    int(asked[IS_THERE]), int(asked[IS_THERE + 1]), 0, accommodates,
                    1, measured[0], measured[1], measured[3], 1, reference[0], reference[1],
                )  # fmt: skip
            if accommodates != 0:
                said[k, 0] = 2.0 if compensator[WITHDRAWN] != 0.0 else compensator[LIMITED]
            pressure, superheat, acts = bounds(
                air_curve, limits[0], limits[1], limits[2], reference[0], reference[1], row[INLETS_READ]
            )
            said[k, 1] = acts + BOUNDS * _protect(controller, caps, guards, measured)
            with_k0(
                controller, k0, n_k0, pressure, superheat, measured[0], measured[1],
                1, compensator[Q], compensator[Q + 1],
            )  # fmt: skip
            if np.isnan(command[0] + command[1]):
                return k, GIVE_UP
            _send(command, compensator, row, told)
            if diagnoses != 0 and go_on_to_next(m, integration, rules, told, tables) != 0:
                return k, LOST
        _drive(results, inlets, command, faulty, air[k], row, driven)
        if run_and_tell(work, par, sat, vapour, isentrope, liquid, grid, driven, h, results) != 0:
            return k, GIVE_UP
        inlets[0], inlets[1] = air[k, 1], air[k, 3]
    return last, DONE
