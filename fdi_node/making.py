"""The detector that a design is for: the one of an operating point, or the one of the whole envelope."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from ac_common.design_file import ENVELOPE, PAPER, DesignKind, kind_of
from ac_common.signals import Inlets, Measurement, topics_of
from ac_common.topics import AIR_FLOW
from fdi_node.detector import Detection


class Detector(Protocol):
    """What the loop asks of a detector."""

    @property
    def observe(self) -> Callable[..., Detection]:
        """Called with the time [s], readings, inlet temperatures and, of a known blower, the air flow [kg/s]."""

    @property
    def warm_restart(self) -> Callable[..., None]:
        """Called with readings, inlet temperatures, last command, missed ticks, and the air flow of a known blower."""

    def commanded(self, command: Any) -> None:
        """Close the tick with the command [rad/s, 0..1] that was sent."""

    def state(self) -> Mapping[str, Any]:
        """Return what a detector that takes this one's place needs."""

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take the place of the detector whose `state` this is."""


@dataclass(frozen=True)
class DetectorKind(DesignKind):
    """A kind of detector.

    Attributes
    ----------
    readings : int
        How many of the fields of `Measurement` it is told.
    inlets : int
        How many of the fields of `Inlets`.
    """

    readings: int
    inlets: int

    def topics(self, design: Any) -> tuple[str, ...]:
        """Return the topics of what it is told: readings, inlet temperatures, and the air flow of a known blower."""
        readings, inlets = topics_of("measured", Measurement), topics_of("measured", Inlets)
        return (*readings[: self.readings], *inlets[: self.inlets], *([AIR_FLOW] if knows_air_flow(design) else []))


def knows_air_flow(design: Any) -> bool:
    """Whether a detector is told the air flow through the evaporator."""
    return bool(getattr(design, "blower", 0.0) > 0.5)


KINDS = (
    DetectorKind(PAPER, "fdi_node.detector", "FdiDesign", "FaultDetector", readings=3, inlets=1),
    DetectorKind(ENVELOPE, "fdi_node.envelope", "EnvelopeDesign", "EnvelopeDetector", readings=4, inlets=2),
)


def make_detector(design: Any) -> tuple[Detector, DetectorKind]:
    """Return the detector of a design, at its beginning, and the kind that it is of."""
    kind = kind_of(KINDS, design)
    return kind.made_of(design), kind
