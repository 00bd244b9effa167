"""The plant: a nonlinear moving-boundary vapour-compression air conditioner, physics without ROS.

Names are loaded when they are first used: who wants the plant's fingerprint need not load a compiler, and who runs the
plant need not load python-control.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ac_plant_node.calibration import calibrate
    from ac_plant_node.equilibrium import OperatingPoint, operating_point, table_inputs
    from ac_plant_node.fingerprint import parameters_fingerprint
    from ac_plant_node.linear import INPUTS, OUTPUTS, linearize
    from ac_plant_node.parameters.file import load_parameters, load_points
    from ac_plant_node.parameters.values import POINTS, TABLE_I, Parameters
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
    "linearize",
    "load_parameters",
    "load_points",
    "operating_point",
    "parameters_fingerprint",
    "table_inputs",
]

_MODULES = {
    "calibration": ("calibrate",),
    "equilibrium": ("OperatingPoint", "operating_point", "table_inputs"),
    "fingerprint": ("parameters_fingerprint",),
    "linear": ("INPUTS", "OUTPUTS", "linearize"),
    "parameters.file": ("load_parameters", "load_points"),
    "parameters.values": ("POINTS", "TABLE_I", "Parameters"),
    "plant": ("Outputs", "Plant"),
}
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Load a public name from its module (PEP 562)."""
    if name not in _MODULE_OF:
        msg = f"module 'ac_plant_node' has no attribute {name!r}"
        raise AttributeError(msg)
    return getattr(import_module(f"ac_plant_node.{_MODULE_OF[name]}"), name)
