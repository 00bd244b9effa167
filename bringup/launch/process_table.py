"""The processes of a graph as a table: what starts each node, when, and what it needs beside its parameters."""

from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from ac_common.topics import COMPENSATOR, CONTROLLER, FDI, INJECTOR, PLANT, RECORDER, SCENARIO


@dataclass(frozen=True)
class NodeProcess:
    """The process of one node.

    Attributes
    ----------
    name : of the node, as in ``ros2 node list``.
    module : what ``python -m`` starts.
    activated : its place in the order of activation.
    keeps_memory : it writes down what it knows, for the process that takes its place after a crash.
    is_restarted : on the wall clock it is started again when it dies; else its death ends the run.
    """

    name: str
    module: str
    activated: int
    keeps_memory: bool = False
    is_restarted: bool = True

    @property
    def has_design(self) -> bool:
        """Whether it loads a design file."""
        from ac_common.design_file import DESIGNED  # heavier than help may be

        return self.name in DESIGNED

    @property
    def class_module(self) -> str:
        """Return the module that holds the node's class and its parameters."""
        return self.module if "." in self.module else f"{self.module}.node"

    @property
    def parameter_file(self) -> Path:
        """Return the file of the node's default parameters: beside the module that holds its code."""
        spec = find_spec(self.module)
        if spec is None or spec.origin is None:
            raise ModuleNotFoundError(self.module)
        origin = Path(spec.origin)
        return origin.with_name("node.yaml") if origin.name == "__init__.py" else origin.with_suffix(".yaml")


#: In the order in which they are started: the ones that take longest first. The plant sets the pace for all, so it is
#: activated last: everyone else must be listening by then.
PROCESSES = {
    process.name: process
    for process in (
        NodeProcess(PLANT, "ac_plant_node", activated=7, is_restarted=False),
        NodeProcess(SCENARIO, "bringup.nodes.scenario", activated=6),
        NodeProcess(FDI, "fdi_node", activated=4, keeps_memory=True),
        NodeProcess(COMPENSATOR, "gimc_controller_node.compensator_node", activated=3, keeps_memory=True),
        NodeProcess(CONTROLLER, "gimc_controller_node", activated=2),
        NodeProcess(INJECTOR, "fault_injector_node", activated=5),
        NodeProcess(RECORDER, "bringup.nodes.recorder", activated=1),
    )
}
ACTIVATION_ORDER = tuple(sorted(PROCESSES, key=lambda name: PROCESSES[name].activated))
#: The nodes of the loop in the order of its signals: what a user's node may replace, and what a recording can replay.
#: What is recorded, and how, stays acftc's.
LOOP_NODES = (PLANT, INJECTOR, FDI, COMPENSATOR, CONTROLLER, SCENARIO)
