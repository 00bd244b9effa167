"""Detector and compensator of a run, those of the paper or those of the whole envelope, behind the same two calls."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ac_experiments.designs import Designs, EnvelopeDesigns
from fdi_node.detector import Detection, FaultDetector, FdiDesign
from fdi_node.envelope import EnvelopeDesign, EnvelopeDetector
from gimc_controller_node import Compensator, CompensatorDesign
from gimc_controller_node.envelope_compensator import EnvelopeCompensator, EnvelopeCompensatorDesign

Vector = NDArray[np.float64]


class Blocks(Protocol):
    """What a tick of the loop needs of both.

    Attributes
    ----------
    bounds_references : bool
        Whether the controller is told the inlet air's temperature.
    """

    bounds_references: bool

    def step(
        self, time_s: float, measured: Sequence[float], air_c: tuple[float, float], reference: Vector
    ) -> tuple[Detection, Vector]:
        """Return what is detected, and q; `air_c` are evaporator's and condenser's inlet temperatures."""

    def commanded(self, command: Vector) -> None:
        """Close the tick with the command that is sent."""

    @property
    def does(self) -> str:
        """What the compensator announces."""


class PaperBlocks:
    """Those of one operating point."""

    bounds_references = False

    def __init__(self, fdi: FdiDesign, compensator: CompensatorDesign, accommodate: bool) -> None:
        self._detector, self._compensator = FaultDetector(fdi), Compensator(compensator, accommodate=accommodate)
        self.commanded = self._detector.commanded

    def step(
        self, time_s: float, measured: Sequence[float], air_c: tuple[float, float], reference: Vector
    ) -> tuple[Detection, Vector]:
        """Return what is detected, and q; as `Blocks.step`."""
        found = self._detector.observe(time_s, measured[:3], air_c[0])
        pressure, superheat = reference.tolist()
        q = self._compensator.step(found.innovation, found.isolated, found.also_isolated, (pressure, superheat))
        return found, q

    @property
    def does(self) -> str:
        """What the compensator announces."""
        return self._compensator.does


class EnvelopeBlocks:
    """Those of the whole envelope."""

    bounds_references = True

    def __init__(self, fdi: EnvelopeDesign, compensator: EnvelopeCompensatorDesign, accommodate: bool) -> None:
        self._detector, self._compensator = EnvelopeDetector(fdi), EnvelopeCompensator(compensator, accommodate)
        self._command = compensator.command_rest

    def step(
        self, time_s: float, measured: Sequence[float], air_c: tuple[float, float], reference: Vector
    ) -> tuple[Detection, Vector]:
        """Return what is detected, and q; as `Blocks.step`."""
        found = self._detector.observe(time_s, measured, *air_c)
        q = self._compensator.step(
            found.residual, found.isolated, found.also_isolated, self._command, reference, measured
        )
        return found, q

    def commanded(self, command: Vector) -> None:
        """Close the tick with the command that is sent."""
        self._detector.commanded(command)
        self._command = command

    @property
    def does(self) -> str:
        """What the compensator announces."""
        return self._compensator.does


def blocks_of(designs: Designs | EnvelopeDesigns, accommodate: bool) -> Blocks:
    """Return detector and compensator for designs of either kind."""
    if isinstance(designs, EnvelopeDesigns):
        return EnvelopeBlocks(designs.fdi, designs.compensator, accommodate)
    return PaperBlocks(designs.fdi, designs.compensator, accommodate)
