"""The controller `u = V~^-1 (U~ (r - y) + q)`, or one of another class, and the compensator `q = Q f_e`."""

from gimc_controller_node.compensator import Compensator, CompensatorDesign
from gimc_controller_node.controller import Command, Controller, ControllerDesign, GimcController
from gimc_controller_node.limited_controller import LimitedController, limited_k0

__all__ = [
    "Command",
    "Compensator",
    "CompensatorDesign",
    "Controller",
    "ControllerDesign",
    "GimcController",
    "LimitedController",
    "limited_k0",
]
