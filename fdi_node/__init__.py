"""Fault detection and isolation: f_e = N~ u - M~ y, the residual r = H f_e, and what is concluded from it."""

from fdi_node.decision import Supervision
from fdi_node.detector import Detection, FaultDetector, FdiDesign

__all__ = ["Detection", "FaultDetector", "FdiDesign", "Supervision"]
