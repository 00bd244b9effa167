"""What a plant that is another one does to the accommodation: the loop gain of q through what the model does not know.

Without mismatch the innovation does not depend on q. With it ``f_e = f_0 + S q``, S the dual Youla parameter of the
true plant (Niemann & Stoustrup, Int. J. Robust Nonlinear Control 12 (2002) 1), and ``q = Q f_e`` closes a loop that is
stable if ``rho(Q S) < 1`` at every frequency, and then certainly if ``gain(Q) gain(S) < 1``. Q is a filter whose
estimates of constant faults never fade, so the two gains are not taken apart: both faults are taken for isolated, the
way from the compensator to the controller is cut, q goes in there, and what would come back is compared with it.

    python -m ac_design.analysis.mismatch      # prints the table of docs/theory/envelope.md
"""

import math
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ac_common.blas_threads import one_blas_thread
from ac_common.faults import ISOLABLE_KINDS
from ac_common.topics import COMPENSATOR, CONTROLLER
from ac_common.units import RPM
from ac_design.envelope import KNOWN, design_envelope_fdi
from ac_design.store import envelope_design_of
from ac_plant_node import POINTS, Plant, load_parameters
from ac_plant_node.inputs import INPUT
from ac_plant_node.parameters.file import another_plant
from fdi_node.envelope import EnvelopeDetector
from fdi_node.envelope.limits import Limits
from fdi_node.envelope.unknowns import UNCERTAIN, UNKNOWNS, Unknown
from gimc_controller_node import ControllerDesign
from gimc_controller_node.envelope_compensator import EnvelopeCompensator, EnvelopeCompensatorDesign
from gimc_controller_node.making import make_controller

Matrix = NDArray[np.float64]

SAMPLE_TIME_S = 0.1
SETTLED, TICKS = 3000, 4000
"""Ticks before q goes in for one tick, and ticks of what comes back."""
PULSE = np.array([20.0 * RPM, 0.005])
"""What goes in, in the command's coordinates: speed [rad/s], opening [0..1]. Twice this in two runs of either sign."""


class Feedback(NamedTuple):
    """The loop of q through the mismatch.

    Attributes
    ----------
    radius : float
        Largest spectral radius of Q S over frequency: with less than 1 the loop is stable.
    gain : float
        Largest singular value, with q in units of `PULSE`.
    """

    radius: float
    gain: float


def _observer() -> EnvelopeDetector:
    """Return an observer for the plant in use that takes both faults for isolated from the start, and nothing else."""
    design = design_envelope_fdi(SAMPLE_TIME_S, parameters=KNOWN)
    fast = np.array([one.drift_after if one.name in ISOLABLE_KINDS else one.drift for one in UNKNOWNS])
    never = replace(Limits(), settle_s=math.inf)
    return EnvelopeDetector(replace(design, drift=fast, limits=np.array(list(vars(never).values()))))


def answer(point: str, off: Unknown | None, pulse: Matrix, settled: int, ticks: int) -> Matrix:
    """Return the q (ticks, 2) that comes back of a pulse, in a plant whose parameter is a standard deviation off."""
    detector = _observer()
    of_q, k0 = (envelope_design_of(node, point, SAMPLE_TIME_S) for node in (COMPENSATOR, CONTROLLER))
    assert isinstance(of_q, EnvelopeCompensatorDesign)
    assert isinstance(k0, ControllerDesign)
    compensator, controller = EnvelopeCompensator(of_q), make_controller(k0)
    usual = load_parameters()
    other = None if off is None else usual.replace(None, **{off.name: usual[off.name] * math.exp(off.scale)})
    with another_plant(other):
        plant = Plant.at(point)
    inputs, reference, none = plant.inputs, Plant.at(point).step(plant.inputs, 0.0)[:2], np.zeros(2)
    air = [float(inputs[INPUT[name]]) for name in ("air_inlet_temperature", "condenser_air_inlet_temperature")]
    isolated, also = ISOLABLE_KINDS
    outputs, back = plant.step(inputs, 0.0), np.empty((settled + ticks, 2))
    for k in range(len(back)):
        found = detector.observe(k * SAMPLE_TIME_S, outputs, *air)
        back[k] = compensator.step(found.residual, isolated, also)
        q = pulse if k == settled else none
        command = controller.step(reference, outputs[:3], q, air[0], float(outputs[3]))
        detector.commanded(command)
        compensator.commanded(command)
        inputs[:2] = command
        outputs = plant.step(inputs, SAMPLE_TIME_S)
    return back[settled:]


def feedback(point: str, off: Unknown | None, settled: int = SETTLED, ticks: int = TICKS) -> Feedback:
    """Return the loop of q at an operating point, with one of `UNCERTAIN` a standard deviation above the design's.

    Parameters
    ----------
    point : "low", "med" or "high"
    off : Unknown or None
        None: no mismatch.
    settled, ticks : int
        Ticks before q goes in, and of what comes back.
    """
    impulse = np.empty((ticks, 2, 2))
    for i, size in enumerate(PULSE):
        pulse = size * np.eye(2)[i]
        up, down = (answer(point, off, sign * pulse, settled, ticks) for sign in (1.0, -1.0))
        impulse[:, :, i] = (up - down) / (2.0 * size)
    loop = np.fft.rfft(impulse, axis=0)
    scaled = loop * PULSE / PULSE[:, None]
    radius = np.abs(np.linalg.eigvals(loop)).max()
    return Feedback(float(radius), float(np.linalg.norm(scaled, 2, axis=(1, 2)).max()))


def table(jobs: int = 2) -> str:
    """Return the table: a row for no mismatch and for each parameter, spectral radius and gain at each point."""
    rows: list[Unknown | None] = [None, *UNCERTAIN]
    with ProcessPoolExecutor(jobs, initializer=one_blas_thread) as pool:
        found = dict(zip(product(range(len(rows)), POINTS), pool.map(_feedback, product(rows, POINTS)), strict=True))
    lines = [
        "| off by | " + " | ".join(f"{point}: rho, gain" for point in POINTS) + " |",
        "|---|" + "---|" * len(POINTS),
    ]
    for i, one in enumerate(rows):
        name = "nothing" if one is None else f"`{one.name}`, {100.0 * one.scale:.0f} %"
        cells = (found[i, point] for point in POINTS)
        lines.append(f"| {name} | " + " | ".join(f"{cell.radius:.2f}, {cell.gain:.2f}" for cell in cells) + " |")
    return "\n".join(lines)


def _feedback(which: tuple[Unknown | None, str]) -> Feedback:
    off, point = which
    return feedback(point, off)


if __name__ == "__main__":
    print(table())
