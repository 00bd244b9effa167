"""One module for each command of `acftc`, named like it and holding it under that name; `bringup.cli` lists them.

A module imports at its top only what help needs: click, the console, the errors. Whatever takes time to import (numpy,
numba, rclpy, plotly) is imported by the function that runs the command.
"""
