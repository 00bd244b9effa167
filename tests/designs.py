"""Design files for nodes that a test starts by themselves."""

from pathlib import Path

from ac_common.design_file import DESIGNED
from ac_design import write_designs


def design_parameters(node: str, folder: Path) -> dict[str, str]:
    """Parameters that give a node its design at the medium operating point; none for a node that has none."""
    return {"design_file": str(write_designs(folder, "med", 0.1)[node])} if node in DESIGNED else {}
