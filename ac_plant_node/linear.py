"""Linearisation of the plant at an operating point."""

from collections.abc import Sequence
from functools import cache

import control
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import matrix_balance, null_space

from ac_plant_node.dynamics import balances
from ac_plant_node.dynamics.drive import held_inputs
from ac_plant_node.equilibrium import X_SCALE, OperatingPoint, operating_point, rates
from ac_plant_node.inputs import FAULT_KINDS, FAULTS, INPUT_NAMES, N_FAULTS, N_INPUTS, N_PAPER, N_PHYSICS
from ac_plant_node.inputs import INPUTS as PLANT_INPUTS
from ac_plant_node.parameters.file import load_parameters
from ac_plant_node.properties.tables import load_tables

INPUTS = INPUT_NAMES[:N_PAPER]
"""Inputs of the linear model: rad/s, 0..1, kg/s, K."""
OUTPUTS = ("evaporator_pressure", "superheat", "wall_temperature")
"""Outputs of the linear model: Pa, K, K."""
ALL_INPUTS = INPUT_NAMES + FAULT_KINDS[:N_PHYSICS]
"""Inputs that a linear model can have: those of the plant, and the faults that act on its balances; SI."""
MORE_OUTPUTS = {
    "condenser_pressure": balances.P_C,
    "subcooling": balances.SUBCOOLING,
    "cooling_power": balances.Q_AIR_E,
    "latent_cooling": balances.LATENT,
    "compressor_power": balances.POWER,
    "condensed_water": balances.WATER,
}
"""Further outputs that a linear model can have (Pa, K, W, W, W, kg/s), and where the right-hand side puts them."""

_STEP = np.array([row.step for row in PLANT_INPUTS] + [row.step for row in FAULTS[:N_PHYSICS]])
_LEAK = ALL_INPUTS.index("refrigerant_leak")
_REL_STEP = 3.0e-6

Matrix = NDArray[np.float64]
Result = tuple[Matrix, Matrix, Matrix]


class _Model:
    """The plant's rates and outputs around an operating point."""

    def __init__(self, point: OperatingPoint) -> None:
        self.parameters = load_parameters()
        self._tab = load_tables(self.parameters.refrigerant)
        self._x, self._held = point.state, held_inputs(point.inputs, self.parameters)

    def moved(self, dx: Matrix | float = 0.0, column: int = 0, dw: float = 0.0) -> Result:
        """Return `rates` with x moved by `dx` and one input of `ALL_INPUTS` by `dw`."""
        held, faults = self._held.copy(), np.zeros(N_FAULTS)
        held[column] += dw
        faults[:N_PHYSICS] = held[N_INPUTS:]
        return rates(self._x + dx, held[:N_INPUTS], self.parameters, self._tab, faults)

    def by_x(self, j: int, step: float) -> tuple[Result, Result]:
        """Return `moved` by +step and -step of component j of x."""
        e = np.zeros(12)
        e[j] = step
        return self.moved(e), self.moved(-e)

    def by_w(self, column: int) -> tuple[Result, Result, float]:
        """Return `moved` by a step of an input to either side, of a fault too, and their distance."""
        step = float(_STEP[column])
        return self.moved(column=column, dw=step), self.moved(column=column, dw=-step), 2.0 * step


def descriptor(point: OperatingPoint, inputs: tuple[str, ...] = INPUTS) -> tuple[Matrix, Matrix, Matrix]:
    """Return the Jacobians of the twelve-state model in the paper's state x at an equilibrium.

    With the integration state ``s = s(x)`` and its rates ``f(x, w)`` the model is ``K dx/dt = f``, ``K = ds/dx``, hence
    ``A = K^-1 df/dx`` and ``B = K^-1 df/dw``.

    Returns
    -------
    tuple
        A (12, 12), B (12, len(inputs)), and the row ``dM/dx`` (12,), the gradient of the refrigerant mass: a left null
        vector of A and of B, because the charge is conserved whatever the inputs do, a leak excepted.
    """
    at = _Model(point)
    k = np.empty((12, 12))
    f_x = np.empty((12, 12))
    f_w = np.empty((12, len(inputs)))
    for j in range(12):
        step = _REL_STEP * X_SCALE[j]
        (s_up, f_up, _), (s_dn, f_dn, _) = at.by_x(j, step)
        k[:, j] = (s_up - s_dn) / (2.0 * step)
        f_x[:, j] = (f_up - f_dn) / (2.0 * step)
    columns = [ALL_INPUTS.index(name) for name in inputs]
    for j, column in enumerate(columns):
        up, down, distance = at.by_w(column)
        f_w[:, j] = (up[1] - down[1]) / distance
    # The condenser's mass rate is minus the evaporator's: say so exactly instead of to the accuracy of differences.
    f_x[5], f_w[5] = -f_x[0], -f_w[0] - np.equal(columns, _LEAK)
    return np.linalg.solve(k, f_x), np.linalg.solve(k, f_w), k[0] + k[5]


