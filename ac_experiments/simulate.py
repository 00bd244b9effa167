"""The whole loop in one process, without ROS: the same step functions as the nodes, in the order of one tick.

Tick k: plant outputs -> injector (sensor faults, noise) -> detector -> compensator -> controller -> injector (faults of
actuators and components) -> plant. The graph of processes calls exactly these functions in this order, so both give the
same numbers.
"""

import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from operator import attrgetter, itemgetter
from struct import Struct
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ac_common.errors import RunError
from ac_common.faults import COMPONENT_KINDS, ISOLABLE_KINDS, KINDS, STICKING, STUCK_JOINTS
from ac_common.fdi_status import StatusRow
from ac_common.health import AS_USUAL
from ac_common.signals import CarSide, Inlets, Innovation, Measurement, PlantOutput, Reference, topics_of
from ac_common.topics import (
    AIR_SIDE,
    BY_NAME,
    CABIN_SERIES,
    CAR_SERIES,
    COMPENSATOR,
    CONTROLLER,
    PERFORMANCE_SERIES,
    SERIES,
    residual_of,
    schedule_of,
    truth_of,
)
from ac_experiments.designs import Designs, EnvelopeDesigns, check_controller_of, designs_of
from ac_experiments.recording import Recording
from ac_experiments.scenario import Schedule, cabin_of, schedule
from ac_experiments.scenario_schema import Scenario
from ac_experiments.versions import versions

if TYPE_CHECKING:
    from gimc_controller_node.protection import ProtectionLimits

Progress = Callable[[int, int], None]

#: Ticks between two calls of the progress function.
PROGRESS_EVERY = 200

_ACTUATORS = tuple(BY_NAME["controller/command"].joints)
#: Series that a tick of the loop makes, in the order in which `_Loop.tick` gives them.
_MADE = (
    *topics_of("plant", PlantOutput),
    *topics_of("plant", Inlets),
    *PERFORMANCE_SERIES,
    *topics_of("measured", Measurement),
    *topics_of("measured", Inlets),
    *topics_of("fdi/innovation", Innovation),
    *(residual_of(kind) for kind in ISOLABLE_KINDS),
    *(f"compensator/q:{joint}" for joint in _ACTUATORS),
    *(f"controller/command:{joint}" for joint in _ACTUATORS),
    *(f"actuator/command:{joint}" for joint in _ACTUATORS),
    *BY_NAME["component/faults"].series,
    *(truth_of(fault.kind) for fault in STICKING),
)
_sticking = itemgetter(*(KINDS.index(fault.kind) for fault in STICKING))


def simulate(
    scenario: Scenario,
    passive: bool | None = None,
    progress: Progress | None = None,
    designs: Designs | EnvelopeDesigns | None = None,
    limits: "ProtectionLimits | None" = None,
) -> Recording:
    """Run `scenario` on the nonlinear plant.

    Parameters
    ----------
    scenario
        What to run.
    passive
        True: K0 alone, the compensator stays silent. None: as the scenario says.
    progress
        Called now and then with the ticks done and the ticks in all.
    designs
        What to run instead of the designs of the scenario's operating point.
    limits
        Of the protection, instead of its own.

    Returns
    -------
    Recording
        Every signal of the loop, as if read back from a bag; mode ``simulate``. A topic that no step function makes is
        missing.

    Raises
    ------
    RunError
        When the plant leaves the domain of its model.
    ValueError
        When the compensator is to act with two sensors.
    """
    passive = scenario.is_passive(passive)
    loop = _Loop(scenario, designs or designs_of(scenario), limits, accommodate=not passive)
    plan, ticks = loop.schedule, scenario.ticks
    keys = _MADE if scenario.car is None else (*_MADE, *CABIN_SERIES)
    made, row = np.empty((ticks, len(keys))), Struct(f"{len(keys)}d")
    times, faults, air, stuck = plan.time_s.tolist(), plan.faults.tolist(), plan.air.tolist(), plan.stuck.tolist()
    car = plan.car.tolist()
    started = time.perf_counter()
    for k, reference in enumerate(plan.reference):
        values = loop.tick(times[k], reference, loop.stick(faults[k], stuck[k]), car[k], air[k])
        row.pack_into(made, k * row.size, *values)  # faster than an assignment
        try:
            loop.advance(air[k], car[k])
        except ValueError as problem:
            msg = f"{scenario.name}: the plant stopped at {times[k]:.1f} s: {problem}"
            raise RunError(msg) from problem
        if progress is not None and k % PROGRESS_EVERY == 0:
            progress(k, ticks)
    if progress is not None:
        progress(ticks, ticks)
    return Recording(
        time_s=plan.time_s,
        series=_series(dict(zip(keys, made.T, strict=True)), plan),
        status=loop.status,
        metadata={
            "scenario": scenario.model_dump(mode="json"),
            "mode": "simulate",
            "passive": passive,
            "sample_time_s": scenario.sample_time_s,
            "started": datetime.now(UTC).isoformat(timespec="seconds"),
            "wall_seconds": time.perf_counter() - started,
            "missed_ticks": 0,
            "events": loop.events,
            "restarts": [],
            "complete": True,
            "software": versions(),
        },
    )


