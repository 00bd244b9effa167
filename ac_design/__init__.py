"""Synthesis, offline, of what the nodes load: observer, isolation filter, controller, compensators."""

from ac_design.store import (
    all_blocks,
    cached_design,
    design_compensator,
    design_controller,
    design_fdi,
    design_of,
    envelope_design_of,
    write_designs,
)
from ac_design.weights import (
    CONTROLLERS,
    ENVELOPE_CONTROLLER,
    PAPER_CONTROLLER,
    CompensatorWeights,
    ControllerWeights,
    FdiWeights,
    SuperheatSensor,
)

__all__ = [
    "CONTROLLERS",
    "ENVELOPE_CONTROLLER",
    "PAPER_CONTROLLER",
    "CompensatorWeights",
    "ControllerWeights",
    "FdiWeights",
    "SuperheatSensor",
    "all_blocks",
    "cached_design",
    "design_compensator",
    "design_controller",
    "design_fdi",
    "design_of",
    "envelope_design_of",
    "write_designs",
]
