"""How well small faults of the pressure sensor and of the compressor can be told apart at best, along random drives.

    python -m docs.tools.envelope_bound 10050 14
    python -m docs.tools.envelope_bound 31040 1 --within 180

A detector that knew when a fault begins and how large it is, and that had only to say whether it is 0.4 kPa of the
sensor or whatever fault of the compressor looks most alike, would compare two known signals in white noise: with `G_N`
and `G_p` what either fault does to the innovations and S their covariance,

    J = 0.4 kPa^2 (S_pp - S_Np^2 / S_NN),   S_ij = sum over ticks of G_i' S^-1 G_j

is the deflection of their likelihood ratio (Kay, Fundamentals of Statistical Signal Processing II, 1998, ch. 4), and
``Phi(sqrt(J) / 2)`` the probability that it says the right name. No detector on the same observer has a higher one. For
6 rpm of the compressor it is the same with N and p the other way round. Other sizes, and how long after the onset it
may wait, are options.
"""

import argparse

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from ac_common.units import KPA, RPM
from ac_experiments.designs import designs_of
from ac_experiments.scenario import load
from ac_experiments.simulate import simulate
from ac_plant_node.dynamics.balances import N_STATES
from fdi_node.envelope import EnvelopeDesign, EnvelopeDetector
from fdi_node.envelope.filter import SHORT_R
from fdi_node.envelope.memory import DOUBT

SIZES, ONSET_S = (6.0 * RPM, 0.4 * KPA), 900.0
"""The faults, f_N [rad/s] and f_p [Pa], unless others are asked for."""
_READ = (
    "measured/evaporator_pressure", "measured/superheat", "measured/wall_temperature", "measured/condenser_pressure",
    "measured/air_inlet_temperature", "measured/condenser_air_inlet_temperature",
    "controller/command:compressor", "controller/command:expansion_valve",
)  # fmt: skip


def information(design: EnvelopeDesign, ticks: NDArray[np.float64], onset: int) -> NDArray[np.float64]:
    """Return S (2, 2) [1/(rad/s), 1/Pa, squared] of jumps of f_N and f_p at a tick, to the last one.

    Parameters
    ----------
    design : EnvelopeDesign
    ticks : ndarray, shape (n, 8)
        Readings, inlet temperatures and commands.
    onset : int
    """
    detector = EnvelopeDetector(design)
    m, scales = detector.memory, detector.rules.rows[:2, 2]
    n = len(m.P)  # rows of the memory may be longer
    V, found = np.zeros((n, 2)), np.zeros((2, 2))
    V[N_STATES : N_STATES + 2] = np.eye(2)
    for k, tick in enumerate(ticks):
        P = m.P[:, :n].copy()
        detector.observe(k * design.sample_time_s, tick[:4], tick[4], tick[5])
        if k >= onset:
            R = np.diag(detector.rules.R + m.scalars[DOUBT] ** 2 * SHORT_R)
            C = m.C[:, :n]
            gain, G = np.linalg.solve(C @ P @ C.T + R, C @ P), C @ V
            found += G.T @ np.linalg.solve(C @ P @ C.T + R, G)
            V -= gain.T @ G
        detector.commanded(tick[6:])
        if k >= onset:
            V[:N_STATES] = m.F[:, :n] @ V
    return np.asarray(found / np.outer(scales, scales))


def deflection(S: NDArray[np.float64], fault: int, sizes: tuple[float, float] = SIZES) -> tuple[float, float]:
    """Return J of f_N or f_p (0, 1) of its size in `sizes`, and the size of the other that looks most like it."""
    size, other = sizes[fault], 1 - fault
    return size**2 * float(S[fault, fault] - S[0, 1] ** 2 / S[other, other]), size * float(S[0, 1] / S[other, other])


def main() -> None:
    """Print the bound for each drive, and its mean."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("first", type=int)
    parser.add_argument("count", type=int)
    parser.add_argument("--rpm", type=float, default=6.0)
    parser.add_argument("--kpa", type=float, default=0.4)
    parser.add_argument("--within", type=float, default=60.0, help="seconds (60)")
    given = parser.parse_args()
    sizes = (given.rpm * RPM, given.kpa * KPA)
    right: list[list[float]] = []
    for seed in range(given.first, given.first + given.count):
        drive = load(f"drive:{seed}", [f"duration_s={ONSET_S + given.within:g}"])
        designs = designs_of(drive)
        assert isinstance(designs.fdi, EnvelopeDesign)
        run = simulate(drive, True, designs=designs)
        ticks = np.column_stack([run.series[key] for key in _READ])
        S = information(designs.fdi, ticks, round(ONSET_S / drive.sample_time_s))
        (J_n, like_n), (J_p, like_p) = (deflection(S, fault, sizes) for fault in range(2))
        right.append(norm.cdf(np.sqrt([J_n, J_p]) / 2.0).tolist())
        for name, J, like, probable in (
            (f"{given.rpm:g} rpm", J_n, f"{like_n / KPA:+.2f} kPa", right[-1][0]),
            (f"{given.kpa:g} kPa", J_p, f"{like_p / RPM:+.1f} rpm", right[-1][1]),
        ):
            print(f"{drive.name}: {name}: J {J:.1f}, like {like}, right with probability {probable:.4f}", flush=True)
    print(f"mean {np.mean(right, axis=0).round(4)}, least {np.min(right, axis=0).round(4)}")


if __name__ == "__main__":
    main()
