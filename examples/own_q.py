"""Your own compensator Q: estimate the fault and take it back, made from the isolation filter H and the factors of K0.

    python examples/own_q.py                                        writes results/own_q.npz
    acftc run actuator_fault --params-file examples/own_q.yaml --out results/own_q

In u = V~^-1 (U~ (r - y) + q), the signal q = -V~ [f_N, 0]' adds -f_N to the command, and q = U~ [f_p, 0]' takes f_p
out of the reading. With the residuals r = H f_e in place of the faults this is a Q like any other: q = Q f_e. See
docs/how-to/own-controller.md.
"""

from pathlib import Path

import numpy as np

import ac_design
from ac_common.design_file import to_bytes
from gimc_controller_node import CompensatorDesign

FILE = Path("results/own_q.npz")


def estimate_and_subtract(point: str, sample_time_s: float) -> CompensatorDesign:
    """The same Q whatever is isolated: H keeps the two faults apart by itself."""
    fdi = ac_design.design_fdi(point, sample_time_s)
    k0 = ac_design.design_controller(point, sample_time_s)
    m, n = len(fdi.h_a), len(k0.phi)
    from_error, from_speed = k0.gamma[:, [0]], k0.gamma[:, [2]]  # columns of r - y in p_e, and of the compressor speed
    r_n, r_p = fdi.h_c[[0]], fdi.h_c[[1]]
    r_n_direct, r_p_direct = fdi.h_d[[0]], fdi.h_d[[1]]
    speed = np.array([[1.0], [0.0]])

    a = np.zeros((m + n, m + n))
    a[:m, :m] = fdi.h_a
    a[m:, :m] = from_error @ r_p + from_speed @ r_n
    a[m:, m:] = k0.phi
    b = np.vstack([fdi.h_b, from_error @ r_p_direct + from_speed @ r_n_direct])
    c = np.hstack([k0.d[:, [0]] @ r_p - speed @ r_n, k0.c])
    d = k0.d[:, [0]] @ r_p_direct - speed @ r_n_direct
    ours = ac_design.design_compensator(point, sample_time_s)
    return CompensatorDesign(
        a=a,
        b=b,
        c=np.tile(c, (3, 1)),  # rows: the guard, Q_act, Q_sen
        d=np.tile(d, (3, 1)),
        handover_time_s=ours.handover_time_s,
        fade_time_s=ours.fade_time_s,
        washout_time_s=ours.washout_time_s,
        sample_time_s=sample_time_s,
    )


if __name__ == "__main__":
    FILE.parent.mkdir(exist_ok=True)
    FILE.write_bytes(to_bytes(estimate_and_subtract("med", 0.1)))
    print(f"wrote {FILE}")
