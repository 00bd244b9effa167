"""The whole loop in one process, without ROS: the same step functions as the nodes, in the order of one tick.

Tick k: plant outputs -> injector (f_p, noise) -> detector -> compensator -> controller -> injector (f_N) -> plant. The
graph of processes calls exactly these functions in this order, so both give the same numbers.
"""

import time
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ac_common.errors import RunError
from ac_common.fdi_status import StatusRow
from ac_common.health import AS_USUAL
from ac_common.topics import COMPENSATOR, CONTROLLER, SERIES
from ac_experiments.designs import Designs, check_controller_of, designs_of
from ac_experiments.recording import Recording
from ac_experiments.scenario import program
from ac_experiments.scenario_schema import Scenario
from ac_experiments.versions import versions

Progress = Callable[[int, int], None]

#: Ticks between two calls of the progress function.
PROGRESS_EVERY = 200


def simulate(
    scenario: Scenario,
    passive: bool | None = None,
    progress: Progress | None = None,
    designs: Designs | None = None,
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

    Returns
    -------
    Recording
        Every signal of the loop, as if read back from a bag; mode ``simulate``.

    Raises
    ------
    RunError
        When the plant leaves the domain of its model.
    ValueError
        When the compensator is to act with two sensors.
    """
    # Imported here: these compile or load designs, and the command line must answer --help at once.
    from ac_plant_node import Plant, operating_point
    from fault_injector_node.injector import FaultInjector
    from fdi_node import FaultDetector
    from gimc_controller_node import Compensator
    from gimc_controller_node.making import make_controller

    passive = scenario.is_passive(passive)
    point, sample_time_s, ticks = scenario.operating_point, scenario.sample_time_s, scenario.ticks
    rest = operating_point(point)
    plan = program(scenario, rest.inputs, rest.outputs)
    plant = Plant.at(point)
    injector = FaultInjector(scenario.noise.std, scenario.noise.seed, scenario.superheat_sensor)
    if designs is None:
        designs = designs_of(scenario)
    detector = FaultDetector(designs.fdi)
    compensator = Compensator(designs.compensator, accommodate=not passive)
    check_controller_of(scenario)
    controller = make_controller(designs.controller, scenario.controller_class)
    compensator_does, controller_does = "", ""
    events: list[dict[str, Any]] = []

    log = {key: np.empty((ticks, width)) for key, width in _WIDTHS.items()}
    plant_log, air_log, measured_log, innovation_log = (
        log[key] for key in ("outputs", "air_inlet", "measured", "innovation")
    )
    residual_log, q_log, command_log = (log[key] for key in ("residual", "q", "command"))
    inputs_log = np.hstack([np.empty((ticks, 2)), plan.air])
    status: list[StatusRow] = []
    first, second = designs.fdi.thresholds.tolist()
    thresholds = (first, second)
    times, faults, inlets = plan.time_s.tolist(), plan.faults.tolist(), plan.air[:, 1].tolist()
    outputs = rest.outputs
    # The plant reports the inlet temperature that acted until now: the one held over the sample just past.
    air_inlet_temperature_c = float(rest.inputs[3])
    started = time.perf_counter()
    for k, (reference, inputs) in enumerate(zip(plan.reference, inputs_log, strict=True)):
        time_s, (f_n, f_p) = times[k], faults[k]
        measured = injector.measure(outputs[:3], f_p)
        found = detector.observe(time_s, measured, air_inlet_temperature_c)
        q = compensator.step(found.innovation, found.isolated, found.also_isolated, tuple(reference.tolist()))
        command = controller.step(reference, measured, q)
        detector.commanded(command)
        if (does := compensator.does) != compensator_does:
            compensator_does = does
            events.append({"time_s": time_s, "node": COMPENSATOR, "what": compensator_does or AS_USUAL})
        if (does := controller.does) != controller_does:
            controller_does = does
            events.append({"time_s": time_s, "node": CONTROLLER, "what": controller_does or AS_USUAL})
        actuator = injector.actuate(command, f_n)

        plant_log[k] = outputs
        air_log[k] = air_inlet_temperature_c
        measured_log[k] = measured
        innovation_log[k] = found.innovation
        residual_log[k] = found.residual
        q_log[k] = q
        command_log[k] = command
        _, _, _, detected, isolated, size, onset_s, isolated_s, also_isolated = found
        status.append(StatusRow(time_s, detected, isolated, size, onset_s, isolated_s, thresholds, also_isolated))

        inputs[:2] = actuator
        air_inlet_temperature_c = inlets[k]
        try:
            outputs = plant.step(inputs, sample_time_s)
        except ValueError as problem:
            msg = f"{scenario.name}: the plant stopped at {time_s:.1f} s: {problem}"
            raise RunError(msg) from problem
        if progress is not None and k % PROGRESS_EVERY == 0:
            progress(k, ticks)
    if progress is not None:
        progress(ticks, ticks)

    log["actuator"] = inputs_log[:, :2]
    log["reference"], log["air"], log["faults"] = plan.reference, plan.air, plan.faults
    return Recording(
        time_s=plan.time_s,
        series=_as_series(log),
        status=status,
        metadata={
            "scenario": scenario.model_dump(mode="json"),
            "mode": "simulate",
            "passive": passive,
            "sample_time_s": sample_time_s,
            "started": datetime.now(UTC).isoformat(timespec="seconds"),
            "wall_seconds": time.perf_counter() - started,
            "missed_ticks": 0,
            "events": events,
            "restarts": [],
            "complete": True,
            "software": versions(),
        },
    )


#: Columns of each logged array.
_WIDTHS = {
    "outputs": 4,
    "air_inlet": 1,
    "measured": 3,
    "innovation": 3,
    "residual": 2,
    "q": 2,
    "command": 2,
}

#: Which column of which logged array a recorded series is.
_COLUMNS = {
    "plant/evaporator_pressure": ("outputs", 0),
    "plant/superheat": ("outputs", 1),
    "plant/wall_temperature": ("outputs", 2),
    "plant/condenser_pressure": ("outputs", 3),
    "plant/air_inlet_temperature": ("air_inlet", 0),
    "measured/evaporator_pressure": ("measured", 0),
    "measured/superheat": ("measured", 1),
    "measured/wall_temperature": ("measured", 2),
    "reference/evaporator_pressure": ("reference", 0),
    "reference/superheat": ("reference", 1),
    "scenario/air:evaporator_air": ("air", 0),
    "scenario/air_inlet_temperature": ("air", 1),
    "scenario/fault/compressor_speed:compressor": ("faults", 0),
    "scenario/fault/evaporator_pressure": ("faults", 1),
    "controller/command:compressor": ("command", 0),
    "controller/command:expansion_valve": ("command", 1),
    "actuator/command:compressor": ("actuator", 0),
    "actuator/command:expansion_valve": ("actuator", 1),
    "fdi/innovation/evaporator_pressure": ("innovation", 0),
    "fdi/innovation/superheat": ("innovation", 1),
    "fdi/innovation/wall_temperature": ("innovation", 2),
    "fdi/residual/compressor_speed:compressor": ("residual", 0),
    "fdi/residual/evaporator_pressure": ("residual", 1),
    "compensator/q:compressor": ("q", 0),
    "compensator/q:expansion_valve": ("q", 1),
    "fault/compressor_speed:compressor": ("faults", 0),
    "fault/evaporator_pressure": ("faults", 1),
}


def _as_series(log: dict[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
    return {key: log[_COLUMNS[key][0]][:, _COLUMNS[key][1]].copy() for key in SERIES}
