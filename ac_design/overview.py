"""Every synthesis of one operating point: makes sure that it is in the cache, and says what was found."""

from dataclasses import replace

from ac_common.sample_time import DEFAULT_SAMPLE_TIME_S
from ac_design.controller_weights import PAPER_CONTROLLER, CompensatorWeights, ControllerWeights
from ac_design.report import BlockReport
from ac_design.store import cached_design
from ac_design.weights import FdiWeights

SYNTHESIS = "ac_design.controller"


def all_blocks(point: str, sample_time_s: float = DEFAULT_SAMPLE_TIME_S) -> list[BlockReport]:
    """Reports of both K0, both rows of H and all Q at one operating point, designed first when the cache lacks them.

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
    k0 = cached_design("controller", SYNTHESIS, point, sample_time_s, controller)
    paper = cached_design("controller-paper", SYNTHESIS, point, sample_time_s, PAPER_CONTROLLER)
    h = cached_design("fdi", "ac_design.fdi", point, sample_time_s, fdi)
    q = cached_design(
        "compensator",
        "ac_design.compensator",
        point,
        sample_time_s,
        CompensatorWeights(),
        controller,
        fdi,
    )
    return [
        BlockReport.from_array(k0["report"]),
        replace(BlockReport.from_array(paper["report"]), block="K0_paper"),
        *(
            BlockReport.from_array(text)
            for text in (h["report_H_N"], h["report_H_p"], q["report_Q_both"], q["report_Q_act"], q["report_Q_sen"])
        ),
    ]
