"""Designs for nodes that a test starts by itself."""

from pathlib import Path

from ac_design import write_designs
from bringup.launch.process_table import PROCESSES


def design_parameters(name: str, folder: Path, design: str = "paper") -> dict[str, str]:
    """Parameters that name the design of a node at the medium point, written into `folder`; none if it needs none."""
    if not PROCESSES[name].has_design:
        return {}
    return {"design_file": str(write_designs(folder, "med", 0.1, design)[name])}
