"""Where the code of each node is: what ``python -m`` starts, the module of its class, its parameter file."""

from importlib.util import find_spec
from pathlib import Path

from bringup.topics import COMPENSATOR, CONTROLLER, FDI, INJECTOR, PLANT, RECORDER, SCENARIO

#: Module of each node, in the order in which they are started: the ones that take longest first.
MODULES = {
    PLANT: "ac_plant_node",
    SCENARIO: "bringup.scenario_node",
    FDI: "fdi_node",
    COMPENSATOR: "gimc_controller_node.compensator_node",
    CONTROLLER: "gimc_controller_node",
    INJECTOR: "fault_injector_node",
    RECORDER: "bringup.recorder_node",
}


def module_of(start: str) -> str:
    """Module in which a node's class is, given what ``python -m`` starts."""
    return start if start.endswith("_node") and "." in start else f"{start}.node"


def parameter_file(module: str) -> Path:
    """Where the parameter file of a node is, given what `python -m` starts: beside the module that holds its code."""
    spec = find_spec(module)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(module)
    origin = Path(spec.origin)
    return origin.with_name("node.yaml") if origin.name == "__init__.py" else origin.with_suffix(".yaml")
