"""The whole loop in one process, without ROS: the same step functions as the nodes, in the order of one tick.

Tick k: plant outputs -> injector (sensor faults, noise) -> detector -> compensator -> controller -> injector (faults of
actuators and components) -> plant. The graph of processes calls exactly these functions in this order, so both give the
same numbers.
"""

import time
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from ac_experiments.designs import Designs, EnvelopeDesigns, designs_of
from ac_experiments.loop import Loop, Progress
from ac_experiments.recording import Recording
from ac_experiments.scenario_schema import Scenario
from ac_experiments.versions import versions

if TYPE_CHECKING:
    from gimc_controller_node.protection import ProtectionLimits


def simulate(
    scenario: Scenario,
    passive: bool | None = None,
    progress: Progress | None = None,
    designs: Designs | EnvelopeDesigns | None = None,
    limits: "ProtectionLimits | None" = None,
    diagnose: bool = True,
    compile_loop: bool = True,
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
    diagnose
        False: neither detector nor compensator runs. K0 is alone, and all that it does is as in a passive run, to the
        last bit; what those two make is missing. With the designs of the whole envelope most of the time is saved.

    compile_loop
        False: the loop is compiled as a whole, which takes a processor for ten seconds, only where that has been done
        before. Else its steps are called one by one: a second more for a run of 900 s, and the same numbers.

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
    passive = scenario.is_passive(passive) or not diagnose
    designs = designs or designs_of(scenario)
    started = time.perf_counter()
    options = {"limits": limits, "accommodate": not passive, "diagnose": diagnose}
    loop = _played(scenario, designs, progress or (lambda *_: None), options, compile_loop)
    return Recording(
        time_s=loop.schedule.time_s,
        series=loop.series,
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


def _played(
    scenario: Scenario,
    designs: Designs | EnvelopeDesigns,
    progress: Progress,
    options: dict[str, Any],
    compile_loop: bool,
) -> Loop:
    """Return the loop after all its ticks; `options` are those of `Loop`."""
    if isinstance(designs, EnvelopeDesigns):
        from ac_experiments.compiled_loop import CompiledLoop, is_compiled  # load the compiler

        if compile_loop or is_compiled():
            compiled = CompiledLoop(scenario, designs, **options)
            if compiled.run_compiled(progress):
                return compiled
    loop = Loop(scenario, designs, **options)
    loop.run(progress)
    return loop
