"""The blocks of the loop in one process, and one tick of it: the step functions of the nodes, in their order."""

from collections.abc import Callable, Sequence
from operator import attrgetter, itemgetter
from struct import Struct
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ac_common.errors import RunError
from ac_common.faults import COMPONENT_KINDS, ISOLABLE_KINDS, KINDS, STICKING, STUCK_JOINTS
from ac_common.fdi_status import StatusRow
from ac_common.health import AS_USUAL
from ac_common.signals import CarSide, Inlets, Innovation, Measurement, Reference, topics_of
from ac_common.topics import (
    AIR_SIDE,
    BY_NAME,
    CABIN_SERIES,
    CAR_SERIES,
    COMPENSATOR,
    CONTROLLER,
    SERIES,
    schedule_of,
    truth_of,
)
from ac_experiments.designs import Designs, EnvelopeDesigns, check_controller_of
from ac_experiments.scenario import Schedule, cabin_of, schedule
from ac_experiments.scenario_schema import Scenario
from ac_experiments.tick_columns import DIAGNOSED, MADE

if TYPE_CHECKING:
    from fdi_node.detector import Detection
    from gimc_controller_node.protection import ProtectionLimits

Progress = Callable[[int, int], None]

#: Ticks between two calls of the progress function.
PROGRESS_EVERY = 1000

#: What a detector that does not run says.
_NOTHING = (Innovation(0.0, 0.0, 0.0), (0.0,) * len(ISOLABLE_KINDS), (np.nan,) * len(ISOLABLE_KINDS), False, None)
_sticking = itemgetter(*(KINDS.index(fault.kind) for fault in STICKING))


class Loop:
    """The blocks of the loop, what flows between them from one tick to the next, and what they announce.

    Attributes
    ----------
    schedule : Schedule
    made : ndarray, shape (K, n)
        What a tick makes, of `MADE` and with a car of `CABIN_SERIES`.
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
        diagnose: bool = True,
    ) -> None:
        # Imported here: these compile or load designs, and the command line must answer --help at once.
        from ac_plant_node import Plant, operating_point
        from ac_plant_node.car import Car
        from fault_injector_node.injector import FaultInjector, components
        from fdi_node.detector import Detection
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
        self._unseen = None if diagnose else Detection(*_NOTHING, np.nan, np.nan, np.nan)
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
        self._name, plan = scenario.name, self.schedule
        self._times: list[float] = plan.time_s.tolist()
        keys = self._keys = MADE if scenario.car is None else (*MADE, *CABIN_SERIES)
        self.made, self._row = np.empty((scenario.ticks, len(keys))), Struct(f"{len(keys)}d")

    @property
    def series(self) -> dict[str, NDArray[np.float64]]:
        """Return all that is recorded, by name."""
        made = dict(zip(self._keys, self.made.T, strict=True))
        for key in DIAGNOSED if self._unseen else ():
            del made[key]
        return _series(made, self.schedule)

    def run(self, progress: Progress) -> None:
        """Do all ticks.

        Raises
        ------
        RunError
            When the plant leaves the domain of its model.
        """
        for k in range(len(self.made)):
            self.tick(k)
            if k % PROGRESS_EVERY == 0:
                progress(k, len(self.made))
        progress(len(self.made), len(self.made))

    def tick(self, k: int) -> None:
        """Go around the loop once; raises as `run`."""
        outputs, air = self._outputs, self._inlets
        plan = self.schedule
        faults = self._injector.stick(outputs, air, plan.faults[k].tolist(), plan.stuck[k].tolist())
        measured, inlets = self._injector.measure(outputs, faults), self._injector.measure_inlets(air, faults)
        found = self._unseen
        if found is None:
            known = (*inlets[: self._reads_inlets], *plan.air[k, : self._reads_air].tolist())
            found = self._detector.observe(self._times[k], measured[: self._reads], *known)
        self._act(k, faults, measured, inlets, found)

    def _act(self, k: int, faults: Sequence[float], measured: Measurement, inlets: Inlets, found: "Detection") -> None:
        """Do what follows from the readings of a tick, and let the plant run on to the next one."""
        time_s, reference, car = self._times[k], self.schedule.reference[k], self.schedule.car[k].tolist()
        acted_on, is_unsure = found.acted_on, bool(found.unsure)
        q = self._compensator.step(self._signal(found), *acted_on, reference.tolist(), measured, is_unsure)
        reading = self._reading
        reading[0], reading[1], reading[2] = measured[:3]
        if car:
            self._controller.drive(CarSide(*car).belt_speed)
        command = self._controller.step(reference, reading, q, inlets[0], measured[3])
        commanded = command.tolist()
        if self._unseen is None:
            self._detector.commanded(commanded)
            self.status.append(found.status(time_s))
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
        seen = (*measured, *inlets, *found.innovation, *found.residual)
        told = (*self._inlets, *self._plant.performance)
        cabin = () if self._car is None else self._car.cabin
        acted = (*q.tolist(), *commanded, *actuator)
        made = (*self._outputs, *told, *seen, *acted, *self._components, *_sticking(faults), *cabin)
        self._row.pack_into(self.made, k * self._row.size, *made)  # faster than an assignment
        try:
            self._advance(self.schedule.air[k].tolist(), car)
        except ValueError as problem:
            msg = f"{self._name}: the plant stopped at {time_s:.1f} s: {problem}"
            raise RunError(msg) from problem

    def _advance(self, air: Sequence[float], car: Sequence[float]) -> None:
        """Let the plant run on with the actuators as they are; raises ValueError when it cannot."""
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
