"""The designs that a scenario asks for, for the loop in one process and as files for the nodes."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ac_common.topics import COMPENSATOR, CONTROLLER, FDI
from ac_design import ENVELOPE_CONTROLLER, SuperheatSensor, design_controller, design_of, write_designs
from ac_design.envelope import design_envelope_fdi
from ac_experiments.scenario_schema import SENSORS, Scenario
from fdi_node import FdiDesign
from fdi_node.envelope import EnvelopeDesign
from gimc_controller_node import CompensatorDesign, ControllerDesign
from gimc_controller_node.envelope_compensator import EnvelopeCompensatorDesign
from gimc_controller_node.making import check_controller


@dataclass(frozen=True)
class Designs:
    """The three designs that the loop runs; replace one to try another detector, controller or compensator."""

    fdi: FdiDesign
    controller: ControllerDesign
    compensator: CompensatorDesign


@dataclass(frozen=True)
class EnvelopeDesigns:
    """The same three for the whole envelope."""

    fdi: EnvelopeDesign
    controller: ControllerDesign
    compensator: EnvelopeCompensatorDesign


def designs_at(
    point: str,
    sample_time_s: float,
    sensors: int = 3,
    superheat: SuperheatSensor = "direct",
    controller: str = "tracking",
) -> Designs:
    """Return the designs of an operating point, "low", "med" or "high", from the cache when they are there.

    `sensors` is 3, or 2 for a detector without the wall thermocouple; `superheat` is how the superheat is measured;
    `controller` is which K0, "tracking", "paper" or "belt", with the compensator that belongs to it.
    """
    designs = (
        design_of(node, point, sample_time_s, sensors, superheat, controller) for node in (FDI, CONTROLLER, COMPENSATOR)
    )
    return Designs(*designs)  # type: ignore[arg-type]


def envelope_designs(
    point: str, sample_time_s: float, sensors: Sequence[str] = SENSORS, superheat: SuperheatSensor = "direct"
) -> EnvelopeDesigns:
    """Return the designs for the whole envelope; `point` is where the run begins, and what the safe command is from."""
    controller = design_controller(point, sample_time_s, ENVELOPE_CONTROLLER)
    return EnvelopeDesigns(
        fdi=design_envelope_fdi(sample_time_s, sensors),
        controller=controller,
        compensator=EnvelopeCompensatorDesign(**vars(controller), derived=float(superheat == "derived")),
    )


def designs_of(scenario: Scenario) -> Designs | EnvelopeDesigns:
    """Return the designs that a scenario asks for."""
    if scenario.design == "envelope":
        return envelope_designs(
            scenario.operating_point, scenario.sample_time_s, scenario.envelope_sensors, scenario.superheat_sensor
        )
    return designs_at(
        scenario.operating_point,
        scenario.sample_time_s,
        scenario.design_sensors,
        scenario.superheat_sensor,
        scenario.controller_weights,
    )


def check_controller_of(scenario: Scenario) -> None:
    """See that a controller of the user's that a scenario names can be imported, built, and works for one tick.

    Raises
    ------
    UserError
        One line: what is wrong with it.
    """
    if scenario.controller_class:
        check_controller(scenario.controller_class, designs_of(scenario).controller)


def write_designs_of(scenario: Scenario, folder: Path) -> dict[str, Path]:
    """Write the designs that a scenario asks for into `folder`, one file for each node that has one; return the files.

    Raises
    ------
    UserError
        As `ac_design.design_of`.
    RunError
        When a file cannot be written.
    """
    return write_designs(
        folder,
        scenario.operating_point,
        scenario.sample_time_s,
        sensors=scenario.design_sensors,
        superheat=scenario.superheat_sensor,
        controller=scenario.controller_weights,
    )
