"""Fault detection over the whole envelope: a nonlinear observer with unknown air flows, and the decision."""

from fdi_node.envelope.detector import EnvelopeDesign, EnvelopeDetector
from fdi_node.envelope.limits import Limits

__all__ = ["EnvelopeDesign", "EnvelopeDetector", "Limits"]
