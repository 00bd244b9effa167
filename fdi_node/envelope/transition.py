"""Transition over one tick of the linearised plant with its unknowns held, exactly."""

from ac_plant_node.dynamics.balances import N_STATES
from ac_plant_node.dynamics.exponential import make_phi
from ac_plant_node.dynamics.workspace import AGE, ERROR_SCALE, PHI_0, PHI_1, Work
from fdi_node.envelope.compiled import Array, jit

MOST_GROWTH = 1.0e3
"""No plant carries more than so much of anything from one tick to the next; differences across a kink can say so."""
_LENT = 0.5
"""Age of a Jacobian that the integration is lent: one of its own takes its place when it does not serve."""


@jit
def transition(k: Work, A: Array, h: float, F: Array) -> bool:
    """Work out `F` (12, n) of ``x+ = F [x, u]`` from `A` (12, n) of ``dx/dt = A [x, u]``, u constant, over h.

    ``F = [phi_0(hA_x), h phi_1(hA_x) A_u]``, all in units of the scales. The phi functions are those of the exponential
    step; the integration `k` goes on with them and with this Jacobian. False when that is beyond `MOST_GROWTH`.
    """
    for i in range(N_STATES):
        for j in range(N_STATES):
            k.jac[i, j] = A[i, j] * ERROR_SCALE[i] / ERROR_SCALE[j]
    k.memory[AGE] = _LENT
    make_phi(k, h)
    for i in range(N_STATES):
        for j in range(N_STATES, A.shape[1]):
            F[i, j] = 0.0
        for m in range(N_STATES):
            unit = ERROR_SCALE[m] / ERROR_SCALE[i]
            F[i, m] = k.phi[PHI_0, i, m] * unit
            f = h * k.phi[PHI_1, i, m] * unit
            for j in range(N_STATES, A.shape[1]):
                F[i, j] += f * A[m, j]
    for i in range(N_STATES):
        for j in range(A.shape[1]):
            if not abs(F[i, j]) <= MOST_GROWTH:
                return False
    return True


@jit
def hold(F: Array) -> None:
    """Make `F` (12, n) that of a plant that stays where it is."""
    for i in range(N_STATES):
        for j in range(F.shape[1]):
            F[i, j] = 1.0 if i == j else 0.0
