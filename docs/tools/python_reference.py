"""The page of the public Python names, written from their docstrings, to be read without building the site."""

import inspect
import re
from importlib import import_module
from pathlib import Path
from typing import Any

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "python.md"

#: Heading, what is said below it, and the names, each as ``module:name``.
SECTIONS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    (
        "The plant: `ac_plant_node`",
        "",
        tuple(
            f"ac_plant_node:{name}"
            for name in (
                *("Plant", "Outputs", "operating_point", "OperatingPoint", "linearize", "calibrate"),
                *("load_parameters", "load_points", "Parameters"),
            )
        ),
    ),
    (
        "Mathematics: `gimc`",
        "",
        (
            *("gimc:lcf", "gimc:coprime_factor", "gimc.hinfsyn:hinfsyn", "gimc.hinfsyn:hinf_synthesis"),
            *("gimc:isolation_filter", "gimc.model_matching:model_matching", "gimc:matching_lower_bound"),
            *("gimc:balanced_truncation", "gimc:reduce_order", "gimc:hinf_norm", "gimc:discretise"),
            *("gimc:sampled_observer", "gimc:SampledFilter"),
        ),
    ),
    (
        "Designs: `ac_design`",
        "Synthesis, from the cache where the design has been made before. Weights are dataclasses.",
        (
            *("ac_design:design_fdi", "ac_design:FdiWeights", "ac_design:design_controller"),
            *("ac_design:ControllerWeights", "ac_design:design_compensator", "ac_design:CompensatorWeights"),
            *("ac_design:write_designs", "ac_common.design_file:to_bytes"),
        ),
    ),
    (
        "Detection and isolation: `fdi_node`",
        "",
        tuple(f"fdi_node:{name}" for name in ("FaultDetector", "FdiDesign", "Detection", "Supervision")),
    ),
    (
        "Controller and compensator: `gimc_controller_node`",
        "",
        tuple(
            f"gimc_controller_node:{name}"
            for name in (
                *("Controller", "GimcController", "LimitedController", "ControllerDesign"),
                *("Compensator", "CompensatorDesign"),
            )
        ),
    ),
    (
        "Simulation and recordings: `ac_experiments`",
        "",
        (
            *("ac_experiments.scenario:load", "ac_experiments.scenario:check", "ac_experiments.simulate:simulate"),
            *("ac_experiments.designs:Designs", "ac_experiments.designs:designs_at"),
            *("ac_experiments.recording:Recording", "ac_common.fdi_status:StatusRow"),
            *("ac_experiments.bags.reader:read_bag", "ac_experiments.bags.simulated:write_bag"),
            *("ac_experiments.bags.export:export", "ac_experiments.bags.export:table_of"),
            "ac_experiments.metrics:summarise",
        ),
    ),
    (
        "Runs through the graph: `bringup`",
        "",
        ("bringup.launch.launch:run_graph", "bringup.launch.user_nodes:user_nodes"),
    ),
    (
        "Nodes of your own",
        "",
        (
            *("ac_ros_common.loop_node:LoopNode", "ac_ros_common.parameters:Parameter"),
            *("ac_ros_common.loop_node:run_node", "ac_plant_node.node:PlantNode"),
        ),
    ),
)

_INTRODUCTION = """# Python

{written}

The public names; all others may change from one version to the next. Arrays are numpy's, systems are
`control.StateSpace`, quantities SI unless a name ends in a unit.
"""


def text(written: str) -> str:
    """Return the content of the page; `written` says where it is from."""
    parts = [_INTRODUCTION.format(written=written)]
    for heading, words, names in SECTIONS:
        parts += [f"## {heading}", "", *([words, ""] if words else [])]
        for name in names:
            parts += _entry(name)
    return "\n".join(parts).rstrip() + "\n"


def _entry(path: str) -> list[str]:
    """Return the lines of one name: how it is called, what its docstring says, and its public methods."""
    module, _, name = path.partition(":")
    found = getattr(import_module(module), name)
    lines = [f"### `{name}`", "", "```python", f"from {module} import {name}", "", _called(found, name), "```", ""]
    lines += _words(found)
    for key, member in vars(found).items() if inspect.isclass(found) else ():
        if key.startswith("_") or not inspect.getdoc(member) or not _is_callable(member):
            continue
        lines += [f"#### `{name}.{key}`", "", *_words(member)]
    return lines


def _is_callable(member: Any) -> bool:
    return inspect.isfunction(member) or isinstance(member, property | classmethod | staticmethod)


def _called(found: Any, name: str) -> str:
    try:
        parameters = inspect.signature(found).parameters.values()
    except (TypeError, ValueError):
        return name
    shown = [str(each.replace(annotation=inspect.Parameter.empty)) for each in parameters]
    return f"{name}({', '.join(re.sub(r'<(.*?) at 0x[0-9a-f]+>', r'<\1>', text) for text in shown)})"


def _words(found: Any) -> list[str]:
    """Return a docstring as Markdown: the sentences as they are, the sections of numpydoc as blocks of text."""
    words = inspect.cleandoc(inspect.getdoc(found) or "")
    sentences, *sections = re.split(r"\n\n(?=\w[\w ]*\n-+\n)", "\n\n" + words)
    lines = [sentences.strip().replace("|", "\\|"), ""]
    if sections:
        lines += ["```text", "\n\n".join(sections), "```", ""]
    return lines
