"""The controller when something is missing: K0 without q, the safe command without measurements, and back again."""

import numpy as np
from numpy.typing import NDArray

from bringup.safe_command import towards
from gimc_controller_node.controller import Controller

Vector = NDArray[np.float64]

GIMC, K0_ALONE, SAFE = "", "no q: K0 alone", "no measurement: going to the safe command"


class FallbackController:
    """A `Controller` that answers every tick, whatever is missing, and never with a jump of its own making.

    Parameters
    ----------
    controller : Controller

    Attributes
    ----------
    mode : str
        What it does at present: `GIMC` (all is there), `K0_ALONE` (q is missing; the last one fades out), or `SAFE`
        (a measurement or a reference is missing).
    """

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._command = controller.design.command_rest.copy()
        self._safe = controller.design.command_rest
        self._sample_time_s = controller.design.sample_time_s
        self.mode = GIMC

    def resume(self, command: Vector, measured: Vector, reference: Vector) -> None:
        """Take over from whatever moves the actuators now: see `Controller.resume`."""
        self._controller.resume(command, measured, reference)
        self._command = np.array(command, dtype=np.float64)

    def step(self, reference: Vector, measured: Vector, q: Vector | None) -> Vector:
        """Command of a tick with references and measurements; q None when there is none."""
        if self.mode == SAFE:
            self._controller.resume(self._command, measured, reference)
        command = self._controller.step(reference, measured, q)
        if not np.isfinite(command).all():  # numbers that overflowed: begin anew from what the actuators do
            return self.blind()
        self.mode = GIMC if q is not None else K0_ALONE
        self._command = command
        return command

    def blind(self) -> Vector:
        """Command of a tick that lacks measurements or references: one stride nearer to the safe command."""
        self.mode = SAFE
        self._command = towards(self._command, self._safe, self._sample_time_s)
        return self._command
