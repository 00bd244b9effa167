"""How far another seed of the noise moves p_e along random drives, beside what a fault that is accommodated leaves.

    python -m docs.tools.envelope_noise 20000 80

A drive is played without a fault, with 5 kPa of the pressure's sensor from 900 s on, and without a fault but with other
noise. Both differences from the first are looked at from 60 s after the onset on: their largest values, and the
condenser pressure where each is.
"""

import argparse

import numpy as np

from ac_common.units import KPA
from ac_experiments.designs import designs_of
from ac_experiments.recording import Recording
from ac_experiments.scenario import load
from ac_experiments.simulate import simulate

ONSET_S, LATE_S = 900.0, 60.0
FAULT = f"faults=[{{kind: evaporator_pressure, size_kpa: 5, onset_s: {ONSET_S:g}}}]"
OTHER_SEEDS = 1_000_000


def largest(one: Recording, other: Recording) -> tuple[float, float]:
    """Return the largest difference of p_e, late, and the condenser pressure of `one` there, both in kPa."""
    late = one.time_s >= ONSET_S + LATE_S
    off = np.abs(other.series["plant/evaporator_pressure"] - one.series["plant/evaporator_pressure"])[late]
    at = int(off.argmax())
    return float(off[at]) / KPA, float(one.series["plant/condenser_pressure"][late][at]) / KPA


def main() -> None:
    """Print both differences for each drive, and how they are spread."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("first", type=int)
    parser.add_argument("count", type=int)
    given, found = parser.parse_args(), []
    for seed in range(given.first, given.first + given.count):
        drive = load(f"drive:{seed}")
        designs, noise = designs_of(drive), f"noise.seed={drive.noise.seed + OTHER_SEEDS}"
        plain, *others = (simulate(load(f"drive:{seed}", more), designs=designs) for more in ([], [FAULT], [noise]))
        (fault, head), (noisy, noisy_head) = (largest(plain, other) for other in others)
        found.append((fault, head, noisy, noisy_head))
        print(
            f"{drive.name}: fault {fault:.2f} kPa at p_c {head:.0f} kPa, noise {noisy:.2f} at {noisy_head:.0f}",
            flush=True,
        )
    fault, head, noisy, _ = np.array(found).T
    for name, off in (("fault", fault), ("noise", noisy)):
        print(f"{name}: 95 % {np.quantile(off, 0.95):.2f}, worst {off.max():.2f} kPa")
    print(f"p_c where the fault leaves more than 0.5 kPa: {np.sort(head[fault > 0.5]).round()}")


if __name__ == "__main__":
    main()
