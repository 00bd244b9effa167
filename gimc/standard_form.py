"""Plant of an H-infinity problem in the form that the Riccati equations want, with every assumption checked on the way.

Zhou, Doyle and Glover, "Robust and Optimal Control" (1996), section 17.1; D22 is taken out, see section 17.2.
"""

from dataclasses import dataclass

import numpy as np

from gimc.errors import (
    ImaginaryAxisZeroError,
    NotDetectableError,
    NotStabilisableError,
    RankDeficientD12Error,
    RankDeficientD21Error,
    SynthesisError,
)
from gimc.interconnect import Abcd, Matrix
from gimc.modes import axis_zero, unreachable_mode
from gimc.scaling import balance_states

RANK_TOLERANCE = 1e-10  # singular values relative to the largest


@dataclass(frozen=True)
class Standard:
    """Plant in the form of Zhou 17.1: D12 = [0; I], D21 = [0 I], D22 = 0; and the scalings that lead back.

    `y_scaled = Ry y`, `u = Ru u_scaled`; z and w are only rotated, so norms are those of the caller's problem.
    """

    sys: Abcd
    nmeas: int
    ncon: int
    Ru: Matrix
    Ry: Matrix
    D22: Matrix

    @property
    def dims(self) -> tuple[int, int, int, int]:
        """(m1, m2, p1, p2)."""
        p, m = self.sys.D.shape
        return m - self.ncon, self.ncon, p - self.nmeas, self.nmeas


def standard_form(plant: Abcd, nmeas: int, ncon: int) -> Standard:
    """Rotate z and w, scale u and y, so that D12 = [0; I] and D21 = [0 I]; check every assumption on the way."""
    A, B, C, D = plant
    p1, m1 = D.shape[0] - nmeas, D.shape[1] - ncon
    Tz, Ru = _column_compression(D[:p1, m1:], RankDeficientD12Error, "D12", "control input", "add a penalty on u to z")
    Tw, Ry = _column_compression(D[p1:, :m1].T, RankDeficientD21Error, "D21", "measurement", "add a noise on y to w")
    left = np.zeros((p1 + nmeas, p1 + nmeas))
    left[:p1, :p1], left[p1:, p1:] = Tz.T, Ry.T
    right = np.zeros((m1 + ncon, m1 + ncon))
    right[:m1, :m1], right[m1:, m1:] = Tw, Ru
    Bs, Cs, Ds = B @ right, left @ C, left @ D @ right
    # Exact where they are known: rounding here would enter every Riccati equation.
    Ds[:p1, m1:] = np.eye(p1, ncon, k=ncon - p1)
    Ds[p1:, :m1] = np.eye(nmeas, m1, k=m1 - nmeas)
    Ds[p1:, m1:] = 0.0
    # States balanced again, now that y and u have their own scale.
    standard = Standard(balance_states(Abcd(A, Bs, Cs, Ds)), nmeas, ncon, Ru, Ry.T, D[p1:, m1:])
    _check_modes(standard)
    _check_zeros(standard)
    return standard


def _column_compression(
    D12: Matrix, error: type[SynthesisError], name: str, signal: str, remedy: str
) -> tuple[Matrix, Matrix]:
    """Orthogonal T and invertible R with `T' D12 R = [0; I]`. Column scales are taken out before rank is judged."""
    rows, columns = D12.shape
    norms = np.linalg.norm(D12, axis=0)
    if rows < columns:
        raise error(f"{name} cannot have full rank: {columns} {signal}s against {rows} signals; {remedy}")
    if (norms == 0).any():
        raise error(f"{name}: {signal} {int(np.argmin(norms))} (counted from 0) has no direct term; {remedy}")
    U, s, Vt = np.linalg.svd(D12 / norms)
    if s[-1] <= RANK_TOLERANCE * s[0]:
        values = np.array2string(s, precision=3)
        raise error(f"{name} does not have full rank: singular values {values} with {signal}s normalised; {remedy}")
    T = np.hstack([U[:, columns:], U[:, :columns]])
    return T, Vt.T / s / norms[:, None]


def _check_modes(standard: Standard) -> None:
    A, B, C, _ = standard.sys
    m1, _, p1, _ = standard.dims
    B2, C2 = B[:, m1:], C[p1:]
    mode = unreachable_mode(A, B2)
    if mode is not None:
        raise NotStabilisableError(
            f"(A, B2) is not stabilisable: u does not reach the mode at {_text(mode)} rad/s; "
            "give a weight that integrates a slow pole (for instance at -1e-4 rad/s) instead of one at or beyond 0"
        )
    mode = unreachable_mode(A.T, C2.T)
    if mode is not None:
        raise NotDetectableError(
            f"(C2, A) is not detectable: y does not see the mode at {_text(mode)} rad/s; "
            "give a weight that integrates a slow pole, or measure its output"
        )


def _check_zeros(standard: Standard) -> None:
    """P12 and P21 have no zeros on the imaginary axis: else a Riccati equation never has a stabilising solution."""
    A, B, C, D = standard.sys
    m1, _, p1, _ = standard.dims
    frequency = axis_zero(A, B[:, m1:], C[:p1], D[:p1, m1:])
    if frequency is not None:
        raise ImaginaryAxisZeroError(
            f"P12 (from u to z) has a zero on the imaginary axis at {frequency:.4g} rad/s: z is blind to the plant "
            "there; weight u or the plant's output at that frequency"
        )
    frequency = axis_zero(A.T, C[p1:].T, B[:, :m1].T, D[p1:, :m1].T)
    if frequency is not None:
        raise ImaginaryAxisZeroError(
            f"P21 (from w to y) has a zero on the imaginary axis at {frequency:.4g} rad/s: w does not excite the plant "
            "there; add a disturbance at the plant's input"
        )


def _text(mode: complex) -> str:
    return f"{mode.real:.4g}" if mode.imag == 0 else f"{mode:.4g}"
