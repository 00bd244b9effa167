"""Whether the envelope's observer survives anything: `python -m bringup.benchmarks.observer_anywhere 50` prints it.

An hour of random inputs over the whole permitted box, zones that end, start-up and commands at their limits among them,
in air of any humidity, of which the observer knows nothing; then ten minutes at an operating point, after which it has
to be back at what the plant does.
"""

import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import numpy as np

from ac_common.blas_threads import one_blas_thread
from ac_common.units import KPA, RPM
from ac_design.envelope import design_envelope_fdi
from ac_plant_node.dynamics.drive import held_inputs
from ac_plant_node.equilibrium import operating_point
from ac_plant_node.inputs import N_INPUTS
from ac_plant_node.parameters.file import load_parameters
from ac_plant_node.parameters.values import POINTS
from ac_plant_node.plant import Plant
from ac_plant_node.properties.compiled import Array
from bringup.benchmarks.plant_speed import random_holds
from fdi_node.detector import Detection
from fdi_node.envelope import EnvelopeDetector

SAMPLE_TIME_S = 0.1
NOISE = np.array([200.0, 0.1, 0.05, 2000.0])
REST_S = 600.0


class Hour(NamedTuple):
    """What one hour and the rest after it came to.

    Attributes
    ----------
    is_finite : bool
        Whether every innovation and residual was.
    median : tuple of float
        Of the innovations' magnitudes during the hour: p_e [Pa], SH [K], T_w [K].
    rms : tuple of float
        Of the innovations in the last minute.
    residual : tuple of float
        Estimates of f_N [rad/s] and f_p [Pa] at the end.
    isolated : str or None
        What is isolated at the end.
    """

    is_finite: bool
    median: tuple[float, ...]
    rms: tuple[float, ...]
    residual: tuple[float, ...]
    isolated: str | None


def hour(seed: int, ticks: int = 36000) -> Hour:
    """Return what an hour of random inputs, or its first `ticks`, and ten minutes of rest do to the observer."""
    rng, name = np.random.default_rng([1, seed]), POINTS[seed % len(POINTS)]
    plant, detector = Plant.at(name), EnvelopeDetector(design_envelope_fdi(SAMPLE_TIME_S))
    outputs = plant.step(plant.inputs, 0.0)
    found: list[Detection] = []

    def run(w: Array, count: int) -> None:
        nonlocal outputs
        for _ in range(count):
            reading = outputs + rng.normal(size=len(NOISE)) * NOISE
            found.append(detector.observe(len(found) * SAMPLE_TIME_S, reading, float(w[3]), float(w[5])))
            detector.commanded(w[:2])
            outputs = plant.step(w, SAMPLE_TIME_S)

    for w, count in random_holds(seed):
        run(w, min(count, ticks - len(found)))
    random = len(found)
    run(held_inputs(operating_point(name).inputs, load_parameters())[:N_INPUTS], round(REST_S / SAMPLE_TIME_S))
    innovations, residuals = (np.array([getattr(one, of) for one in found]) for of in ("innovation", "residual"))
    last = innovations[-round(60.0 / SAMPLE_TIME_S) :]
    return Hour(
        is_finite=bool(np.isfinite(innovations).all() and np.isfinite(residuals).all()),
        median=tuple(np.median(np.abs(innovations[:random]), axis=0).tolist()),
        rms=tuple(np.sqrt(np.mean(last**2, axis=0)).tolist()),
        residual=tuple(residuals[-1].tolist()),
        isolated=found[-1].isolated,
    )


def main() -> None:
    """Run the hours and print the worst of each figure."""
    one_blas_thread()
    hours = int(sys.argv[1]) if len(sys.argv) > 1 else 50
    with ProcessPoolExecutor(2) as pool:
        done = list(pool.map(hour, range(hours)))
    median, rms = np.max([one.median for one in done], axis=0), np.max([one.rms for one in done], axis=0)
    f_n, f_p = np.abs([one.residual for one in done]).max(axis=0)
    print(f"{hours} h of random inputs: {sum(not one.is_finite for one in done)} with numbers that are not finite")
    print(f"median of |f_e| in the worst hour: {median[0]:.0f} Pa, {median[1]:.2f} K, {median[2]:.2f} K")
    print(f"after {REST_S:g} s at rest, the worst: f_e {rms[0]:.0f} Pa, {rms[1]:.2f} K, {rms[2]:.2f} K rms; ", end="")
    print(f"f_N {f_n / RPM:.2f} rpm, f_p {f_p / KPA:.2f} kPa; ", end="")
    counts = Counter(one.isolated for one in done)
    print("isolated: " + ", ".join(f"{name or 'nothing'} in {count}" for name, count in counts.items()))


if __name__ == "__main__":
    main()
