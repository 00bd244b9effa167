"""Designs of all blocks at an operating point, cached under a hash of everything that they depend on."""

import importlib
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ac_common.cache import Arrays, cached, source_fingerprint
from ac_common.design_file import DESIGNED, ENVELOPE, PAPER, design_name, to_bytes
from ac_common.errors import UserError
from ac_common.files import write_whole
from ac_common.sample_time import DEFAULT_SAMPLE_TIME_S, LONGEST_SAMPLE_TIME_S, SHORTEST_SAMPLE_TIME_S
from ac_common.topics import COMPENSATOR, CONTROLLER, FDI
from ac_design.report import BlockReport
from ac_design.weights import (
    BELT,
    CONTROLLERS,
    ENVELOPE_CONTROLLER,
    PAPER_CONTROLLER,
    BeltWeights,
    CompensatorWeights,
    ControllerWeights,
    FdiWeights,
    SuperheatSensor,
)
from ac_plant_node import load_parameters, parameters_fingerprint
from fdi_node import FdiDesign
from gimc_controller_node import CompensatorDesign, ControllerDesign

if TYPE_CHECKING:
    from fdi_node.envelope import EnvelopeDesign
    from gimc_controller_node.envelope_compensator import EnvelopeCompensatorDesign

PACKAGES = ("gimc", "ac_plant_node", "fdi_node", "gimc_controller_node", "ac_design")
"""The packages whose sources determine a design."""
SYNTHESES = {2: ("fdi-two-sensors", "ac_design.fdi_two_sensors"), 3: ("fdi", "ac_design.fdi")}
"""For each number of sensors: name in the cache, and the module that designs."""


def cached_design(block: str, synthesis: str, point: str, sample_time_s: float, *weights: Any) -> Arrays:
    """Return the sampled design of one block at one operating point, from the cache or synthesised.

    Parameters
    ----------
    block : str
        Name for the file.
    synthesis : str
        Module with `synthesise(point, sample_time_s, *weights) -> Arrays`; imported only when there is nothing in the
        cache, since synthesis needs far more memory and start-up time than a running node should take.
    point : str
        "low", "med" or "high".
    sample_time_s : float
        0.01 to 0.1 s.
    *weights : dataclass

    Raises
    ------
    UserError
        For a sample time out of range or an unknown point.
    """
    if not (math.isfinite(sample_time_s) and SHORTEST_SAMPLE_TIME_S <= sample_time_s <= LONGEST_SAMPLE_TIME_S):
        allowed = f"{SHORTEST_SAMPLE_TIME_S:g} to {LONGEST_SAMPLE_TIME_S:g} s"
        raise UserError(f"sample time {sample_time_s:g} s: designs exist for {allowed}")
    key = {
        "point": point,
        "sample_time_s": sample_time_s,
        "weights": [asdict(w) for w in weights],
        "plant": parameters_fingerprint(),
        "code": source_fingerprint(*PACKAGES),
    }

    def compute() -> Arrays:
        from threadpoolctl import threadpool_limits

        from gimc.errors import SynthesisError

        print(f"acftc: designing the {block} at {point} (once, some seconds)", file=sys.stderr, flush=True)
        module = importlib.import_module(synthesis)
        with threadpool_limits(1):  # matrices of this size are ten times slower on several threads
            try:
                arrays: Arrays = module.synthesise(point, sample_time_s, *weights)
            except SynthesisError as problem:
                raise UserError(f"design of the {block} at {point}: {problem}") from problem
        return arrays

    return cached(f"{block}-{point}", key, compute)


