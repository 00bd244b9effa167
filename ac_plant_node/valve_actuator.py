"""The stepper motor of the expansion valve, and how it fails: stuck where it is, or slow (a first-order lag)."""

import math

LONGEST_STEP_S = 0.1
"""A slow valve's motion is cut into holds of at most this length."""


def valve_motion(position: float, command: float, time_constant_s: float, duration_s: float) -> tuple[float, float]:
    """Return the mean and the last position of a slow valve on its way to a command that is held.

    Parameters
    ----------
    position, command : float
        Openings, 0..1.
    time_constant_s : float
        Of the lag; 0: the valve is where it is told to be.
    duration_s : float
    """
    if time_constant_s <= 0.0:
        return command, command
    if duration_s <= 0.0:
        return position, position
    ratio = duration_s / time_constant_s
    left = math.exp(-ratio)
    return command + (position - command) * (-math.expm1(-ratio)) / ratio, command + (position - command) * left
