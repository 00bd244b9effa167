"""The compensator that a design is for: the one of an operating point, or the one of the whole envelope."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ac_common.design_file import ENVELOPE, PAPER, DesignKind, kind_of

Vector = NDArray[np.float64]
#: A named signal, or an array of its values.
Signal = Sequence[float] | Vector


class Accommodation(Protocol):
    """What the loop asks of a compensator."""

    accommodate: bool

    @property
    def does(self) -> str:
        """What it announces."""

    def step(
        self,
        signal: Signal,
        isolated: str | None,
        also_isolated: str | None = None,
        reference: Signal | None = None,
        measured: Signal | None = None,
        is_unsure: bool = False,
    ) -> Vector:
        """Return q of a tick; `signal` is what its kind `reads`, and references or readings may be missing.

        `isolated` and `also_isolated` are what is to be acted on; `is_unsure`: a fault is isolated that is not.
        """

    def commanded(self, command: Signal) -> None:
        """Take note of the command [rad/s, 0..1] that was sent."""

    def warm_restart(
        self,
        signal: Signal,
        isolated: str | None,
        also_isolated: str | None,
        reference: Signal | None,
        missed_ticks: int,
    ) -> None:
        """Go over ticks that were missed."""

    def state(self) -> Mapping[str, Any]:
        """Return what a compensator that takes this one's place has to know."""

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take the place of the compensator whose `state` this is."""


@dataclass(frozen=True)
class CompensatorKind(DesignKind):
    """A kind of compensator.

    Attributes
    ----------
    reads : str
        What of a `Detection` it works on: "innovation" or "residual".
    sees_loop : bool
        Whether it is told the readings of p_e and SH, and the command of the tick before.
    least_sensors : int
        With fewer K0 has to be alone.
    """

    reads: str
    sees_loop: bool
    least_sensors: int


KINDS = (
    CompensatorKind(
        PAPER,
        "gimc_controller_node.compensator",
        "CompensatorDesign",
        "Compensator",
        reads="innovation",
        sees_loop=False,
        least_sensors=3,
    ),
    CompensatorKind(
        ENVELOPE,
        "gimc_controller_node.envelope_compensator",
        "EnvelopeCompensatorDesign",
        "EnvelopeCompensator",
        reads="residual",
        sees_loop=True,
        least_sensors=2,
    ),
)


def make_compensator(design: Any, accommodate: bool) -> tuple[Accommodation, CompensatorKind]:
    """Return the compensator of a design, at its beginning, and the kind that it is of."""
    kind = kind_of(KINDS, design)
    return kind.made_of(design, accommodate), kind
