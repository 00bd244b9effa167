"""What a ROS 2 parameter file of the user's changes in a run, checked before anything runs.

For a run with nodes these are the designs that it names: the nodes take all else by themselves. For the loop in one
process it is everything that its step functions take.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ac_common.design_file import DESIGNED, loaded, texts_in
from ac_common.errors import UserError, shortened
from ac_common.topics import COMPENSATOR, CONTROLLER, FDI, INJECTOR, NAMESPACE
from ac_common.units import KPA
from bringup.launch.user_nodes import given_parameters

if TYPE_CHECKING:
    from ac_experiments.designs import Designs, EnvelopeDesigns
    from ac_experiments.scenario_schema import Scenario
    from gimc_controller_node.protection import ProtectionLimits

#: Modules that say which kinds of design a node takes.
_KINDS = {
    FDI: "fdi_node.making",
    COMPENSATOR: "gimc_controller_node.accommodation",
    CONTROLLER: "gimc_controller_node.making",
}
#: Numbers of a design that tell where it is at rest: of the outputs p_e, SH, T_w, or of the commands.
_OUTPUTS, _COMMANDS = ("output_rest", "reference_rest"), ("command_rest",)
#: How far they may be from the plant's, as a share: rounding, and no other operating point.
_NEAR = 1e-4
#: Parameters that change no number of a run in one process.
_WITHOUT_EFFECT = ("autostart", "priority", "realtime_care", "mode", "run_start_ns", "memory_file", "design_copy")
_PROTECTION = "protection."


def given_design(node: str, file: str, scenario: "Scenario") -> Any:
    """Return the design of a node in a user's file.

    Raises
    ------
    UserError
        When there is none, it does not work, or it was made for another operating point or another plant.
    """
    module = import_module(_KINDS[node])
    wanted = "" if node == CONTROLLER else scenario.design
    design = loaded(module.KINDS, node, file, scenario.sample_time_s, wanted=wanted)
    if problem := _unfit(design, file, scenario.operating_point):
        msg = f"design_file {shortened(file, 200)}: {problem}"
        raise UserError(msg)
    return design


def _unfit(design: Any, file: str, point: str) -> str:
    """Return why a design is not for the plant in use at an operating point; empty: it is."""
    import numpy as np

    from ac_plant_node import load_parameters
    from ac_plant_node.rest import rest_at

    _, for_point, for_plant = texts_in(file)
    if for_point and for_point != point:
        return f"made for the operating point {for_point}, not {point}"
    if for_plant and for_plant != load_parameters().identity:
        return "made for another plant than the one in use (`acftc --plant FILE` names one)"
    rest = rest_at(point)
    for names, at_rest in ((_OUTPUTS, rest["outputs"]), (_COMMANDS, rest["inputs"])):
        for name in names:
            numbers = getattr(design, name, np.empty(0))
            if numbers.size and not np.allclose(numbers, at_rest[: numbers.size], rtol=_NEAR, atol=0.0):
                return f"made for another point than {point}, or another plant: {name} is {shortened(numbers)}"
    return ""


def check_designs(file: Path | None, scenario: "Scenario") -> None:
    """See that the designs which a parameter file names can run; raises as `given_design`."""
    for node, given in given_parameters(file).items():
        if node in DESIGNED and given.get("design_file"):
            given_design(node, str(given["design_file"]), scenario)


@dataclass(frozen=True)
class InOneProcess:
    """What the loop in one process is run with; `own` are designs of the user's by field of `Designs`."""

    scenario: "Scenario"
    own: Mapping[str, Any] = field(default_factory=dict)
    limits: "ProtectionLimits | None" = None

    @property
    def designs(self) -> "Designs | EnvelopeDesigns":
        """Return the designs of the scenario with the user's in their places."""
        from ac_experiments.designs import designs_of

        return replace(designs_of(self.scenario), **self.own)


def in_one_process(file: Path | None, scenario: "Scenario") -> InOneProcess:
    """Return scenario, designs and limits of a run in one process, with what a parameter file changes in them.

    Raises
    ------
    UserError
        For a parameter that the nodes would take and this loop does not, and as `given_design`.
    """
    made = InOneProcess(scenario)
    for node, given in given_parameters(file).items():
        for name, value in given.items():
            made = _with(made, node, name, value, f"{file}: {NAMESPACE}/{node}: {name}")
    return made


def _with(made: InOneProcess, node: str, name: str, value: Any, where: str) -> InOneProcess:
    """Return what is run with one parameter of one node changed."""
    if name in _WITHOUT_EFFECT:
        return made
    if name == "design_file" and node in DESIGNED:
        place = {FDI: "fdi", COMPENSATOR: "compensator", CONTROLLER: "controller"}[node]
        return replace(made, own={**made.own, place: given_design(node, str(value), made.scenario)})
    if node == CONTROLLER and name.startswith(_PROTECTION):
        return replace(made, limits=_limits(made, name.removeprefix(_PROTECTION), value, where))
    changed = _of_scenario(made.scenario, node, name, value)
    if changed is None:
        msg = (
            f"{where}: is for nodes; a run in one process takes design_file, accommodate, noise_std, seed, protection.*"
        )
        raise UserError(f"{msg}, controller_class, and all else from the scenario (--set)")
    from ac_experiments.scenario import check

    return replace(made, scenario=check({**made.scenario.model_dump(mode="json"), **changed}, where))


def _limits(made: InOneProcess, name: str, value: Any, where: str) -> "ProtectionLimits":
    from gimc_controller_node.protection import limits_for

    scenario = made.scenario
    limits = made.limits or limits_for(has_belt=scenario.has_belt, measures_head=scenario.measures_head)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise UserError(f"{where}: given {shortened(repr(value))}; must be a number")
    try:
        return replace(limits, **{name: float(value)})
    except ValueError as problem:
        raise UserError(f"{where}: {problem}") from None


def _of_scenario(scenario: "Scenario", node: str, name: str, value: Any) -> Mapping[str, Any] | None:
    """Return the keys of a scenario that say what a parameter says; None where there are none."""
    noise = scenario.model_dump(mode="json")["noise"]
    if (node, name) == (COMPENSATOR, "accommodate"):
        return {"passive": not value}
    if (node, name) == (CONTROLLER, "controller_class"):
        return {"controller": value} if value else {}
    if (node, name) == (INJECTOR, "seed"):
        return {"noise": {**noise, "seed": value}}
    if (node, name) == (INJECTOR, "noise_std") and isinstance(value, list) and len(value) == len(scenario.noise.std):
        units = [key for key in noise if key != "seed"]
        si = [KPA if key.endswith("_kpa") else 1.0 for key in units]
        return {"noise": {**noise, **{key: std / one for key, std, one in zip(units, value, si, strict=True)}}}
    return None