class _Loop:
    """The blocks of the loop, what flows between them from one tick to the next, and what they announce.

    Attributes
    ----------
    schedule : Schedule
    status : list of StatusRow
    events : list of dict
    """

    def __init__(
        self,
        scenario: Scenario,
        designs: Designs | EnvelopeDesigns,
        limits: "ProtectionLimits | None",
        *,
        accommodate: bool,
    ) -> None:
        # Imported here: these compile or load designs, and the command line must answer --help at once.
        from ac_plant_node import Plant, operating_point
        from ac_plant_node.car import Car
        from fault_injector_node.injector import FaultInjector, components
        from fdi_node.making import knows_air_flow, make_detector
        from gimc_controller_node.accommodation import make_compensator
        from gimc_controller_node.making import make_controller
        from gimc_controller_node.protection import limits_for

        check_controller_of(scenario)

        rest = operating_point(scenario.operating_point)
        self.status: list[StatusRow] = []
        self.events: list[dict[str, Any]] = []
        self._sample_time_s = scenario.sample_time_s
        plant = Plant.at(scenario.operating_point)
        self.schedule = schedule(scenario, plant.inputs, rest.outputs)
        self._car = Car(scenario.operating_point, cabin_of(scenario.car)) if scenario.car is not None else None
        self._plant: Plant | Car = self._car or plant
        self._inputs = np.concatenate([plant.inputs, self.schedule.car[0]])
        self._reading = np.empty(len(Innovation._fields))
        self._components_of = components
        self._injector = FaultInjector(scenario.noise.std, scenario.noise.seed, scenario.superheat_sensor)
        self._detector, told = make_detector(designs.fdi)
        self._reads, self._reads_inlets = told.readings, told.inlets
        self._reads_air = int(knows_air_flow(designs.fdi))
        self._compensator, kind = make_compensator(designs.compensator, accommodate)
        self._signal = attrgetter(kind.reads)
        self._controller = make_controller(
            designs.controller,
            scenario.controller_class,
            limits or limits_for(has_belt=scenario.has_belt, measures_head=scenario.measures_head),
        )
        self._outputs: list[float] = (rest if self._car is None else self._car).outputs.tolist()
        # The plant reports the inlet temperatures that acted until now: those held over the sample just past.
        acted = self._inputs if self._car is None else self._car.acted
        self._inlets = (float(acted[3]), float(acted[5]))
        self._components = (0.0,) * len(COMPONENT_KINDS)
        self._faults: Sequence[float] = [0.0] * len(KINDS)
        self._does = {COMPENSATOR: "", CONTROLLER: ""}

    def stick(self, faults: Sequence[float], stuck: Sequence[float]) -> Sequence[float]:
        """Return the faults of this tick with what the readings that stand still are off by."""
        return self._injector.stick(self._outputs, self._inlets, faults, stuck)

    def tick(
        self,
        time_s: float,
        reference: NDArray[np.float64],
        faults: Sequence[float],
        car: Sequence[float],
        air: Sequence[float],
    ) -> tuple[float, ...]:
        """Go around the loop once; return the values of `_MADE`, and with a car those of `CABIN_SERIES`."""
        outputs, actual_inlets = self._outputs, self._inlets
        measured, inlets = self._injector.measure(outputs, faults), self._injector.measure_inlets(actual_inlets, faults)
        known = (*inlets[: self._reads_inlets], *air[: self._reads_air])
        found = self._detector.observe(time_s, measured[: self._reads], *known)
        q = self._compensator.step(
            self._signal(found), found.isolated, found.also_isolated, reference.tolist(), measured
        )
        reading = self._reading
        reading[0], reading[1], reading[2] = measured[:3]
        if car:
            self._controller.drive(CarSide(*car).belt_speed)
        command = self._controller.step(reference, reading, q, inlets[0], measured[3])
        commanded = command.tolist()
        self._detector.commanded(commanded)
        self._compensator.commanded(commanded)
        if self._compensator.does != self._does[COMPENSATOR]:
            self._announce(time_s, COMPENSATOR, self._compensator.does)
        if self._controller.does != self._does[CONTROLLER]:
            self._announce(time_s, CONTROLLER, self._controller.does)
        actuator = self._injector.actuate(commanded, faults)
        self._inputs[0], self._inputs[1] = actuator
        if faults != self._faults:
            self._faults, sizes = faults, self._components_of(faults)
            if sizes != self._components:
                self._components = sizes
                self._plant.hold_faults(sizes)
        self.status.append(found.status(time_s))
        seen = (*measured, *inlets, *found.innovation, *found.residual)
        told = (*actual_inlets, *self._plant.performance)
        cabin = () if self._car is None else self._car.cabin
        acted = (*q.tolist(), *commanded, *actuator)
        return (*outputs, *told, *seen, *acted, *self._components, *_sticking(faults), *cabin)

    def advance(self, air: Sequence[float], car: Sequence[float]) -> None:
        """Let the plant run on to the next tick with the actuators as they are; raises ValueError when it cannot."""
        self._inputs[2:] = (*air, *car)
        self._outputs = self._plant.step(self._inputs, self._sample_time_s).tolist()
        self._inlets = (air[1], air[3])
        if self._car is not None:
            self._inlets = (float(self._car.acted[3]), float(self._car.acted[5]))

    def _announce(self, time_s: float, node: str, does: str) -> None:
        self._does[node] = does
        self.events.append({"time_s": time_s, "node": node, "what": does or AS_USUAL})


def _series(made: dict[str, NDArray[np.float64]], plan: Schedule) -> dict[str, NDArray[np.float64]]:
    """Return all recorded series, in their usual order: what the loop has made, and what was played to it."""
    columns = made | dict(zip(CAR_SERIES, plan.car.T, strict=False))  # none without a car
    columns |= dict(zip(topics_of("reference", Reference), plan.reference.T, strict=True))
    columns |= dict(zip([BY_NAME[topic].series[0] for topic in AIR_SIDE], plan.air.T, strict=True))
    for kind, sizes in zip(KINDS, plan.faults.T, strict=True):
        columns[schedule_of(kind)] = sizes
        columns.setdefault(truth_of(kind), sizes)
    columns |= {schedule_of(joint): stuck for joint, stuck in zip(STUCK_JOINTS, plan.stuck.T, strict=True)}
    return {key: columns[key].copy() for key in (*SERIES, *CAR_SERIES, *CABIN_SERIES) if key in columns}
