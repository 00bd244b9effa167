"""The controller in its surroundings: no q, no measurements (the safe command), protection."""

import math

import numpy as np

from ac_common.safe_command import towards
from gimc_controller_node.controller import Command, Vector
from gimc_controller_node.limited_controller import LAST, LimitedController
from gimc_controller_node.protection import (
    CAPPED,
    IDLE,
    Protection,
    ProtectionLimits,
    constants_of,
    protect,
    protection_of,
    reason_for,
)
from gimc_controller_node.reference_limits import BOUNDS, ReferenceLimits

GIMC, K0_ALONE, SAFE = "", "no q: K0 alone", "no measurement: going to the safe command"


class FallbackController:
    """A controller that answers every tick, whatever is missing, and never with a jump of its own making.

    Parameters
    ----------
    controller : LimitedController
    limits : ProtectionLimits, optional
        Of what the plant may be asked to do.

    Attributes
    ----------
    protection : Protection
        The caps on the command at present that keep the plant within these limits.
    bound : str
        Which bounds of the references are used instead of what is wanted, in words; empty: none.
    limited : LimitedController
    references : ReferenceLimits
    caps, guards : ndarray
        Those caps for compiled code, and what moves them: the arguments of `move_caps`.
    words : list of str
        What is said while all is there, by the caps and bounds that act: `BOUNDS` times the first number plus the
        second.
    mode : str
        What it does at present: `GIMC` (all is there), `K0_ALONE` (q is missing; the last one fades out), or `SAFE`
        (a measurement or a reference is missing).
    """

    def __init__(self, controller: LimitedController, limits: ProtectionLimits | None = None) -> None:
        self.limited = controller
        self._limits = limits or ProtectionLimits()
        self.protection: Protection = IDLE
        self.references = ReferenceLimits(self._limits, controller.design.approach_k)
        self.guards, self.caps = constants_of(self._limits, controller.design.sample_time_s), np.array(IDLE)
        self.words = [
            "; ".join(filter(None, (bound, reason_for(capped))))
            for capped in range(2 * max(CAPPED))
            for bound in self.references.words
        ]
        self.bound = ""
        self._command = controller.design.command_rest.copy()
        self._safe = controller.design.command_rest
        self._sample_time_s = controller.design.sample_time_s
        self.mode = GIMC

    def warm_restart(self, command: Command, measured: Vector, reference: Vector) -> None:
        """Take over from whatever moves the actuators now: see `LimitedController.warm_restart`."""
        self.limited.warm_restart(command, measured, reference)
        self._command = np.array(command, dtype=np.float64)

    def step(
        self,
        reference: Vector,
        measured: Vector,
        q: Vector | None,
        air_inlet_temperature_c: float | None = None,
        condenser_pressure_pa: float | None = None,
    ) -> Command:
        """Return the command of a tick with references and measurements; what may be None is missing."""
        wanted_pressure, wanted_superheat = reference.tolist()
        pressure, superheat, self.bound = self.references.bounded(
            wanted_pressure, wanted_superheat, air_inlet_temperature_c
        )
        if self.bound:
            reference = np.array([pressure, superheat])
        read_pressure, read_superheat, *_ = measured.tolist()
        self._protect(read_pressure, read_superheat, condenser_pressure_pa or 0.0)
        if self.mode == SAFE:
            self.limited.warm_restart(self._command, measured, reference)
        command = self.limited.step(reference, measured, q)
        if math.isnan(sum(command.tolist())):  # numbers that overflowed: begin anew from what the actuators do
            return self.on_missed_inputs()
        self.mode = GIMC if q is not None else K0_ALONE
        self._command = command
        return command

    @property
    def is_ordinary(self) -> bool:
        """Whether nothing is missing, so that all of a tick is that of `ReferenceLimits`, the caps and K0."""
        return self.mode == GIMC and self.limited.k0 is not None

    def follow(self, said: int) -> None:
        """Go on from ticks that were ordinary, and that other code has done; `said`: which of `words` at the last."""
        self._command, self.bound = self.limited.memory[LAST : LAST + 2].copy(), self.references.words[said % BOUNDS]
        self.protection = protection_of(self.caps)

    def _protect(self, pressure: float, superheat: float, head: float) -> None:
        """Move the caps on the command for these readings."""
        speed, opening = self._command.tolist()
        protection = protect(
            self.protection, (pressure, superheat, head), (speed, opening), self._limits, self._sample_time_s
        )
        if protection is not self.protection:
            self.protection, self.caps[:] = protection, protection
            self.limited.cap(protection.fastest, protection.opening.value)

    @property
    def does(self) -> str:
        """All that is out of the ordinary at present, in words; empty when nothing is."""
        if not self.mode and not self.bound and self.protection is IDLE:
            return ""
        return "; ".join(text for text in (self.mode, self.bound, self.protection.reason) if text)

    def on_missed_inputs(self) -> Command:
        """Return the command of a tick that lacks measurements or references: a stride nearer to the safe command."""
        self.mode = SAFE
        self._command = towards(self._command, self._safe, self._sample_time_s)
        return self._command

    def drive(self, belt_speed_rad_s: float) -> None:
        """Take the compressor's speed on the belt as given in the next step; 0: there is none, it is commanded."""
        if belt_speed_rad_s > 0.0:
            self.limited.drive(belt_speed_rad_s)
