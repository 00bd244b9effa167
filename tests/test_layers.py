"""What the import contracts cannot see: where ROS and its private names may be, and how long things are.

Which package may import which is in pyproject.toml (import-linter).
"""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = (
    *("ac_common", "ac_design", "ac_experiments", "ac_plant_node", "ac_ros_common", "bringup"),
    *("fault_injector_node", "fdi_node", "gimc", "gimc_controller_node"),
)
ROS = {"rclpy", "rcl_interfaces", "lifecycle_msgs", "diagnostic_msgs", "sensor_msgs", "std_srvs", "rosgraph_msgs"}
FILES = sorted(file.relative_to(ROOT) for package in PACKAGES for file in (ROOT / package).rglob("*.py"))

#: The one file that touches what rclpy keeps to itself, and how that is told: modules, and attributes of its classes.
PRIVATE = Path("ac_ros_common/_rclpy.py")
PRIVATE_MODULES = ("rclpy.impl", "rclpy._rclpy_pybind11")
PRIVATE_NAMES = ("_state_machine", "_LifecycleNodeMixin", "_LifecycleNode__", "_Node__", "_Executor__")

#: Longest in lines: a class, a function, a file.
LONGEST_CLASS, LONGEST_FUNCTION, LONGEST_FILE = 250, 80, 450
#: Numerics that are compiled, where a call between functions may cost, are as long as they must be.
COMPILED = Path("ac_plant_node/dynamics")


def parsed(file: Path) -> ast.Module:
    return ast.parse((ROOT / file).read_text(encoding="utf-8"))


def imported(file: Path) -> set[str]:
    """Names of all modules that a file imports, wherever in it."""
    found = set()
    for node in ast.walk(parsed(file)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            found.add(node.module)
    return found


def first_parts(file: Path) -> set[str]:
    return {name.partition(".")[0] for name in imported(file)}


def is_a_shell(file: Path) -> bool:
    return file.name == "node.py" or file.name.endswith("_node.py") or file.parts[0] in ("ac_ros_common", "bringup")


def too_long(file: Path) -> Iterator[str]:
    """What in a file is longer than allowed."""
    lines = len((ROOT / file).read_text(encoding="utf-8").splitlines())
    if lines > LONGEST_FILE:
        yield f"{file}: {lines} lines"
    for node in ast.walk(parsed(file)):
        if isinstance(node, ast.ClassDef):
            longest = LONGEST_CLASS
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and COMPILED not in file.parents:
            longest = LONGEST_FUNCTION
        else:
            continue
        assert node.end_lineno is not None
        length = node.end_lineno - node.lineno + 1
        if length > longest:
            yield f"{file}:{node.lineno}: {node.name} has {length} lines, allowed are {longest}"


def test_ros_stays_at_the_edge() -> None:
    assert len(FILES) > 100
    assert {str(file) for file in FILES if first_parts(file) & ROS and not is_a_shell(file)} == set()


def test_mathematics_knows_nothing_of_the_rest() -> None:
    for file in FILES:
        assert file.parts[0] != "gimc" or not first_parts(file) & (set(PACKAGES) - {"gimc"}), file


def private_uses(file: Path) -> list[str]:
    found = [name for name in imported(file) if name.startswith(PRIVATE_MODULES)]
    for node in ast.walk(parsed(file)):
        name = getattr(node, "attr", None) or getattr(node, "name", None)
        if isinstance(name, str) and name.startswith(PRIVATE_NAMES):
            found.append(name)
    return found


@pytest.mark.parametrize("file", [file for file in FILES if file != PRIVATE], ids=str)
def test_private_names_of_rclpy_are_in_one_file(file: Path) -> None:
    assert private_uses(file) == []


def test_the_one_file_has_them() -> None:
    assert {"rclpy.impl.implementation_singleton", "_state_machine"} <= set(private_uses(PRIVATE))


@pytest.mark.parametrize("file", FILES, ids=str)
def test_nothing_is_longer_than_it_may_be(file: Path) -> None:
    assert list(too_long(file)) == []
