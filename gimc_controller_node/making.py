"""The controller that the loop runs: K0, or one of the user's own class, in the same surroundings."""

import importlib
import inspect
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ac_common.design_file import DesignKind
from ac_common.errors import UserError, nearest, shortened
from gimc_controller_node.controller import Controller, ControllerDesign, GimcController
from gimc_controller_node.fallback import FallbackController
from gimc_controller_node.limited_controller import LimitedController
from gimc_controller_node.protection import ProtectionLimits

#: What the node takes: K0 of an operating point and that of the whole envelope are of one class.
KINDS = (DesignKind("", "gimc_controller_node.controller", "ControllerDesign", "GimcController"),)
#: Evaporator pressure [Pa] and superheat [K] with which a controller is tried for one tick.
TYPICAL = np.array([2.5e5, 20.0])


def make_controller(
    design: ControllerDesign, controller_class: str = "", limits: ProtectionLimits | None = None
) -> FallbackController:
    """Return a controller with all that stands around it: governor, limits, protection, fallback.

    Parameters
    ----------
    design : ControllerDesign
        K0, and the limits, the operating point and the sample time for a controller of any class.
    controller_class : str
        Python path of a class, such as ``my_module.ScheduledPi``, found from the folder where the program was started;
        it is called with `design`. Empty: K0.
    limits : ProtectionLimits, optional

    Raises
    ------
    UserError
        One line: there is no such class, it is no controller, or it does not work for one tick.
    """
    make = imported_class(controller_class) if controller_class else GimcController
    return FallbackController(LimitedController(make(design), design), limits)


def check_controller(controller_class: str, design: ControllerDesign) -> None:
    """See that a controller of that class can be built and works for one tick; raise as `make_controller` does."""
    make = imported_class(controller_class)
    try:
        controller = make(design)
        wanted = np.asarray(controller.step(TYPICAL, TYPICAL, np.zeros(2)), dtype=np.float64)
        controller.sent(design.command_rest)
        controller.warm_restart(design.command_rest, TYPICAL, TYPICAL)
    except Exception as problem:
        msg = f"controller {controller_class}: {type(problem).__name__}: {shortened(problem, 200)}"
        raise UserError(msg) from problem
    if wanted.shape != (2,) or not np.isfinite(wanted).all():
        msg = f"controller {controller_class}: step gave {shortened(wanted)}; needed: two finite numbers"
        raise UserError(msg)


def imported_class(path: str) -> Callable[[ControllerDesign], Controller]:
    """Return the class that a Python path names.

    Raises
    ------
    UserError
        One line: what of the path is not there, or what the class lacks.
    """
    module_name, _, name = path.rpartition(".")
    here = str(Path.cwd())
    if here not in sys.path:  # an installed command does not look for modules where it is called
        sys.path.append(here)
    try:
        module = importlib.import_module(module_name)
    except ModuleNotFoundError as problem:
        raise UserError(f"controller {shortened(path)}: there is no module {problem.name!r} in {here}") from None
    except Exception as problem:
        msg = f"controller {shortened(path)}: {module_name} cannot be imported: {type(problem).__name__}: {problem}"
        raise UserError(shortened(msg, 300)) from problem
    found = getattr(module, name, None)
    if not inspect.isclass(found):
        classes = [known for known, _ in inspect.getmembers(module, inspect.isclass)]
        near = nearest(name, classes)
        raise UserError(f"controller {shortened(path)}: {module_name} has no class {name!r}{near.rstrip(';')}")
    lacking = [need for need in ("step", "sent", "warm_restart") if not callable(getattr(found, need, None))]
    if lacking or found is Controller:
        missing = ", ".join(lacking) or "step"
        msg = f"controller {path}: the class has no {missing}; derive it from gimc_controller_node.Controller"
        raise UserError(msg)
    made: Callable[[ControllerDesign], Controller] = getattr(module, name)
    return made
