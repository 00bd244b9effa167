"""The controller `u = V~^-1 (U~ (r - y) + q)` and the compensator `q = Q f_e`."""

from ac_design.controller_weights import CONTROLLERS, PAPER_CONTROLLER, CompensatorWeights, ControllerWeights
from ac_design.store import cached_design
from ac_design.weights import FdiWeights
from gimc_controller_node.compensator import Compensator, CompensatorDesign
from gimc_controller_node.controller import Controller, ControllerDesign

__all__ = [
    "CONTROLLERS",
    "PAPER_CONTROLLER",
    "Compensator",
    "CompensatorDesign",
    "CompensatorWeights",
    "Controller",
    "ControllerDesign",
    "ControllerWeights",
    "design_compensator",
    "design_controller",
]


def design_controller(point: str, sample_time_s: float, weights: ControllerWeights | None = None) -> ControllerDesign:
    """K0 in coprime factors at an operating point.

    Parameters
    ----------
    point : str
        "low", "med" or "high".
    sample_time_s : float
        0.01 to 0.1 s.
    weights : ControllerWeights, optional

    Raises
    ------
    ValueError
        For an unknown operating point or a sample time out of range.
    """
    arrays = cached_design("controller", "ac_design.controller", point, sample_time_s, weights or ControllerWeights())
    return ControllerDesign.from_arrays(arrays)


def design_compensator(
    point: str,
    sample_time_s: float,
    weights: CompensatorWeights | None = None,
    controller: ControllerWeights | None = None,
    fdi: FdiWeights | None = None,
) -> CompensatorDesign:
    """Q_act and Q_sen at an operating point, for the controller and the observer that `controller` and `fdi` give.

    Raises
    ------
    ValueError
        For an unknown operating point or a sample time out of range.
    """
    arrays = cached_design(
        "compensator",
        "ac_design.compensator",
        point,
        sample_time_s,
        weights or CompensatorWeights(),
        controller or ControllerWeights(),
        fdi or FdiWeights(),
    )
    return CompensatorDesign.from_arrays(arrays)