def output_jacobian(point: OperatingPoint, outputs: tuple[str, ...] = OUTPUTS) -> Matrix:
    """Return the Jacobian (len(outputs), 12) with respect to x; T_w is T_e2w."""
    at = _Model(point)
    full = np.zeros((len(OUTPUTS) + len(MORE_OUTPUTS), 12))
    full[0, 1] = 1.0
    full[2, 4] = 1.0
    for j in (1, 2):
        step = 1.0e-4 * X_SCALE[j]
        up, down = at.by_x(j, step)
        full[1, j] = (up[2][balances.SUPERHEAT] - down[2][balances.SUPERHEAT]) / (2.0 * step)
    if any(name in MORE_OUTPUTS for name in outputs):
        for j in range(12):
            step = _REL_STEP * X_SCALE[j]
            up, down = at.by_x(j, step)
            full[len(OUTPUTS) :, j] = (up[2] - down[2])[list(MORE_OUTPUTS.values())] / (2.0 * step)
    return full[[(*OUTPUTS, *MORE_OUTPUTS).index(name) for name in outputs]]


def _feedthrough(point: OperatingPoint, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> Matrix:
    """Return D (len(outputs), len(inputs)); p_e, SH and T_w are functions of the state alone."""
    d = np.zeros((len(outputs), len(inputs)))
    rows = [(i, MORE_OUTPUTS[name]) for i, name in enumerate(outputs) if name in MORE_OUTPUTS]
    if rows:
        at = _Model(point)
        for j, name in enumerate(inputs):
            up, down, distance = at.by_w(ALL_INPUTS.index(name))
            for i, position in rows:
                d[i, j] = (up[2][position] - down[2][position]) / distance
    return d


def linearize(
    point: str | OperatingPoint, inputs: Sequence[str] = INPUTS, outputs: Sequence[str] = OUTPUTS
) -> control.StateSpace:
    """Return the state-space model of the plant around an operating point, in deviations from it.

    The twelve-state Jacobian has one zero eigenvalue, the conserved charge, which no input reaches. Its left vector
    ``m = dM/dx`` is projected out: with ``x = T q``, the columns of T a basis of the plane ``m x = 0`` in scaled
    coordinates, eleven states remain and nothing is neglected. With the leak among the inputs, which does reach it, all
    twelve stay. The states are then scaled (powers of two) so that the matrix is balanced.

    Parameters
    ----------
    point : str or OperatingPoint
        "low", "med", "high" or an equilibrium.
    inputs : sequence of str
        Out of `ALL_INPUTS`; a fault is an input like the others, zero at the point.
    outputs : sequence of str
        Out of `OUTPUTS` and `MORE_OUTPUTS`.

    Returns
    -------
    control.StateSpace
        11 states, or 12 with the leak; by default inputs `INPUTS` (rad/s, 0..1, kg/s, K), outputs `OUTPUTS` (Pa, K, K).

    Raises
    ------
    ValueError
        For an unknown point, input or output.
    """
    wanted_in, wanted_out = tuple(inputs), tuple(outputs)
    for name, known in [(n, ALL_INPUTS) for n in wanted_in] + [(n, (*OUTPUTS, *MORE_OUTPUTS)) for n in wanted_out]:
        if name not in known:
            raise ValueError(f"no signal {name!r} of the linear plant: allowed are {', '.join(known)}")
    if isinstance(point, str):
        return _of_table(point, load_parameters().identity, wanted_in, wanted_out)
    return _linearized(point, wanted_in, wanted_out)


@cache
def _of_table(point: str, _plant: str, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> control.StateSpace:
    return _linearized(operating_point(point), inputs, outputs)


def _linearized(at: OperatingPoint, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> control.StateSpace:
    a, b, m = descriptor(at, inputs)
    c, d = output_jacobian(at, outputs), _feedthrough(at, inputs, outputs)
    scale = X_SCALE
    a, b, c, m = a / scale[:, None] * scale, b / scale[:, None], c * scale, m * scale
    if "refrigerant_leak" not in inputs:
        basis = null_space(m[None, :])
        a, b, c = basis.T @ a @ basis, basis.T @ b, c @ basis
    balanced, (factors, permutation) = matrix_balance(a, separate=True)
    b, c = b[permutation] / factors[permutation, None], c[:, permutation] * factors[permutation]
    return control.ss(balanced, b, c, d, inputs=list(inputs), outputs=list(outputs), name=f"plant_{at.name or 'at'}")
