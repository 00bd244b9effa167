"""A controller of another class: two PI loops whose gain on the compressor is scheduled over the evaporator pressure.

    acftc simulate actuator_fault --set controller=examples.scheduled_pi.ScheduledPi --out results/scheduled_simulated
    acftc run actuator_fault --set controller=examples.scheduled_pi.ScheduledPi --out results/scheduled

Reference governor, command limits, protection and fallback stand around it as around K0. See
docs/how-to/own-controller.md.
"""

import numpy as np
from numpy.typing import NDArray

from gimc_controller_node import Command, Controller, ControllerDesign

Vector = NDArray[np.float64]

# Evaporator pressure moves with the compressor, at the low point eight times as much as at the high one: at rest by
# -2.9, -1.2 and -0.36 kPa per rad/s. Superheat moves with the valve (it falls as that opens).
PRESSURE_PA = np.array([204.6e3, 251.2e3, 302.2e3])  # of the operating points high, med, low
SPEED_GAIN = np.array([-3.4e-3, -1.0e-3, -0.42e-3])  # rad/s per Pa
VALVE_GAIN = -4.0e-3  # opening per K
INTEGRAL_TIME_S = np.array([15.0, 20.0])


class ScheduledPi(Controller):
    """Two PI loops; the integral is kept in units of the command, so that a change of gain moves nothing by itself."""

    def __init__(self, design: ControllerDesign) -> None:
        self._rest = design.command_rest
        self._rate = design.sample_time_s / INTEGRAL_TIME_S
        self._integral, self._growth, self._wanted = np.zeros(2), np.zeros(2), np.zeros(2)

    def step(self, reference: Vector, measurement: Vector, q: Vector) -> Command:  # noqa: ARG002
        """Return the command wanted; it has no place for q."""
        proportional = _gains(measurement) * (reference - measurement)
        self._growth = self._rate * proportional
        self._wanted = self._rest + proportional + self._integral
        return self._wanted

    def sent(self, command: Command) -> None:
        """Let the integrals grow, but for that of a command which is held back."""
        self._integral += np.where(command == self._wanted, self._growth, 0.0)

    def warm_restart(self, command: Command, measurement: Vector, reference: Vector) -> None:
        """Take the integrals with which the next command is this one."""
        self._integral = command - self._rest - _gains(measurement) * (reference - measurement)


def _gains(measurement: Vector) -> Vector:
    return np.array([np.interp(measurement[0], PRESSURE_PA, SPEED_GAIN), VALVE_GAIN])
