"""Fault detection and isolation: f_e = N~ u - M~ y, the residual r = H f_e, and what is concluded from it."""

from fdi_node.design_cache import cached_design
from fdi_node.detector import FAULTS, Detection, FaultDetector, FdiDesign, Supervision
from fdi_node.weights import FdiWeights

__all__ = ["FAULTS", "Detection", "FaultDetector", "FdiDesign", "FdiWeights", "Supervision", "design"]


def design(point: str, sample_time_s: float, weights: FdiWeights | None = None) -> FdiDesign:
    """Observer, isolation filter and thresholds at an operating point.

    Parameters
    ----------
    point : str
        "low", "med" or "high".
    sample_time_s : float
        0.01 to 0.1 s.
    weights : FdiWeights, optional

    Raises
    ------
    ValueError
        For an unknown operating point or a sample time out of range.
    """
    return FdiDesign.from_arrays(
        cached_design("fdi", "fdi_node.synthesis", point, sample_time_s, weights or FdiWeights())
    )
