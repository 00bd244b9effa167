"""The plant: a nonlinear moving-boundary vapour-compression air conditioner, physics without ROS."""

from ac_plant_node.calibration import TABLE_I, calibrate
from ac_plant_node.equilibrium import POINTS, OperatingPoint, equilibrium, operating_point, table_inputs
from ac_plant_node.fingerprint import parameters_fingerprint
from ac_plant_node.linear import INPUTS, OUTPUTS, linearize
from ac_plant_node.parameters import Parameters, load_parameters
from ac_plant_node.plant import Outputs, Plant

__all__ = [
    "INPUTS",
    "OUTPUTS",
    "POINTS",
    "TABLE_I",
    "OperatingPoint",
    "Outputs",
    "Parameters",
    "Plant",
    "calibrate",
    "equilibrium",
    "linearize",
    "load_parameters",
    "operating_point",
    "parameters_fingerprint",
    "table_inputs",
]
