"""The controller `u = V~^-1 (U~ (r - y) + q)` and the compensator `q = Q f_e`."""

from gimc_controller_node.compensator import Compensator, CompensatorDesign
from gimc_controller_node.controller import Controller, ControllerDesign

__all__ = ["Compensator", "CompensatorDesign", "Controller", "ControllerDesign"]
