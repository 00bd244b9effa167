"""The GIMC structure: a plant with disturbances and faults, its controller in factors, and the loop that they close.

Plant (the paper's equation 1), observer and controller in the signs of Lemma 1 (Campos-Delgado et al. 2005; Zhou and
Ren 2001):

    dx/dt = A x + B u + E1 d + F1 f        f_e = N~ u - M~ y
    y     = C x + D u + E2 d + F2 f        u   = V~^-1 (U~ (r - y) + q),   K = V~^-1 U~

    M~ = (A+LC, L, C, I)   N~ = (A+LC, B+LD, C, D)   N~d = (A+LC, E1+L E2, C, E2)   N~f = (A+LC, F1+L F2, C, F2)
    V~ = (Ak+Lk Ck, Lk, Ck, I)   U~ = (Ak+Lk Ck, Bk+Lk Dk, Ck, Dk)
"""

from dataclasses import dataclass, replace

import control
import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class FaultySystem:
    """A linear plant with commands u, disturbances d and faults f.

    Attributes
    ----------
    A, B, C, D : ndarray, shapes (n, n), (n, m), (p, n), (p, m)
    E1, E2 : ndarray, shapes (n, nd), (p, nd)
        Disturbances on states and outputs.
    F1, F2 : ndarray, shapes (n, nf), (p, nf)
        Faults on states and outputs.
    """

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    E1: Matrix
    E2: Matrix
    F1: Matrix
    F2: Matrix

    def with_faults(self, columns: list[int]) -> "FaultySystem":
        """Return the same plant with only some of its faults."""
        return replace(self, F1=self.F1[:, columns], F2=self.F2[:, columns])

    def with_outputs(self, rows: list[int]) -> "FaultySystem":
        """Return the same plant with only some of its measurements."""
        return replace(self, C=self.C[rows], D=self.D[rows], E2=self.E2[rows], F2=self.F2[rows])


def disturbance_factor(system: FaultySystem, L: Matrix) -> control.StateSpace:
    """N~d, the coprime factor from the disturbances: `(A+LC, E1+L E2, C, E2)`."""
    return control.ss(system.A + L @ system.C, system.E1 + L @ system.E2, system.C, system.E2)


def fault_factor(system: FaultySystem, L: Matrix) -> control.StateSpace:
    """N~f, the coprime factor from the faults: `(A+LC, F1+L F2, C, F2)`."""
    return control.ss(system.A + L @ system.C, system.F1 + L @ system.F2, system.C, system.F2)


def closed_loop(system: FaultySystem, K: control.StateSpace, Lk: Matrix) -> control.StateSpace:
    """Loop of plant and controller, as far as the compensator sees it.

    The controller reads the first outputs of the plant, as many as it has inputs. With `u = Ck xi + Dk e + q` read back
    into V~ and U~, their state obeys `d(xi)/dt = Ak xi + Bk e - Lk q`.

    Parameters
    ----------
    system : FaultySystem
        Without direct feedthrough (`D = 0`).
    K : StateSpace
        Controller from `e = r - y` to u.
    Lk : ndarray, shape (nk, m)
        Gain of its left coprime factors.

    Returns
    -------
    StateSpace
        Inputs [r, d, f, q], outputs [u, y] (y as measured, faults included).

    Raises
    ------
    ValueError
        When the plant has a direct feedthrough.
    """
    if np.any(system.D):
        raise ValueError("closed_loop: the plant's direct feedthrough D must be zero")
    nk, m, pk = K.nstates, K.noutputs, K.ninputs
    C, E2, F2 = system.C[:pk], system.E2[:pk], system.F2[:pk]
    BD = system.B @ K.D
    A = np.block([[system.A - BD @ C, system.B @ K.C], [-K.B @ C, K.A]])
    B = np.block(
        [
            [BD, system.E1 - BD @ E2, system.F1 - BD @ F2, system.B],
            [K.B, -K.B @ E2, -K.B @ F2, -Lk],
        ]
    )
    p = len(system.C)
    outputs = np.block([[-K.D @ C, K.C], [system.C, np.zeros((p, nk))]])
    direct = np.block(
        [
            [K.D, -K.D @ E2, -K.D @ F2, np.eye(m)],
            [np.zeros((p, pk)), system.E2, system.F2, np.zeros((p, m))],
        ]
    )
    return control.ss(A, B, outputs, direct)