def design_fdi(
    point: str,
    sample_time_s: float,
    weights: FdiWeights | None = None,
    sensors: int = 3,
    superheat: SuperheatSensor | None = None,
) -> FdiDesign:
    """Return observer, isolation filter and thresholds at an operating point.

    Parameters
    ----------
    point : str
        "low", "med" or "high".
    sample_time_s : float
        0.01 to 0.1 s.
    weights : FdiWeights, optional
    sensors : int
        3: p_e, superheat and the wall thermocouple. 2: without the thermocouple (the paper's E2 and E3).
    superheat : "direct" or "derived", optional
        How the superheat is measured; left out: as `weights` say.

    Raises
    ------
    UserError
        For an unknown operating point, a sample time out of range, another number of sensors, or another sensor of the
        superheat.
    """
    if sensors not in SYNTHESES:
        raise UserError(f"no isolation filter for {sensors} sensors; allowed: 2 or 3")
    name, synthesis = SYNTHESES[sensors]
    weights = weights or FdiWeights()
    if superheat is not None:
        weights = replace(weights, superheat=superheat)
    return FdiDesign.from_arrays(cached_design(name, synthesis, point, sample_time_s, weights))


def design_controller(point: str, sample_time_s: float, weights: ControllerWeights | None = None) -> ControllerDesign:
    """Return K0 in coprime factors at an operating point.

    Parameters
    ----------
    point : str
        "low", "med" or "high".
    sample_time_s : float
        0.01 to 0.1 s.
    weights : ControllerWeights, optional

    Raises
    ------
    UserError
        For an unknown operating point or a sample time out of range.
    """
    arrays = cached_design("controller", "ac_design.controller", point, sample_time_s, weights or ControllerWeights())
    return ControllerDesign.from_arrays(arrays)


def design_belt_controller(point: str, sample_time_s: float, weights: BeltWeights | None = None) -> ControllerDesign:
    """Return K0 for a compressor on the belt, which the valve alone is left to; raises as `design_controller`."""
    arrays = cached_design("controller-belt", "ac_design.belt", point, sample_time_s, weights or BeltWeights())
    return ControllerDesign.from_arrays(arrays)


def design_compensator(
    point: str,
    sample_time_s: float,
    weights: CompensatorWeights | None = None,
    controller: ControllerWeights | None = None,
    fdi: FdiWeights | None = None,
) -> CompensatorDesign:
    """Return guard, Q_act and Q_sen at an operating point, for the K0 and the observer of `controller` and `fdi`.

    Raises
    ------
    UserError
        For an unknown operating point or a sample time out of range.
    """
    arrays = cached_design(
        "compensator",
        "ac_design.compensator",
        point,
        sample_time_s,
        weights or CompensatorWeights(),
        controller or ControllerWeights(),
        fdi or FdiWeights(),
    )
    return CompensatorDesign.from_arrays(arrays)


def design_of(
    node: str,
    point: str,
    sample_time_s: float,
    sensors: int = 3,
    superheat: SuperheatSensor = "direct",
    controller: str = "tracking",
) -> FdiDesign | CompensatorDesign | ControllerDesign:
    """Return the design of a node at an operating point.

    Parameters
    ----------
    node : str
        One of `ac_common.design_file.DESIGNED`.
    point, sample_time_s, sensors, superheat
        As in `design_fdi`; `sensors` is the detector's.
    controller : str
        Which K0: "tracking" or "paper", or "belt"; the compensator beside that one is tracking's and stays silent.

    Raises
    ------
    UserError
        As `design_fdi`.
    """
    weights = CONTROLLERS["tracking" if controller == BELT else controller]
    makers: dict[str, Callable[[], FdiDesign | CompensatorDesign | ControllerDesign]] = {
        FDI: lambda: design_fdi(point, sample_time_s, sensors=sensors, superheat=superheat),
        COMPENSATOR: lambda: design_compensator(
            point, sample_time_s, controller=weights, fdi=FdiWeights(superheat=superheat)
        ),
        CONTROLLER: lambda: (
            design_belt_controller(point, sample_time_s)
            if controller == BELT
            else design_controller(point, sample_time_s, weights)
        ),
    }
    return makers[node]()


