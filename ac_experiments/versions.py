"""What a run was made with: versions of what its numbers can depend on."""

import os
import platform
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_PACKAGES = ("acftc", "numpy", "numba", "CoolProp", "ros-jazzy-rclpy", "ros-fastrtps")


def plant() -> str:
    """Return which plant's parameters are in use: the file they are from, and a hash of what it says."""
    from ac_plant_node import load_parameters

    parameters = load_parameters()
    return f"{Path(parameters.source).name} {parameters.identity}"


def same_plant(made_with: Mapping[str, str]) -> bool:
    """Return whether a recording made with `versions()` was of the plant in use now; recordings of old did not say."""
    return made_with.get("plant", plant()).split()[-1] == plant().split()[-1]


def versions() -> dict[str, str]:
    """Return the versions of this program, of Python and of the packages under it, and the kind of machine."""
    return {
        **_installed(),
        "plant": plant(),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} processors",
    }


@cache
def _installed() -> dict[str, str]:
    found = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
