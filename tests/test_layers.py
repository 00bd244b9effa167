"""ROS stays at the edge: who imports rclpy or message packages is written down, and nobody else does."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = (
    *("ac_common", "ac_design", "ac_experiments", "ac_plant_node", "ac_ros_common", "bringup"),
    *("fault_injector_node", "fdi_node", "gimc", "gimc_controller_node"),
)
ROS = {"rclpy", "rcl_interfaces", "lifecycle_msgs", "diagnostic_msgs", "sensor_msgs", "std_srvs", "rosgraph_msgs"}


def imported(source: Path) -> set[str]:
    """First parts of the names of all modules that a file imports, wherever in it."""
    found = set()
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            found.add(node.module.partition(".")[0])
    return found


def is_a_shell(file: Path) -> bool:
    return file.name == "node.py" or file.name.endswith("_node.py") or file.parts[0] in ("ac_ros_common", "bringup")


def test_ros_stays_at_the_edge() -> None:
    files = [file for package in PACKAGES for file in (ROOT / package).rglob("*.py")]
    assert len(files) > 100
    with_ros = {file.relative_to(ROOT) for file in files if imported(file) & ROS}
    assert {str(file) for file in with_ros if not is_a_shell(file)} == set()


def test_mathematics_knows_nothing_of_the_rest() -> None:
    for file in (ROOT / "gimc").rglob("*.py"):
        assert not imported(file) & (set(PACKAGES) - {"gimc"}), file
