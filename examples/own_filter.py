"""Your own residual filter H: the simplest one that keeps the faults apart at rest, H0 / (10 s + 1) with a constant H0.

    python examples/own_filter.py                                   writes results/own_filter.npz
    acftc run isolation_disturbed --params-file examples/own_filter.yaml --out results/own_filter

At rest f_e = F [f_N, f_p, d]' with a 3 x 3 matrix F, so the first two rows of F^-1 are a residual generator that the
air flow d does not reach. On the way there it does; the thresholds take that into account. See
docs/how-to/own-filter.md.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

import ac_design
from ac_common.design_file import to_bytes
from ac_design.thresholds import noise_thresholds, residual_covariances, step_peaks
from ac_plant_node import linearize, operating_point
from fdi_node import FdiDesign
from gimc import discretise

FILE = Path("results/own_filter.npz")
TIME_S = 10.0
SENSOR_NOISE = np.array([200.0, 0.1, 0.05])  # Pa, K, K rms
FALSE_ALARMS_PER_HOUR = 1e-3


def static_filter(point: str, sample_time_s: float) -> FdiDesign:
    """Our observer, a filter of your own behind it, and the thresholds that this filter needs."""
    ours = ac_design.design_fdi(point, sample_time_s)
    plant = discretise(linearize(point), sample_time_s, "zoh")
    air_step = 0.1 * operating_point(point).inputs[2]

    # f_e = c xi - y with xi+ = a xi + b [u, T_ea, y]: what each cause leaves of it at rest.
    n_tilde, m_tilde = np.split(ours.c @ np.linalg.solve(np.eye(len(ours.a)) - ours.a, ours.b), [3], axis=1)
    m_tilde = np.eye(3) - m_tilde
    plant_gain = plant.C @ np.linalg.solve(np.eye(len(plant.A)) - plant.A, plant.B)
    causes = -np.column_stack([n_tilde[:, 0], m_tilde[:, 0], m_tilde @ plant_gain[:, 2]])
    gain = np.linalg.inv(causes)[:2]

    keeps = np.exp(-sample_time_s / TIME_S)
    h = (keeps * np.eye(2), (1.0 - keeps) * gain, np.eye(2), np.zeros((2, 3)))
    observer = (ours.a, ours.b[:, 3:], ours.c)
    noise = noise_thresholds(*residual_covariances(observer, h, SENSOR_NOISE), sample_time_s, FALSE_ALARMS_PER_HOUR)
    air = step_peaks((plant.A, air_step * plant.B[:, 2], plant.C), observer, h, round(100.0 / sample_time_s))
    return replace(ours, h_a=h[0], h_b=h[1], h_c=h[2], h_d=h[3], thresholds=noise + air)


if __name__ == "__main__":
    FILE.parent.mkdir(exist_ok=True)
    design = static_filter("med", 0.1)
    FILE.write_bytes(to_bytes(design))
    speed, pressure = design.thresholds
    print(f"wrote {FILE}; thresholds {speed * 60 / (2 * np.pi):.2f} rpm and {pressure / 1e3:.3f} kPa")
