"""Stability of plant and K0 over a moving load: the time-difference dynamics at states that are not equilibria.

Along a trajectory of plant and K0 the difference to a neighbouring one obeys `dz+ = J dz`, J the Jacobian of one tick
at the state of that tick. No equilibrium and no constant load is assumed: references, air and constant faults are the
same for both, so a loop whose differences die out forgets where it began. Limits of the commands are taken not to act.
Two numbers of a sequence of J are computed:

* the largest real part of a pole of the frozen loops, the slowest mode that any one J has;
* the growth of differences over a window of the sequence itself, which is what they really do: the norm of the product
  of the J in it. Below one for every window, differences decay exponentially along that trajectory.

The coordinates of the plant are those of its integration (mass, energies, wall temperatures; the charge, which nothing
changes, taken out), so there is no further term from the moving state.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from ac_plant_node import load_parameters
from ac_plant_node.dynamics.balances import SUPERHEAT
from ac_plant_node.equilibrium import X_SCALE, rates
from ac_plant_node.properties.tables import load_tables
from gimc_controller_node import ControllerDesign

Matrix = NDArray[np.float64]

STATE_SCALE = np.array([1e-2, 1e3, 1e5, 5.0, 5.0, 1e4, 0.1, 1e5, 5.0, 5.0, 5.0])
"""Typical excursions of the plant's eleven coordinates: they define what the norm of a difference is."""

_CONDENSER_MASS = 5
_STEP, _COMMAND_STEP = 1e-5, np.array([1e-2, 1e-4])


def plant_jacobians(state: Matrix, inputs: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Return A (11, 11), B (11, 2), C (2, 11) of the plant at any state with all five zones.

    Parameters
    ----------
    state : ndarray, shape (12,)
        `Plant.state`; need not be an equilibrium.
    inputs : ndarray, shape (n,)
        `Plant.inputs`. B is by the first two, C of p_e [Pa] and SH [K].
    """
    parameters = load_parameters()
    tables = load_tables(parameters.refrigerant)

    def at(x: Matrix, w: Matrix) -> tuple[Matrix, Matrix, Matrix]:
        s, rate, aux = rates(x, w, parameters, tables)
        return s, rate, np.array([x[1], aux[SUPERHEAT]])

    def slopes(dx: Matrix, dw: Matrix, size: float) -> list[Matrix]:
        up, down = at(state + dx, inputs + dw), at(state - dx, inputs - dw)
        return [(one - other) / (2.0 * size) for one, other in zip(up, down, strict=True)]

    none_x, none_w = np.zeros(12), np.zeros(len(inputs))
    by_x = [slopes(_STEP * scale * np.eye(12)[j], none_w, _STEP * scale) for j, scale in enumerate(X_SCALE)]
    by_u = [slopes(none_x, step * np.eye(len(inputs))[j], step) for j, step in enumerate(_COMMAND_STEP)]
    s_x, f_x, y_x = (np.column_stack([one[i] for one in by_x]) for i in range(3))
    to_state = np.linalg.inv(s_x)
    A, C, B = f_x @ to_state, y_x @ to_state, np.column_stack([one[1] for one in by_u])
    kept = np.delete(np.eye(12), _CONDENSER_MASS, axis=1)
    kept[_CONDENSER_MASS, 0] = -1.0  # what leaves the condenser is in the evaporator
    rows = np.delete(np.arange(12), _CONDENSER_MASS)
    return (A @ kept)[rows], B[rows], C @ kept


def tick_jacobian(state: Matrix, inputs: Matrix, k0: ControllerDesign) -> Matrix:
    """Return J of one tick of plant and K0, state [plant in `STATE_SCALE`, K0], shape (11 + n, 11 + n).

    Parameters
    ----------
    state, inputs
        As `plant_jacobians` takes them.
    k0 : ControllerDesign
    """
    A, B, C = plant_jacobians(state, inputs)
    A, B, C = A * STATE_SCALE / STATE_SCALE[:, None], B / STATE_SCALE[:, None], C * STATE_SCALE
    n, m = len(A), len(k0.phi)
    over = np.zeros((n + 2, n + 2))
    over[:n, :n], over[:n, n:] = A, B
    held = expm(over * k0.sample_time_s)[:n]
    slope = 1.0 + k0.curvature * (inputs[:2] - k0.command_rest)  # of the command by its coordinates
    coordinates = np.hstack([-k0.d @ C, k0.c])
    plant = np.hstack([held[:, :n], np.zeros((n, m))]) + held[:, n:] @ (slope[:, None] * coordinates)
    own = np.hstack([-k0.gamma[:, :2] @ C, k0.phi]) + k0.gamma[:, 2:] @ coordinates
    return np.vstack([plant, own])


def slowest_pole(jacobians: Sequence[Matrix], sample_time_s: float) -> float:
    """Return the largest real part of a pole of the frozen loops [rad/s]; below zero: each by itself is stable."""
    radii = [np.abs(np.linalg.eigvals(one)).max() for one in jacobians]
    return float(np.log(max(radii)) / sample_time_s)


def decay(jacobians: Sequence[Matrix], ticks_each: int, window: int) -> Matrix:
    """Return the largest gain of a difference over each window of the sequence, shape (len - window + 1,).

    The metric is that in which the mean of the sequence contracts as far as it can: the Lyapunov matrix of its mean.

    Parameters
    ----------
    jacobians : sequence of ndarray
        In the order of time.
    ticks_each : int
        For how many ticks each of them stands.
    window : int
        Its length, in members of the sequence.
    """
    factor = _factor(np.mean(jacobians, axis=0))
    back = np.linalg.inv(factor)
    steps = [factor @ np.linalg.matrix_power(one, ticks_each) @ back for one in jacobians]
    gains = []
    for start in range(len(steps) - window + 1):
        product = np.eye(len(factor))
        for step in steps[start : start + window]:
            product = step @ product
        gains.append(float(np.linalg.norm(product, 2)))
    return np.array(gains)


def _factor(mean: Matrix) -> Matrix:
    """Return F with `F' F = P`, `P = J' P J + 1` for the mean J: in `|F z|` it contracts."""
    P, power = np.eye(len(mean)), mean
    for _ in range(40):  # doubling: sums of 2^40 terms
        P, power = P + power.T @ P @ power, power @ power
    return np.asarray(np.linalg.cholesky(0.5 * (P + P.T)).T)
