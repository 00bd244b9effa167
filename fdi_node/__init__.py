"""Fault detection and isolation: f_e = N~ u - M~ y, the residual r = H f_e, and what is concluded from it."""

from dataclasses import replace

from ac_common.topics import FAULTS
from ac_design.store import cached_design
from ac_design.weights import FdiWeights, SuperheatSensor
from fdi_node.detector import Detection, FaultDetector, FdiDesign, Supervision

SYNTHESES = {2: ("fdi-two-sensors", "ac_design.fdi_two_sensors"), 3: ("fdi", "ac_design.fdi")}
"""For each number of sensors: name in the cache, and the module that designs."""

__all__ = [
    "FAULTS",
    "Detection",
    "FaultDetector",
    "FdiDesign",
    "FdiWeights",
    "SuperheatSensor",
    "Supervision",
    "design",
]


def design(
    point: str,
    sample_time_s: float,
    weights: FdiWeights | None = None,
    sensors: int = 3,
    superheat: SuperheatSensor | None = None,
) -> FdiDesign:
    """Observer, isolation filter and thresholds at an operating point.

    Parameters
    ----------
    point : str
        "low", "med" or "high".
    sample_time_s : float
        0.01 to 0.1 s.
    weights : FdiWeights, optional
    sensors : int
        3: p_e, superheat and the wall thermocouple. 2: without the thermocouple (the paper's E2 and E3).
    superheat : "direct" or "derived", optional
        How the superheat is measured; left out: as `weights` say.

    Raises
    ------
    ValueError
        For an unknown operating point, a sample time out of range, another number of sensors, or another sensor of the
        superheat.
    """
    if sensors not in SYNTHESES:
        raise ValueError(f"no isolation filter for {sensors} sensors; allowed: 2 or 3")
    name, synthesis = SYNTHESES[sensors]
    weights = weights or FdiWeights()
    if superheat is not None:
        weights = replace(weights, superheat=superheat)
    return FdiDesign.from_arrays(cached_design(name, synthesis, point, sample_time_s, weights))
