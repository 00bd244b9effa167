"""Every synthesis of one operating point: makes sure that it is in the cache, and says what was found."""

from bringup.scenario import DEFAULT_SAMPLE_TIME_S
from fdi_node.design_cache import cached_design
from fdi_node.design_report import BlockReport
from fdi_node.weights import FdiWeights
from gimc_controller_node.weights import CompensatorWeights, ControllerWeights


def all_blocks(point: str, sample_time_s: float = DEFAULT_SAMPLE_TIME_S) -> list[BlockReport]:
    """Reports of K0, both rows of H and all Q at one operating point, designed first when the cache lacks them.

    Parameters
    ----------
    point : str
        "low", "med" or "high".
    sample_time_s : float

    Raises
    ------
    ValueError
        For an unknown operating point, a sample time out of range, or a synthesis that fails its own checks.
    """
    controller, fdi = ControllerWeights(), FdiWeights()
    k0 = cached_design("controller", "gimc_controller_node.controller_design", point, sample_time_s, controller)
    h = cached_design("fdi", "fdi_node.synthesis", point, sample_time_s, fdi)
    q = cached_design(
        "compensator",
        "gimc_controller_node.compensator_design",
        point,
        sample_time_s,
        CompensatorWeights(),
        controller,
        fdi,
    )
    return [
        BlockReport.from_array(text)
        for text in (
            k0["report"],
            h["report_H_N"],
            h["report_H_p"],
            q["report_Q_both"],
            q["report_Q_act"],
            q["report_Q_sen"],
        )
    ]
