"""What a run was made with: versions of what its numbers can depend on."""

import os
import platform
from importlib.metadata import PackageNotFoundError, version

_PACKAGES = ("acftc", "numpy", "numba", "CoolProp", "ros-jazzy-rclpy", "ros-fastrtps")


def software() -> dict[str, str]:
    """Versions of this program, of Python and of the packages under it, and the kind of machine."""
    found = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return {**found, "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} processors"}
