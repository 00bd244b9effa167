"""For colcon only, which looks for this file; what is said here stands in pyproject.toml and setup.cfg."""

import tomllib
from pathlib import Path

from setuptools import find_packages, setup

SOURCE = Path(__file__).resolve().parent


def from_pyproject():
    """Return what pyproject.toml says; `colcon build --symlink-install` builds where that file is not."""
    with (SOURCE / "pyproject.toml").open("rb") as file:
        content = tomllib.load(file)
    project = content["project"]
    return {
        "name": project["name"],
        "version": project["version"],
        "python_requires": project["requires-python"],
        "packages": find_packages(**content["tool"]["setuptools"]["packages"]["find"]),
        "package_data": content["tool"]["setuptools"]["package-data"],
        "entry_points": {"console_scripts": [f"{name} = {where}" for name, where in project["scripts"].items()]},
    }


distribution = setup(
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/acftc"]),
        ("share/acftc", ["package.xml"]),
        ("share/acftc/launch", ["launch/loop.launch.xml"]),
    ],
    **({} if Path("pyproject.toml").exists() else from_pyproject()),
)
# colcon reads the attributes of the distribution back as literals, which a version specifier is not.
distribution.python_requires = str(distribution.python_requires)
distribution.metadata.python_requires = str(distribution.metadata.python_requires)