def envelope_design_of(
    node: str,
    point: str,
    sample_time_s: float,
    sensors: Sequence[str] | None = None,
    superheat: SuperheatSensor = "direct",
    air_flow: str = "none",
) -> "EnvelopeDesign | EnvelopeCompensatorDesign | ControllerDesign":
    """Return the design of a node for the whole envelope.

    Parameters
    ----------
    node : str
        One of `ac_common.design_file.DESIGNED`.
    point : str
        "low", "med" or "high", where runs begin: the safe command is that point's.
    sample_time_s : float
        0.01 to 0.1 s.
    sensors : sequence of str, optional
        As in `ac_design.envelope.design_envelope_fdi`; left out: all.
    superheat : "direct" or "derived"
        How the superheat is measured.
    air_flow : "none" or "blower"
        What is known of the air flow through the evaporator.

    Raises
    ------
    UserError
        For an unknown operating point, a sample time out of range, or sensors that there are not.
    """
    # The observer stands on compiled code, which the designs of one point have no use for.
    from ac_design.envelope import SENSORS, design_envelope_fdi
    from gimc_controller_node.envelope_compensator import EnvelopeCompensatorDesign
    from gimc_controller_node.protection import limits_for

    if node == FDI:
        return design_envelope_fdi(sample_time_s, sensors or SENSORS, superheat=superheat, air_flow=air_flow)
    k0 = design_controller(point, sample_time_s, ENVELOPE_CONTROLLER)
    if node == CONTROLLER:
        return k0
    of_k0 = {field.name: getattr(k0, field.name) for field in fields(k0)}
    limits = limits_for(has_belt=False, measures_head="p_c" in (sensors or SENSORS))
    capped = limits.highest_head_pa - limits.head_margin_pa
    return EnvelopeCompensatorDesign(**of_k0, derived=float(superheat == "derived"), capped_head_pa=capped)


#: For each value of a scenario's `design`, what gives the design of a node.
DESIGNERS: dict[str, Callable[..., Any]] = {PAPER: design_of, ENVELOPE: envelope_design_of}


def write_designs(
    folder: Path, point: str, sample_time_s: float, design: str = PAPER, **options: Any
) -> dict[str, Path]:
    """Write the design of each node that has one into `folder`, and return the files by node.

    What is compiled for a node is in the cache then, and the node starts at once.

    Parameters
    ----------
    folder : Path
        Exists.
    point, sample_time_s, **options
        As in `design_of` or `envelope_design_of`.
    design : "paper" or "envelope"
        For the operating point, or for the whole envelope.

    Raises
    ------
    UserError
        As `design_of` or `envelope_design_of`.
    RunError
        When a file cannot be written.
    """
    files = {node: folder / design_name(node, point, design) for node in DESIGNED}
    for node, file in files.items():
        made = DESIGNERS[design](node, point, sample_time_s, **options)
        is_observer = design == ENVELOPE and node == FDI  # for all points, and the only one that a node has compiled
        if is_observer:
            made.try_out()
        write_whole(file, to_bytes(made, "" if is_observer else point, load_parameters().identity))
    return files


def all_blocks(point: str, sample_time_s: float = DEFAULT_SAMPLE_TIME_S) -> list[BlockReport]:
    """Return the reports of all K0, both rows of H and all Q at an operating point.

    Parameters
    ----------
    point : str
        "low", "med" or "high".
    sample_time_s : float

    Raises
    ------
    UserError
        For an unknown operating point, a sample time out of range, or a synthesis that fails its own checks.
    """
    controller, fdi = ControllerWeights(), FdiWeights()
    k0 = cached_design("controller", "ac_design.controller", point, sample_time_s, controller)
    paper = cached_design("controller-paper", "ac_design.controller", point, sample_time_s, PAPER_CONTROLLER)
    h = cached_design("fdi", "ac_design.fdi", point, sample_time_s, fdi)
    envelope = cached_design("controller", "ac_design.controller", point, sample_time_s, ENVELOPE_CONTROLLER)
    belt = cached_design("controller-belt", "ac_design.belt", point, sample_time_s, BeltWeights())
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
        replace(BlockReport.from_array(envelope["report"]), block="K0_envelope"),
        BlockReport.from_array(belt["report"]),
        *(
            BlockReport.from_array(text)
            for text in (h["report_H_N"], h["report_H_p"], q["report_Q_both"], q["report_Q_act"], q["report_Q_sen"])
        ),
    ]
