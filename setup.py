"""For colcon only, which looks for this file; everything is said in pyproject.toml and setup.cfg."""

from setuptools import setup

distribution = setup(
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/acftc"]),
        ("share/acftc", ["package.xml"]),
    ]
)
# colcon reads the attributes of the distribution back as literals, which a version specifier is not.
distribution.python_requires = str(distribution.python_requires)
distribution.metadata.python_requires = str(distribution.metadata.python_requires)
