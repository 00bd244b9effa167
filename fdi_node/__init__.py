"""Fault detection and isolation: f_e = N~ u - M~ y, the residual r = H f_e, and what is concluded from it."""

from ac_common.topics import FAULTS
from fdi_node.detector import Detection, FaultDetector, FdiDesign, Supervision

__all__ = ["FAULTS", "Detection", "FaultDetector", "FdiDesign", "Supervision"]
