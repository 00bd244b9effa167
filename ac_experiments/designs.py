"""The designs that a scenario asks for, for the loop in one process and as files for the nodes."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ac_common.design_file import ENVELOPE, PAPER
from ac_common.topics import COMPENSATOR, CONTROLLER, FDI
from ac_design import SuperheatSensor, write_designs
from ac_design.store import DESIGNERS
from ac_experiments.scenario_schema import Scenario
from fdi_node import FdiDesign
from gimc_controller_node import CompensatorDesign, ControllerDesign
from gimc_controller_node.envelope_compensator import EnvelopeCompensatorDesign
from gimc_controller_node.making import check_controller

if TYPE_CHECKING:
    from fdi_node.envelope import EnvelopeDesign


_NODES = (FDI, CONTROLLER, COMPENSATOR)
"""In the order of the fields of `Designs`."""


@dataclass(frozen=True)
class Designs:
    """The three designs that the loop runs; replace one to try another detector, controller or compensator."""

    fdi: FdiDesign
    controller: ControllerDesign
    compensator: CompensatorDesign


@dataclass(frozen=True)
class EnvelopeDesigns:
    """The same three for the whole envelope."""

    fdi: "EnvelopeDesign"
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
    options = {"sensors": sensors, "superheat": superheat, "controller": controller}
    return Designs(*(DESIGNERS[PAPER](node, point, sample_time_s, **options) for node in _NODES))


def designs_of(scenario: Scenario) -> Designs | EnvelopeDesigns:
    """Return the designs that a scenario asks for."""
    made = tuple(design_for(node, scenario) for node in _NODES)
    return EnvelopeDesigns(*made) if scenario.design == ENVELOPE else Designs(*made)


def design_for(node: str, scenario: Scenario) -> Any:
    """Return the design of one node, one of `ac_common.design_file.DESIGNED`, that a scenario asks for."""
    return DESIGNERS[scenario.design](node, scenario.operating_point, scenario.sample_time_s, **_options(scenario))


def _options(scenario: Scenario) -> dict[str, Any]:
    """Return what a scenario says of its designs beside point and sample time."""
    if scenario.design == ENVELOPE:
        return {
            "sensors": scenario.envelope_sensors,
            "superheat": scenario.superheat_sensor,
            "air_flow": scenario.air_flow_sensor,
        }
    return {
        "sensors": scenario.design_sensors,
        "superheat": scenario.superheat_sensor,
        "controller": scenario.controller_weights,
    }


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
    point, design = scenario.operating_point, scenario.design
    return write_designs(folder, point, scenario.sample_time_s, design, **_options(scenario))
