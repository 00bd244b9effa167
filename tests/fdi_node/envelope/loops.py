"""A plant with noisy sensors, its commands held, in front of an envelope detector."""

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np

from ac_design.envelope import KNOWN, design_envelope_fdi
from ac_plant_node import Plant, operating_point
from fdi_node.detector import Detection
from fdi_node.envelope import EnvelopeDesign, EnvelopeDetector

H = 0.1
NOISE = np.array([200.0, 0.1, 0.05, 2000.0])


@cache
def design(**options: Any) -> EnvelopeDesign:
    """The design for a plant that is known, so that faults can come early; or another one."""
    return design_envelope_fdi(H, **{"parameters": KNOWN, **options})


class Loop:
    """Plant at an operating point, inputs held unless told otherwise."""

    def __init__(self, point: str = "med", seed: int = 0, **options: Any) -> None:
        self.detector = EnvelopeDetector(design(**options))
        self.plant = Plant.at(point)
        self.inputs = self.plant.inputs.copy()
        self.command = operating_point(point).inputs[:2].copy()
        self.tick = 0
        self._noise = np.random.default_rng(seed)

    def step(self, speed_fault: float = 0.0, reading_fault: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)) -> Detection:
        o = self.plant.outputs
        outputs = (o.evaporator_pressure_pa, o.superheat_k, o.wall_temperature_c, o.condenser_pressure_pa)
        reading = np.array(outputs) + self._noise.normal(size=4) * NOISE + reading_fault
        said = self.detector.observe(self.tick * H, reading, *self.inputs[[3, 5, 2]].tolist())
        self.detector.commanded(self.command)
        self.inputs[:2] = self.command
        self.inputs[0] += speed_fault
        self.plant.step(self.inputs, H)
        self.tick += 1
        return said

    def run(self, seconds: float, **faults: Any) -> Iterator[Detection]:
        for _ in range(round(seconds / H)):
            yield self.step(**faults)
